//! The kept examples and their kernel matrix.

/// Added to the diagonal of the kernel matrix.
///
/// It makes the dual problem strictly convex, so that duplicates of an example share its coefficient and no bordered
/// matrix is singular. It stays below the rounding of `f32` features: a decision value moves by at most `C * RIDGE`,
/// and only at a support vector itself.
pub(super) const RIDGE: f64 = 1e-8;

/// Feature vectors, row-major `n x dim`, and the symmetric matrix `K + RIDGE * I` of their Gaussian kernel.
#[derive(Clone, Debug)]
pub(super) struct Gram {
    dim: usize,
    gamma: f64,
    features: Vec<f32>,
    rows: Vec<Vec<f64>>,
    /// The row of the example that went last, for the next one.
    spare: Vec<f64>,
}

impl Gram {
    pub(super) fn new(dim: usize, gamma: f64) -> Self {
        Self { dim, gamma, features: Vec::new(), rows: Vec::new(), spare: Vec::new() }
    }

    pub(super) fn dim(&self) -> usize {
        self.dim
    }

    pub(super) fn gamma(&self) -> f64 {
        self.gamma
    }

    pub(super) fn len(&self) -> usize {
        self.rows.len()
    }

    pub(super) fn features(&self, i: usize) -> &[f32] {
        &self.features[i * self.dim..][..self.dim]
    }

    /// Row `i` of the kernel matrix, ridge included.
    pub(super) fn row(&self, i: usize) -> &[f64] {
        &self.rows[i]
    }

    /// The Gaussian kernel of example `i` and `x`, without the ridge.
    pub(super) fn kernel(&self, i: usize, x: &[f32]) -> f64 {
        (-self.gamma * squared_distance(self.features(i), x)).exp()
    }

    /// Appends an example; its row of the kernel matrix.
    pub(super) fn push(&mut self, x: &[f32]) -> &[f64] {
        let mut row = std::mem::take(&mut self.spare);
        row.clear();
        row.extend((0..self.len()).map(|i| self.kernel(i, x)));
        for (other, &k) in self.rows.iter_mut().zip(&row) {
            other.push(k);
        }
        row.push(1.0 + RIDGE);
        self.rows.push(row);
        self.features.extend_from_slice(x);
        &self.rows[self.len() - 1]
    }

    /// Takes example `i` out; the last one moves into its place.
    pub(super) fn swap_remove(&mut self, i: usize) {
        self.spare = self.rows.swap_remove(i);
        for row in &mut self.rows {
            row.swap_remove(i);
        }
        let last = self.len();
        self.features.copy_within(last * self.dim.., i * self.dim);
        self.features.truncate(last * self.dim);
    }

    /// Computes the matrix anew for another kernel.
    pub(super) fn set_gamma(&mut self, gamma: f64) {
        let features = std::mem::take(&mut self.features);
        *self = Self::new(self.dim, gamma);
        for x in features.chunks_exact(self.dim) {
            self.push(x);
        }
    }
}

/// Squared Euclidean distance, summed in `f64` in a fixed order, hence symmetric and 0 for equal vectors.
fn squared_distance(a: &[f32], b: &[f32]) -> f64 {
    const LANES: usize = 8;
    let mut sums = [0.0f64; LANES];
    let (a_chunks, b_chunks) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let rest = a_chunks.remainder().iter().zip(b_chunks.remainder());
    let tail: f64 = rest.map(|(&p, &q)| (f64::from(p) - f64::from(q)).powi(2)).sum();
    for (p, q) in a_chunks.zip(b_chunks) {
        for lane in 0..LANES {
            let d = f64::from(p[lane]) - f64::from(q[lane]);
            sums[lane] += d * d;
        }
    }
    sums.iter().sum::<f64>() + tail
}
