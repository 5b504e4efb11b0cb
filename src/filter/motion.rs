//! Constant-velocity motion models of a box (Baisa, *Derivation of a constant velocity motion model for visual
//! tracking*, equations 5 to 20).
//!
//! A model is linear and Gaussian: `x_k = F x_{k-1} + w`, `w ~ N(0, Q)`, and `z_k = H x_k + v`, `v ~ N(0, R)`. Each
//! measured quantity moves on its own, in one of two ways over a time step `dt`:
//!
//! * with a velocity, disturbed by an acceleration that is constant over the step and white from step to step (eqs 8
//!   and 11): `p += dt v + dt^2/2 w`, `v += dt w`;
//! * without one, as a random walk (eq 10): `p += w`, with the same variance in each step, whatever its length.
//!
//! Four forms of a box are offered. They differ in how the size is written and in what has a velocity:
//!
//! | constructor | state | measurement | follows |
//! |---|---|---|---|
//! | [`MotionModel::centre_size`] | `[x, y, vx, vy, w, h]` | `[x, y, w, h]` | the paper, eqs 10 to 20 |
//! | [`MotionModel::centre_moving_size`] | `[x, y, vx, vy, w, h, vw, vh]` | `[x, y, w, h]` | the paper, eq 11 twice |
//! | [`MotionModel::centre_area_aspect`] | `[x, y, s, r, vx, vy, vs]` | `[x, y, s, r]` | SORT (Bewley et al) |
//! | [`MotionModel::centre_aspect_height`] | `[x, y, a, h, vx, vy, va, vh]` | `[x, y, a, h]` | DeepSORT (Wojke et al) |
//!
//! `(x, y)` is the centre, `w` and `h` the sides, `s = w h` the area, `r = a = w / h` the aspect ratio, which SORT
//! holds without a velocity. From SORT and DeepSORT come the states; the noises are derived as the paper derives its
//! own.
//!
//! Units: pixels and frame periods, so a velocity is in px/frame, the variance of an acceleration in px^2/frame^4.

use super::{Matrix, Vector};
use crate::geometry::Rect;

#[cfg(test)]
mod tests;

/// How a box is written as a measurement of four numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoxForm {
    /// `[x, y, w, h]`: centre, width, height.
    CentreSize,
    /// `[x, y, s, r]`: centre, area, width / height.
    CentreAreaAspect,
    /// `[x, y, a, h]`: centre, width / height, height.
    CentreAspectHeight,
}

impl BoxForm {
    /// The measurement that `rect`, a box of positive size, is.
    pub fn measurement(self, rect: &Rect) -> Vector<4> {
        let [x, y] = rect.centre();
        match self {
            Self::CentreSize => Vector::from([x, y, rect.w, rect.h]),
            Self::CentreAreaAspect => Vector::from([x, y, rect.w * rect.h, rect.w / rect.h]),
            Self::CentreAspectHeight => Vector::from([x, y, rect.w / rect.h, rect.h]),
        }
    }

    /// The box that `measurement` is. A filter may extrapolate a size below zero: such a side, or both where the area
    /// is negative, is zero.
    pub fn rect(self, measurement: &Vector<4>) -> Rect {
        let [x, y, p, q] = (*measurement).into();
        let (p, q) = (p.max(0.0), q.max(0.0));
        let size = match self {
            Self::CentreSize => [p, q],
            Self::CentreAreaAspect if q == 0.0 => [0.0, 0.0],
            Self::CentreAreaAspect => [(p * q).sqrt(), (p / q).sqrt()],
            Self::CentreAspectHeight => [p * q, q],
        };
        Rect::around([x, y], size)
    }
}

/// The variances of a model, in the order of its measurement. All positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise<const M: usize> {
    /// Process noise: of the acceleration in unit^2/frame^4 for a quantity with a velocity, of a step in unit^2 for one
    /// without.
    pub process: [f64; M],
    /// Measurement noise, in unit^2.
    pub measurement: [f64; M],
}

/// Where a measured quantity stands in the state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Index of the quantity.
    pub value: usize,
    /// Index of its velocity, if it has one.
    pub velocity: Option<usize>,
}

/// A linear Gaussian motion model of `M` quantities in a state of `N` numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionModel<const N: usize, const M: usize> {
    places: [Place; M],
    noise: Noise<M>,
}

/// Quantities at the indices `values`, their velocities at `velocities`.
const fn places<const M: usize>(values: [usize; M], velocities: [Option<usize>; M]) -> [Place; M] {
    let mut places = [Place { value: 0, velocity: None }; M];
    let mut i = 0;
    while i < M {
        places[i] = Place { value: values[i], velocity: velocities[i] };
        i += 1;
    }
    places
}

impl MotionModel<6, 4> {
    /// State `[x, y, vx, vy, w, h]`, measurement [`BoxForm::CentreSize`]: eqs 10 to 20.
    pub fn centre_size(noise: Noise<4>) -> Self {
        Self::new(places([0, 1, 4, 5], [Some(2), Some(3), None, None]), noise)
    }
}

impl MotionModel<8, 4> {
    /// State `[x, y, vx, vy, w, h, vw, vh]`, measurement [`BoxForm::CentreSize`]: eq 11 for both sides.
    pub fn centre_moving_size(noise: Noise<4>) -> Self {
        Self::new(places([0, 1, 4, 5], [Some(2), Some(3), Some(6), Some(7)]), noise)
    }

    /// State `[x, y, a, h, vx, vy, va, vh]`, measurement [`BoxForm::CentreAspectHeight`], as in DeepSORT.
    pub fn centre_aspect_height(noise: Noise<4>) -> Self {
        Self::new(places([0, 1, 2, 3], [Some(4), Some(5), Some(6), Some(7)]), noise)
    }
}

impl MotionModel<7, 4> {
    /// State `[x, y, s, r, vx, vy, vs]`, measurement [`BoxForm::CentreAreaAspect`], as in SORT.
    pub fn centre_area_aspect(noise: Noise<4>) -> Self {
        Self::new(places([0, 1, 2, 3], [Some(4), Some(5), Some(6), None]), noise)
    }
}

impl<const N: usize, const M: usize> MotionModel<N, M> {
    /// The model whose measured quantities stand at `places`.
    ///
    /// # Panics
    /// Unless each of the `N` indices of the state is the place of exactly one quantity or velocity.
    pub fn new(places: [Place; M], noise: Noise<M>) -> Self {
        let mut held = [0; N];
        for index in places.iter().flat_map(|p| std::iter::once(p.value).chain(p.velocity)) {
            held[index] += 1;
        }
        assert!(held.iter().all(|&n| n == 1), "{places:?} do not fill a state of {N} numbers");
        Self { places, noise }
    }

    /// `F`, the state transition over `dt` frames (eq 12).
    pub fn transition(&self, dt: f64) -> Matrix<N, N> {
        let mut f = Matrix::identity();
        for place in &self.places {
            if let Some(velocity) = place.velocity {
                f[(place.value, velocity)] = dt;
            }
        }
        f
    }

    /// `Q`, the covariance of the process noise over `dt` frames (eq 15).
    pub fn process_noise(&self, dt: f64) -> Matrix<N, N> {
        let mut q = Matrix::zeros();
        for (&Place { value, velocity }, variance) in self.places.iter().zip(self.noise.process) {
            if let Some(velocity) = velocity {
                q[(value, value)] = dt.powi(4) / 4.0 * variance;
                q[(value, velocity)] = dt.powi(3) / 2.0 * variance;
                q[(velocity, value)] = dt.powi(3) / 2.0 * variance;
                q[(velocity, velocity)] = dt.powi(2) * variance;
            } else {
                q[(value, value)] = variance;
            }
        }
        q
    }

    /// `H`, which picks the measured quantities from the state (eq 17).
    pub fn measurement(&self) -> Matrix<M, N> {
        let mut h = Matrix::zeros();
        for (row, place) in self.places.iter().enumerate() {
            h[(row, place.value)] = 1.0;
        }
        h
    }

    /// `R`, the covariance of the measurement noise (eq 20).
    pub fn measurement_noise(&self) -> Matrix<M, M> {
        Matrix::from_diagonal(&Vector::from(self.noise.measurement))
    }

    /// The state at rest that would be measured as `values`.
    pub fn at_rest(&self, values: &Vector<M>) -> Vector<N> {
        self.state(values, &Vector::zeros())
    }

    /// The measured quantities of a state, `H x`.
    pub fn values(&self, state: &Vector<N>) -> Vector<M> {
        Vector::from_fn(|i, _| state[self.places[i].value])
    }

    /// The velocities of the measured quantities of a state, per frame; 0 for those without. The first two are those of
    /// the centre in every form of a box.
    pub fn velocities(&self, state: &Vector<N>) -> Vector<M> {
        Vector::from_fn(|i, _| self.places[i].velocity.map_or(0.0, |v| state[v]))
    }

    /// The diagonal covariance of a state with the variances `values` of the measured quantities and `velocities` of
    /// their velocities; those of quantities without a velocity are passed over.
    pub fn diagonal(&self, values: &Vector<M>, velocities: &Vector<M>) -> Matrix<N, N> {
        Matrix::from_diagonal(&self.state(values, velocities))
    }

    fn state(&self, values: &Vector<M>, velocities: &Vector<M>) -> Vector<N> {
        let mut state = Vector::zeros();
        for (i, place) in self.places.iter().enumerate() {
            state[place.value] = values[i];
            if let Some(velocity) = place.velocity {
                state[velocity] = velocities[i];
            }
        }
        state
    }
}
