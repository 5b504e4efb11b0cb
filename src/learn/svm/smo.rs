//! The solution from scratch, by sequential minimal optimisation with second-order working sets (Fan, Chen and Lin,
//! "Working set selection using second order information for training SVM", 2005).
//!
//! It stands in where the adiabatic increments cannot go on, and takes up changed settings.

use super::state::{Set, State};

/// Most steps of a solution.
const MAX_STEPS: usize = 100_000;

impl State {
    /// Solves the problem of all kept examples.
    pub(super) fn resolve(&mut self) {
        self.alphas.fill(0.0);
        self.bias = 0.0;
        self.refresh_margins();
        for _ in 0..MAX_STEPS {
            if !self.optimise_pair(1e-12) {
                break;
            }
        }
        let (up, low) = self.bias_interval();
        self.bias = match (up.is_finite(), low.is_finite()) {
            (true, true) => (up + low) / 2.0,
            (true, false) => up,
            (false, true) => low,
            (false, false) => 0.0,
        };
        self.refresh_margins();
        for i in 0..self.len() {
            self.sets[i] = if self.alphas[i] <= 0.0 {
                Set::Reserve
            } else if self.alphas[i] >= self.c {
                Set::Error
            } else {
                Set::Margin
            };
        }
    }

    /// Whether `a_i y_i` can grow.
    fn can_rise(&self, i: usize) -> bool {
        if self.labels[i] > 0.0 { self.alphas[i] < self.c } else { self.alphas[i] > 0.0 }
    }

    /// Whether `a_i y_i` can shrink.
    fn can_fall(&self, i: usize) -> bool {
        if self.labels[i] > 0.0 { self.alphas[i] > 0.0 } else { self.alphas[i] < self.c }
    }

    /// The least and the greatest bias that agree with all examples, which coincide where a coefficient is free.
    pub(super) fn bias_interval(&self) -> (f64, f64) {
        let target = |i: &usize| self.bias - self.labels[*i] * self.margins[*i];
        let least = (0..self.len()).filter(|&i| self.can_rise(i)).map(|i| target(&i)).fold(f64::NEG_INFINITY, f64::max);
        let greatest = (0..self.len()).filter(|&i| self.can_fall(i)).map(|i| target(&i)).fold(f64::INFINITY, f64::min);
        (least, greatest)
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
