//! The solution from scratch, by sequential minimal optimisation with second-order working sets (Fan, Chen and Lin,
//! "Working set selection using second order information for training SVM", 2005).
//!
//! It stands in where the adiabatic increments cannot go on, and takes up changed settings.

use super::state::{Set, SolverState};

/// Most steps to one tolerance. It bounds the time only: a hundred examples take some thousand steps.
const MAX_STEPS: usize = 50_000;
/// Tolerances in turn. Margin vectors are found by the first as a rule; one exact step on them then ends the search.
const TOLERANCES: [f64; 3] = [1e-6, 1e-9, 1e-12];

impl SolverState {
    /// Solves the problem of all kept examples.
    pub(super) fn resolve(&mut self) {
        self.resolves += 1;
        self.alphas.fill(0.0);
        self.bias = 0.0;
        self.refresh_margins();
        for tolerance in TOLERANCES {
            (0..MAX_STEPS).take_while(|_| self.optimise_pair(tolerance)).count();
            self.bias = self.central_bias();
            let (alphas, bias) = (self.alphas.clone(), self.bias);
            self.assign_sets();
            if self.polish() {
                return self.centre_bias();
            }
            (self.alphas, self.bias) = (alphas, bias);
            self.refresh_margins();
        }
        self.assign_sets();
    }

    /// Puts every example into the set that its coefficient tells.
    fn assign_sets(&mut self) {
        for (set, &a) in self.sets.iter_mut().zip(&self.alphas) {
            *set = if a <= 0.0 {
                Set::Reserve
            } else if a >= self.c {
                Set::Error
            } else {
                Set::Margin
            };
        }
        let members: Vec<usize> = (0..self.len()).filter(|&i| self.sets[i] == Set::Margin).collect();
        self.rebuild_border(&members);
    }

    /// Whether `a_i y_i` can grow.
    fn can_rise(&self, i: usize) -> bool {
        if self.labels[i] > 0.0 { self.alphas[i] < self.c } else { self.alphas[i] > 0.0 }
    }

    /// Whether `a_i y_i` can shrink.
    fn can_fall(&self, i: usize) -> bool {
        if self.labels[i] > 0.0 { self.alphas[i] > 0.0 } else { self.alphas[i] < self.c }
    }

    /// The centre of the biases that agree with all examples; they coincide where a coefficient is free. With one class
    /// there is one end, which is taken; 0 without examples.
    pub(super) fn central_bias(&self) -> f64 {
        let target = |i: usize| self.bias - self.labels[i] * self.margins[i];
        let least = (0..self.len()).filter(|&i| self.can_rise(i)).map(target).reduce(f64::max);
        let greatest = (0..self.len()).filter(|&i| self.can_fall(i)).map(target).reduce(f64::min);
        match (least, greatest) {
            (Some(least), Some(greatest)) => (least + greatest) / 2.0,
            (end, None) | (None, end) => end.unwrap_or(0.0),
        }
    }

    /// Optimises the pair of coefficients that promises most; false where none violates the conditions by `tolerance`.
    fn optimise_pair(&mut self, tolerance: f64) -> bool {
        let score = |s: &Self, i: usize| -s.labels[i] * s.margins[i];
        let Some(i) = (0..self.len())
            .filter(|&i| self.can_rise(i))
            .max_by(|&p, &q| f64::total_cmp(&score(self, p), &score(self, q)))
        else {
            return false;
        };
        let (row, top) = (self.gram.row(i), score(self, i));
        let gain = |j: usize| {
            let curvature = row[i] + self.gram.row(j)[j] - 2.0 * row[j];
            (top - score(self, j)).powi(2) / curvature
        };
        let Some(j) = (0..self.len())
            .filter(|&j| self.can_fall(j) && top - score(self, j) > tolerance)
            .max_by(|&p, &q| f64::total_cmp(&gain(p), &gain(q)))
        else {
            return false;
        };
        let curvature = row[i] + self.gram.row(j)[j] - 2.0 * row[j];
        let (yi, yj) = (self.labels[i], self.labels[j]);
        let room_i = if yi > 0.0 { self.c - self.alphas[i] } else { self.alphas[i] };
        let room_j = if yj > 0.0 { self.alphas[j] } else { self.c - self.alphas[j] };
        let step = ((top - score(self, j)) / curvature).min(room_i).min(room_j);
        let bound = |a: f64, room: f64, up: bool, c: f64| match (step == room, up) {
            (true, true) => c,
            (true, false) => 0.0,
            (false, true) => a + step,
            (false, false) => a - step,
        };
        self.alphas[i] = bound(self.alphas[i], room_i, yi > 0.0, self.c);
        self.alphas[j] = bound(self.alphas[j], room_j, yj < 0.0, self.c);
        for (k, m) in self.margins.iter_mut().enumerate() {
            *m += self.labels[k] * step * (self.gram.row(i)[k] - self.gram.row(j)[k]);
        }
        true
    }
}
