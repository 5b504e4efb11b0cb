//! The inverse of the margin set's bordered kernel matrix, kept by rank-one updates.
//!
//! With `s` margin vectors the matrix is `(s + 1) x (s + 1)`:
//!
//! ```text
//! [ 0    y_S^T ]
//! [ y_S  Q_SS  ]
//! ```
//!
//! Row 0 belongs to the bias, row `k + 1` to the `k`-th margin vector.

use nalgebra::DMatrix;

/// The margin vectors in the order of the rows, and the inverse. Empty without margin vectors.
#[derive(Clone, Debug, Default)]
pub(super) struct Border {
    members: Vec<usize>,
    /// Row-major, `stride` numbers a row.
    inverse: Vec<f64>,
    stride: usize,
    /// The row of a member that goes.
    pivot: Vec<f64>,
}

impl Border {
    /// The margin vectors, as indices of examples.
    pub(super) fn members(&self) -> &[usize] {
        &self.members
    }

    /// Forgets all margin vectors.
    pub(super) fn clear(&mut self) {
        self.members.clear();
    }

    /// Row of the member that is example `i`.
    fn place(&self, i: usize) -> usize {
        1 + self.members.iter().position(|&m| m == i).expect("example is a margin vector")
    }

    /// `out = -inverse * v`, both of `s + 1` numbers.
    pub(super) fn solve_negated(&self, v: &[f64], out: &mut Vec<f64>) {
        out.clear();
        out.resize(v.len(), 0.0);
        // The inverse is symmetric, so its rows serve as columns: a sum of rows vectorises, dot products do not.
        for (row, factor) in self.inverse.chunks_exact(self.stride).zip(v) {
            for (o, r) in out.iter_mut().zip(row) {
                *o -= factor * r;
            }
        }
    }

    /// Takes in example `i`, with `q_ii`, its label, the change `beta` of bias and coefficients a unit of its own
    /// coefficient (ignored for the first member), and its margin's change `schur > 0`.
    pub(super) fn insert(&mut self, i: usize, q_ii: f64, label: f64, beta: &[f64], schur: f64) {
        let size = self.members.len() + 1;
        self.reserve(size + 1);
        self.members.push(i);
        let stride = self.stride;
        if size == 1 {
            self.inverse[0] = -q_ii;
            self.inverse[1] = label;
            self.inverse[stride] = label;
            self.inverse[stride + 1] = 0.0;
            return;
        }
        for (k, row) in self.inverse.chunks_exact_mut(stride).enumerate().take(size) {
            let factor = beta[k] / schur;
            for (r, b) in row.iter_mut().zip(beta) {
                *r += factor * b;
            }
            row[size] = factor;
        }
        let last = &mut self.inverse[size * stride..][..=size];
        for (r, b) in last.iter_mut().zip(beta) {
            *r = b / schur;
        }
        last[size] = 1.0 / schur;
    }

    /// Lets example `i` go.
    pub(super) fn remove(&mut self, i: usize) {
        if self.members.len() == 1 {
            return self.clear();
        }
        let place = self.place(i);
        let (last, stride) = (self.members.len(), self.stride);
        self.members.swap_remove(place - 1);
        let Self { inverse, pivot, .. } = self;
        pivot.clear();
        pivot.extend_from_slice(&inverse[place * stride..][..=last]);
        for (k, row) in inverse.chunks_exact_mut(stride).enumerate().take(last + 1) {
            let factor = pivot[k] / pivot[place];
            for (r, p) in row.iter_mut().zip(&*pivot) {
                *r -= factor * p;
            }
            row[place] = row[last];
        }
        inverse.copy_within(last * stride..last * stride + last, place * stride);
    }

    /// Follows an example from index `from` to index `to`.
    pub(super) fn rename(&mut self, from: usize, to: usize) {
        if let Some(member) = self.members.iter_mut().find(|m| **m == from) {
            *member = to;
        }
    }

    /// Inverts the matrix of `members` anew; false, and empty, where it is singular. `q` gives `Q_ij`.
    pub(super) fn rebuild(&mut self, members: &[usize], labels: &[f64], q: impl Fn(usize, usize) -> f64) -> bool {
        self.members.clear();
        let size = members.len() + 1;
        let matrix = DMatrix::from_fn(size, size, |r, c| match (r, c) {
            (0, 0) => 0.0,
            (0, k) | (k, 0) => labels[members[k - 1]],
            (r, c) => q(members[r - 1], members[c - 1]),
        });
        let Some(inverse) = matrix.try_inverse() else { return false };
        self.reserve(size);
        self.members.extend_from_slice(members);
        for (k, row) in self.inverse.chunks_exact_mut(self.stride).enumerate().take(size) {
            for (j, r) in row.iter_mut().enumerate().take(size) {
                *r = (inverse[(k, j)] + inverse[(j, k)]) / 2.0;
            }
        }
        true
    }

    /// Makes room for `size` rows, keeping what is there.
    fn reserve(&mut self, size: usize) {
        if size <= self.stride {
            return;
        }
        let stride = (2 * size).next_multiple_of(8);
        let mut inverse = vec![0.0; stride * stride];
        if self.stride > 0 {
            for (new, old) in inverse.chunks_exact_mut(stride).zip(self.inverse.chunks_exact(self.stride)) {
                new[..self.stride].copy_from_slice(old);
            }
        }
        (self.inverse, self.stride) = (inverse, stride);
    }
}
