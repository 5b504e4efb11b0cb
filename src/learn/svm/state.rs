//! The dual variables of the kept examples and the conditions that they fulfil.

use super::border::Border;
use super::gram::Gram;

/// Where the Karush-Kuhn-Tucker conditions put an example (eq 14 of the LCMHT paper).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Set {
    /// Support vector on the margin: `0 <= a <= C`, `m = 0`.
    Margin,
    /// Support vector inside the margin or misclassified: `a = C`, `m <= 0`.
    Error,
    /// No support vector: `a = 0`, `m >= 0`.
    Reserve,
}

/// How far a margin, and the sum of the signed coefficients, may stand from its condition.
const TOLERANCE: f64 = 1e-9;
/// Corrections of the margin vectors before the inverse counts as spoilt.
const CORRECTIONS: usize = 3;

/// The problem and its solution: coefficient `a_i` in `[0, C]`, label `y_i`, margin `m_i = y_i f(x_i) - 1`, bias.
#[derive(Clone, Debug)]
pub(super) struct SolverState {
    pub(super) gram: Gram,
    pub(super) c: f64,
    pub(super) labels: Vec<f64>,
    pub(super) alphas: Vec<f64>,
    pub(super) margins: Vec<f64>,
    pub(super) sets: Vec<Set>,
    pub(super) bias: f64,
    pub(super) border: Border,
    /// Change of bias and margin vectors' coefficients a unit of the moving coefficient.
    pub(super) beta: Vec<f64>,
    /// Change of all margins likewise.
    pub(super) rates: Vec<f64>,
    /// Right-hand side of a solution with the border.
    pub(super) rhs: Vec<f64>,
    /// How often the increments could not go on.
    pub(super) resolves: usize,
}

impl SolverState {
    pub(super) fn new(gram: Gram, c: f64) -> Self {
        Self {
            gram,
            c,
            labels: Vec::new(),
            alphas: Vec::new(),
            margins: Vec::new(),
            sets: Vec::new(),
            bias: 0.0,
            border: Border::default(),
            beta: Vec::new(),
            rates: Vec::new(),
            rhs: Vec::new(),
            resolves: 0,
        }
    }

    pub(super) fn len(&self) -> usize {
        self.labels.len()
    }

    /// `Q_ij = y_i y_j K_ij`.
    pub(super) fn q(&self, i: usize, j: usize) -> f64 {
        self.labels[i] * self.labels[j] * self.gram.row(i)[j]
    }

    /// Appends an example and learns it.
    pub(super) fn learn(&mut self, x: &[f32], label: f64) {
        let row = self.gram.push(x);
        let signed = row.iter().zip(&self.alphas).zip(&self.labels);
        let f: f64 = signed.map(|((k, a), y)| k * a * y).sum::<f64>() + self.bias;
        self.labels.push(label);
        self.alphas.push(0.0);
        self.margins.push(label * f - 1.0);
        self.sets.push(Set::Reserve);
        let new = self.len() - 1;
        if self.margins[new] >= 0.0 {
            self.centre_bias();
        } else if self.grow(new) {
            self.settle();
        } else {
            self.resolve();
        }
    }

    /// Unlearns example `i` and takes it out; the last one moves into its place.
    pub(super) fn unlearn(&mut self, i: usize) {
        if self.sets[i] == Set::Margin {
            self.border.remove(i);
        }
        let gone = self.alphas[i] == 0.0 || self.shrink(i);
        self.gram.swap_remove(i);
        self.labels.swap_remove(i);
        self.alphas.swap_remove(i);
        self.margins.swap_remove(i);
        self.sets.swap_remove(i);
        self.border.rename(self.len(), i);
        if gone { self.settle() } else { self.resolve() }
    }

    /// Computes every margin from the coefficients and the bias.
    pub(super) fn refresh_margins(&mut self) {
        self.margins.fill(0.0);
        for (j, (&a, &y)) in self.alphas.iter().zip(&self.labels).enumerate() {
            if a != 0.0 {
                for (m, k) in self.margins.iter_mut().zip(self.gram.row(j)) {
                    *m += a * y * k;
                }
            }
        }
        for (m, y) in self.margins.iter_mut().zip(&self.labels) {
            *m = y * (*m + self.bias) - 1.0;
        }
    }

    /// Removes the rounding that the increments have gathered, and solves from scratch should that not be enough.
    fn settle(&mut self) {
        if !self.polish() {
            let members = self.border.members().to_vec();
            if !(self.rebuild_border(&members) && self.polish()) {
                return self.resolve();
            }
        }
        self.centre_bias();
    }

    /// Inverts the bordered matrix of `members` anew; false where it is singular.
    pub(super) fn rebuild_border(&mut self, members: &[usize]) -> bool {
        let (labels, gram) = (&self.labels, &self.gram);
        self.border.rebuild(members, labels, |i, j| labels[i] * labels[j] * gram.row(i)[j])
    }

    /// Corrects bias and margin vectors until all conditions hold; false where they do not.
    pub(super) fn polish(&mut self) -> bool {
        for _ in 0..CORRECTIONS {
            self.refresh_margins();
            if self.is_solved() {
                return true;
            }
            self.correct();
        }
        self.refresh_margins();
        self.is_solved()
    }

    /// Moves bias and margin vectors to where the linear conditions of the margin set hold (a Newton step).
    fn correct(&mut self) {
        if self.border.members().is_empty() {
            return;
        }
        self.rhs.clear();
        self.rhs.push(self.balance());
        self.rhs.extend(self.border.members().iter().map(|&i| self.margins[i]));
        self.border.solve_negated(&self.rhs, &mut self.beta);
        self.bias += self.beta[0];
        for (&i, step) in self.border.members().iter().zip(&self.beta[1..]) {
            self.alphas[i] = (self.alphas[i] + step).clamp(0.0, self.c);
        }
    }

    /// `sum_i y_i a_i`, which eq 15 of the LCMHT paper wants to be 0.
    fn balance(&self) -> f64 {
        self.labels.iter().zip(&self.alphas).map(|(y, a)| y * a).sum()
    }

    /// Whether the KKT conditions hold.
    fn is_solved(&self) -> bool {
        let holds = |(set, &m): (&Set, &f64)| match set {
            Set::Margin => m.abs() <= TOLERANCE,
            Set::Error => m <= TOLERANCE,
            Set::Reserve => m >= -TOLERANCE,
        };
        self.balance().abs() <= TOLERANCE && self.sets.iter().zip(&self.margins).all(holds)
    }

    /// Where no coefficient is free, an interval of biases solves the problem: takes its centre, so that the solution
    /// depends on the examples only, not on their order.
    pub(super) fn centre_bias(&mut self) {
        let snap = TOLERANCE * self.c;
        if self.alphas.iter().any(|&a| snap < a && a < self.c - snap) {
            return;
        }
        for i in 0..self.len() {
            let full = self.alphas[i] > self.c / 2.0;
            self.alphas[i] = if full { self.c } else { 0.0 };
            self.sets[i] = if full { Set::Error } else { Set::Reserve };
        }
        self.border.clear();
        let bias = self.central_bias();
        for (m, y) in self.margins.iter_mut().zip(&self.labels) {
            *m += y * (bias - self.bias);
        }
        self.bias = bias;
    }
}
