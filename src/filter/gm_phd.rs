//! The Gaussian-mixture probability hypothesis density (GM-PHD) filter.
//!
//! Source: LCMHT, section 4.3, eqs 17 to 24; Vo and Ma, *The Gaussian mixture probability hypothesis density filter*,
//! 2006.
//!
//! The filter holds an intensity over states, a mixture of weighted Gaussians: its integral over a region is the number
//! of targets expected there. A frame is a prediction and an update:
//!
//! ```text
//! predict   D_S(x)   = p_S sum_v w_v N(x; F m_v, F P_v F^T + Q)                                (eqs 20, 21)
//! births    D_k|k-1  = D_S(x) + sum_z w_b N(x; [z at rest], P_b)                               (eqs 19, 21, 22)
//! update    D_k(x)   = (1 - p_D) D_k|k-1(x) + sum_z sum_v w_v(z) N(x; m_v(z), P_v)             (eq 23)
//!           w_v(z)   = p_D w_v q_v(z) / (lambda c(z) + p_D sum_l w_l q_l(z)),  q_v(z) = N(z; H m_v, H P_v H^T + R)
//! reduce    prune, merge, cap
//! ```
//!
//! **Births** are driven by the measurements: each measurement of an update puts one component, at its place and at
//! rest, into the predicted intensity, and nowhere else. So a birth passes through the update like every other
//! component, with the clutter against it, and one measurement can never account for more than one target: its `w_v(z)`
//! sum to at most 1. They enter in [`GmPhd::update`], since the measurements are known only there.
//!
//! **Clutter** is Poisson with `lambda` false measurements an update, spread evenly (eq 24): `c(z) = 1 / A`. As `q` is
//! a density over whole measurements, `A` is the volume of the region of *measurement space* that they come from. For
//! `[x, y, w, h]` that is the searched area times the range of widths times the range of heights.
//!
//! Time is in frame periods. All else takes its units from the motion model.

use super::kalman::{Correction, Gaussian};
use super::mixture::{Component, Reducer, ReductionSettings, heaviest_first};
use super::motion::MotionModel;
use super::{Matrix, Vector};

#[cfg(test)]
mod tests;

/// The settings of a [`GmPhd`] filter over states of `N` numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GmPhdSettings<const N: usize> {
    /// `p_S`: probability that a target is still there one frame later, in `[0, 1]`. Over `dt` frames it is `p_S^dt`.
    pub survival: f64,
    /// `p_D`: probability that a target is measured in an update, in `[0, 1]`.
    pub detection: f64,
    /// `lambda`: mean number of false measurements in an update. Not negative.
    pub clutter_rate: f64,
    /// `A`: volume of the region of measurement space that measurements come from, in the product of the units of a
    /// measurement (px^2 for positions, px^4 for `[x, y, w, h]`). Positive.
    pub clutter_volume: f64,
    /// `w_b`: expected number of new targets at a measurement. Not negative; 0 for no births.
    pub birth_weight: f64,
    /// `P_b`: covariance of a new target's state around its measurement at rest. Positive definite.
    pub birth_covariance: Matrix<N, N>,
    /// How the mixture is kept small.
    pub reduction: ReductionSettings,
}

impl<const N: usize> GmPhdSettings<N> {
    /// Clutter rate, pruning and merging are those of LCMHT (sections 4.3 and 5), which is silent on the others;
    /// probabilities and cap are those of Vo and Ma's first example.
    ///
    /// The birth weight is smaller than in that example, 0.01 and not 0.1, as a birth is at rest and lies on the target
    /// whenever that is measured: merged into it, it slows it down, a target of 3 px/frame for example by 3.5 % with
    /// 0.1, by 0.4 % with 0.01.
    pub fn new(clutter_volume: f64, birth_covariance: Matrix<N, N>) -> Self {
        Self {
            survival: 0.99,
            detection: 0.98,
            clutter_rate: 4.0,
            clutter_volume,
            birth_weight: 0.01,
            birth_covariance,
            reduction: ReductionSettings::default(),
        }
    }
}

/// A GM-PHD filter over states of `N` numbers that are measured as `M` numbers. Once its buffers have grown to the
/// number of components at work, its steps allocate nothing.
#[derive(Clone, Debug)]
pub struct GmPhd<const N: usize, const M: usize> {
    model: MotionModel<N, M>,
    settings: GmPhdSettings<N>,
    /// The mixture, heaviest first.
    components: Vec<Component<N>>,
    /// Of each component: `ln(p_D w)` and its update.
    corrections: Vec<(f64, Correction<N, M>)>,
    /// Of each correction: the logarithm of its share in the measurement at hand, not normalised.
    log_shares: Vec<f64>,
    reducer: Reducer<N>,
}

impl<const N: usize, const M: usize> GmPhd<N, M> {
    /// A filter that knows of no target.
    pub fn new(model: MotionModel<N, M>, settings: GmPhdSettings<N>) -> Self {
        Self {
            model,
            settings,
            components: Vec::new(),
            corrections: Vec::new(),
            log_shares: Vec::new(),
            reducer: Reducer::default(),
        }
    }

    /// Forgets all targets and takes up those of `known` instead.
    pub fn reset(&mut self, known: &[Component<N>]) {
        self.components.clear();
        self.components.extend_from_slice(known);
        heaviest_first(&mut self.components);
    }

    /// Changes model and settings; what is known of the targets stays.
    pub fn retune(&mut self, model: MotionModel<N, M>, settings: GmPhdSettings<N>) {
        self.model = model;
        self.settings = settings;
    }

    /// The motion model.
    pub fn model(&self) -> &MotionModel<N, M> {
        &self.model
    }

    /// The settings.
    pub fn settings(&self) -> &GmPhdSettings<N> {
        &self.settings
    }

    /// The mixture, heaviest component first.
    pub fn components(&self) -> &[Component<N>] {
        &self.components
    }

    /// The heaviest component, which stands for the target; `None` if the filter knows of none.
    pub fn heaviest(&self) -> Option<&Component<N>> {
        self.components.first()
    }

    /// The expected number of targets: the sum of the weights.
    pub fn expected_targets(&self) -> f64 {
        self.components.iter().map(|c| c.weight).sum()
    }

    /// Moves the targets on by `dt` frames, `dt >= 0` (eq 21 without births).
    pub fn predict(&mut self, dt: f64) {
        let (f, q) = (self.model.transition(dt), self.model.process_noise(dt));
        let survival = self.settings.survival.powf(dt);
        for component in &mut self.components {
            component.weight *= survival;
            component.state.predict(&f, &q);
        }
    }

    /// Takes in the measurements of a frame, all finite (eqs 19, 22, 23), and reduces the mixture. An empty slice tells
    /// that nothing was detected, which makes every target less likely; where nobody looked, leave the update out.
    pub fn update(&mut self, measurements: &[Vector<M>]) {
        self.add_births(measurements);
        self.correct(measurements);
        self.reducer.reduce(&mut self.components, &self.settings.reduction);
    }

    /// Eq 19.
    fn add_births(&mut self, measurements: &[Vector<M>]) {
        let GmPhdSettings { birth_weight: weight, birth_covariance: covariance, .. } = self.settings;
        if weight > 0.0 {
            let at_rest = |z| Gaussian { mean: self.model.at_rest(z), covariance };
            self.components.extend(measurements.iter().map(|z| Component { weight, state: at_rest(z) }));
        }
    }

    /// Eqs 23 and 24. A measurement far from a component has a likelihood below the range of `f64`, so that the weights
    /// are normalised as logarithms.
    fn correct(&mut self, measurements: &[Vector<M>]) {
        let (h, r) = (self.model.measurement(), self.model.measurement_noise());
        let GmPhdSettings { detection, clutter_rate, clutter_volume, .. } = self.settings;
        let log_clutter = (clutter_rate / clutter_volume).ln();

        self.corrections.clear();
        for component in &mut self.components {
            // A component that is numerically no Gaussian any more is not updated, and fades as a missed one does.
            if let Some(correction) = Correction::new(&component.state, &h, &r) {
                self.corrections.push(((detection * component.weight).ln(), correction));
            }
            component.weight *= 1.0 - detection;
        }
        for z in measurements {
            self.log_shares.clear();
            self.log_shares.extend(self.corrections.iter().map(|(log_weight, c)| log_weight + c.log_likelihood(z)));
            let log_total = log_sum_exp(log_clutter, &self.log_shares);
            if log_total > f64::NEG_INFINITY {
                for ((_, correction), log_share) in self.corrections.iter().zip(&self.log_shares) {
                    let weight = (log_share - log_total).exp();
                    self.components.push(Component { weight, state: correction.posterior(z) });
                }
            }
        }
    }
}

/// `ln(exp(first) + sum exp(rest))`, without leaving the range of `f64` on the way.
fn log_sum_exp(first: f64, rest: &[f64]) -> f64 {
    let largest = rest.iter().copied().fold(first, f64::max);
    if largest == f64::NEG_INFINITY {
        return largest;
    }
    let sum: f64 = rest.iter().map(|value| (value - largest).exp()).sum();
    largest + ((first - largest).exp() + sum).ln()
}
