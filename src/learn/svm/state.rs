//! The dual variables of the kept examples and the conditions that they fulfil.

use super::gram::Gram;

/// Where the Karush-Kuhn-Tucker conditions put an example (Diehl and Cauwenberghs; eq 14 of the LCMHT paper).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Set {
    /// Support vector on the margin: `0 <= a <= C`, `m = 0`.
    Margin,
    /// Support vector inside the margin or misclassified: `a = C`, `m <= 0`.
    Error,
    /// No support vector: `a = 0`, `m >= 0`.
    Reserve,
}

/// The problem and its solution: coefficient `a_i` in `[0, C]`, label `y_i`, margin `m_i = y_i f(x_i) - 1`, bias.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub(super) gram: Gram,
    pub(super) c: f64,
    pub(super) labels: Vec<f64>,
    pub(super) alphas: Vec<f64>,
    pub(super) margins: Vec<f64>,
    pub(super) sets: Vec<Set>,
    pub(super) bias: f64,
}

impl State {
    pub(super) fn new(gram: Gram, c: f64) -> Self {
        Self { gram, c, labels: vec![], alphas: vec![], margins: vec![], sets: vec![], bias: 0.0 }
    }

    pub(super) fn len(&self) -> usize {
        self.labels.len()
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
}
