//! Adiabatic increments: one coefficient moves, and bias and margin vectors move with it so that the conditions of all
//! other examples stay fulfilled. Each time an example reaches the edge of its set, it changes over.
//!
//! Source: Diehl and Cauwenberghs 2003, sections 2 and 3, with a single unlearned example.

use super::gram::RIDGE;
use super::state::{Set, SolverState};

/// Slower changes are rounding.
const STILL: f64 = 1e-11;
/// A new margin vector must change its own margin by this much a unit of its coefficient; the ridge alone gives
/// `RIDGE`.
const MIN_SCHUR: f64 = RIDGE / 4.0;

/// What ends a straight piece of the path.
#[derive(Clone, Copy)]
enum Event {
    /// The moving example reaches its set.
    Arrives(Set),
    /// The margin vector reaches an end of `[0, C]`.
    Leaves(usize, Set),
    /// The example reaches the margin.
    Enters(usize),
}

/// The first of the events offered, and how far it is.
struct First(f64, Option<Event>);

impl First {
    fn none() -> Self {
        Self(f64::INFINITY, None)
    }

    fn offer(&mut self, distance: f64, event: Event) {
        // An example that rounding has put beyond its edge changes over at once.
        let distance = distance.max(0.0);
        if distance < self.0 {
            *self = Self(distance, Some(event));
        }
    }
}

impl SolverState {
    /// Raises the coefficient of `moving` from 0 until its conditions hold; false where the path ends before.
    pub(super) fn grow(&mut self, moving: usize) -> bool {
        self.travel(moving, 1.0)
    }

    /// Lowers the coefficient of `moving`, which is no margin vector, to 0; false where the path ends before.
    pub(super) fn shrink(&mut self, moving: usize) -> bool {
        self.travel(moving, -1.0)
    }

    fn travel(&mut self, moving: usize, sign: f64) -> bool {
        let max_events = 100 + 20 * self.len();
        for _ in 0..max_events {
            let event = if self.border.members().is_empty() {
                self.slide_bias(moving, sign)
            } else {
                self.slide_margin_vectors(moving, sign)
            };
            match event {
                None => return false,
                Some(Event::Arrives(Set::Margin)) => return self.enter(moving),
                Some(Event::Arrives(set)) => {
                    self.alphas[moving] = if set == Set::Error { self.c } else { 0.0 };
                    self.sets[moving] = set;
                    return true;
                }
                Some(Event::Leaves(i, set)) => {
                    self.alphas[i] = if set == Set::Error { self.c } else { 0.0 };
                    self.sets[i] = set;
                    self.border.remove(i);
                }
                Some(Event::Enters(i)) => {
                    if !self.enter(i) {
                        return false;
                    }
                }
            }
        }
        false
    }

    /// Without margin vectors only the bias can move, up to the first example that reaches the margin.
    fn slide_bias(&mut self, moving: usize, sign: f64) -> Option<Event> {
        let direction = sign * self.labels[moving];
        let mut first = First::none();
        if sign > 0.0 {
            first.offer(-self.margins[moving], Event::Arrives(Set::Margin));
        }
        for i in (0..self.len()).filter(|&i| i != moving) {
            match (self.sets[i], self.labels[i] == direction) {
                (Set::Error, true) => first.offer(-self.margins[i], Event::Enters(i)),
                (Set::Reserve, false) => first.offer(self.margins[i], Event::Enters(i)),
                _ => {}
            }
        }
        let First(step, Some(event)) = first else { return None };
        self.bias += direction * step;
        for (m, y) in self.margins.iter_mut().zip(&self.labels) {
            *m += y * direction * step;
        }
        Some(event)
    }

    /// Moves the coefficient of `moving`, and bias and margin vectors with it, up to the first event.
    fn slide_margin_vectors(&mut self, moving: usize, sign: f64) -> Option<Event> {
        self.sensitivities(moving);
        self.margin_rates(moving);
        let mut first = First::none();
        if sign > 0.0 {
            if self.rates[moving] > 0.0 {
                first.offer(-self.margins[moving] / self.rates[moving], Event::Arrives(Set::Margin));
            }
            first.offer(self.c - self.alphas[moving], Event::Arrives(Set::Error));
        } else {
            first.offer(self.alphas[moving], Event::Arrives(Set::Reserve));
        }
        for (&i, beta) in self.border.members().iter().zip(&self.beta[1..]) {
            let rate = sign * beta;
            if rate > STILL {
                first.offer((self.c - self.alphas[i]) / rate, Event::Leaves(i, Set::Error));
            } else if rate < -STILL {
                first.offer(-self.alphas[i] / rate, Event::Leaves(i, Set::Reserve));
            }
        }
        for i in (0..self.len()).filter(|&i| i != moving) {
            let rate = sign * self.rates[i];
            match self.sets[i] {
                Set::Error if rate > STILL => first.offer(-self.margins[i] / rate, Event::Enters(i)),
                Set::Reserve if rate < -STILL => first.offer(-self.margins[i] / rate, Event::Enters(i)),
                _ => {}
            }
        }
        let First(step, Some(event)) = first else { return None };
        self.alphas[moving] += sign * step;
        self.bias += sign * step * self.beta[0];
        for (&i, beta) in self.border.members().iter().zip(&self.beta[1..]) {
            self.alphas[i] += sign * step * beta;
        }
        for (m, rate) in self.margins.iter_mut().zip(&self.rates) {
            *m += sign * step * rate;
        }
        Some(event)
    }

    /// Makes example `i`, whose margin is 0, a margin vector; false where it depends on the others too closely.
    fn enter(&mut self, i: usize) -> bool {
        let q_ii = self.q(i, i);
        if self.border.members().is_empty() {
            self.border.insert(i, q_ii, self.labels[i], &[], 1.0);
        } else {
            self.sensitivities(i);
            let along: f64 = self.rhs.iter().zip(&self.beta).map(|(r, b)| r * b).sum();
            let schur = q_ii + along;
            if schur < MIN_SCHUR {
                return false;
            }
            self.border.insert(i, q_ii, self.labels[i], &self.beta, schur);
        }
        self.sets[i] = Set::Margin;
        true
    }

    /// `beta`: change of bias and margin vectors' coefficients a unit of the coefficient of example `i`.
    fn sensitivities(&mut self, i: usize) {
        self.rhs.clear();
        self.rhs.push(self.labels[i]);
        let (row, label, labels) = (self.gram.row(i), self.labels[i], &self.labels);
        self.rhs.extend(self.border.members().iter().map(|&j| label * labels[j] * row[j]));
        self.border.solve_negated(&self.rhs, &mut self.beta);
    }

    /// `rates`: change of all margins a unit of the coefficient of example `i`, from `beta`.
    fn margin_rates(&mut self, i: usize) {
        self.rates.clear();
        self.rates.extend(self.gram.row(i).iter().map(|k| self.labels[i] * k));
        for (&j, beta) in self.border.members().iter().zip(&self.beta[1..]) {
            let factor = self.labels[j] * beta;
            for (rate, k) in self.rates.iter_mut().zip(self.gram.row(j)) {
                *rate += factor * k;
            }
        }
        for (rate, y) in self.rates.iter_mut().zip(&self.labels) {
            *rate = y * (*rate + self.beta[0]);
        }
    }
}
