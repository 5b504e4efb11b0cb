//! The Kalman filter's two steps on one Gaussian, for any linear Gaussian model.
//!
//! With the paper's letters (LCMHT, eqs 17, 18, 21 and 23): mean `m`, covariance `P`, transition `F`, process noise
//! `Q`, measurement matrix `H`, measurement noise `R`, gain `K`, measurement `z`, and `S = H P H^T + R`, the covariance
//! of the innovation `z - H m`.

use nalgebra::{Cholesky, Const};

use super::{Matrix, Vector};

#[cfg(test)]
mod tests;

/// The Cholesky factor of a covariance of `N` numbers.
pub type Factor<const N: usize> = Cholesky<f64, Const<N>>;

/// A Gaussian over states of `N` numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian<const N: usize> {
    /// The mean `m`.
    pub mean: Vector<N>,
    /// The covariance `P`: symmetric, positive definite.
    pub covariance: Matrix<N, N>,
}

impl<const N: usize> Gaussian<N> {
    /// The Gaussian one time step later: `m <- F m`, `P <- F P F^T + Q`.
    pub fn predict(&mut self, transition: &Matrix<N, N>, process_noise: &Matrix<N, N>) {
        self.mean = transition * self.mean;
        self.covariance = symmetric(transition * self.covariance * transition.transpose() + process_noise);
    }
}

/// All of a Gaussian's update that no measurement is needed for, so that it is computed once for all of them.
#[derive(Clone, Debug)]
pub struct Correction<const N: usize, const M: usize> {
    prior: Vector<N>,
    expected: Vector<M>,
    factor: Factor<M>,
    log_peak: f64,
    gain: Matrix<N, M>,
    covariance: Matrix<N, N>,
}

impl<const N: usize, const M: usize> Correction<N, M> {
    /// The update of `prior` by measurements `H x + v`, `v ~ N(0, R)`.
    ///
    /// The covariance comes from the Joseph form, `(I - K H) P (I - K H)^T + K R K^T`, which stays positive definite
    /// where `(I - K H) P` is lost to rounding.
    ///
    /// `None` if `S` is not positive definite in `f64`: `R` or the prior's covariance is not.
    pub fn new(prior: &Gaussian<N>, h: &Matrix<M, N>, r: &Matrix<M, M>) -> Option<Self> {
        let cross = h * prior.covariance;
        let factor = Factor::new(symmetric(cross * h.transpose() + r))?;
        let gain = factor.solve(&cross).transpose();
        let kept = Matrix::<N, N>::identity() - gain * h;
        Some(Self {
            prior: prior.mean,
            expected: h * prior.mean,
            log_peak: -0.5 * (M as f64 * std::f64::consts::TAU.ln() + factor.ln_determinant()),
            factor,
            gain,
            covariance: symmetric(kept * prior.covariance * kept.transpose() + gain * r * gain.transpose()),
        })
    }

    /// What `measurement` tells beyond the prior: `z - H m`.
    pub fn innovation(&self, measurement: &Vector<M>) -> Vector<M> {
        measurement - self.expected
    }

    /// The Cholesky factor of `S`, the covariance of the innovation.
    pub fn innovation_factor(&self) -> &Factor<M> {
        &self.factor
    }

    /// The natural logarithm of `N(z; H m, S)`, the density of `measurement` under the prior.
    pub fn log_likelihood(&self, measurement: &Vector<M>) -> f64 {
        self.log_peak - 0.5 * squared_mahalanobis(&self.factor, &self.innovation(measurement))
    }

    /// The Gaussian after `measurement`: mean `m + K (z - H m)`.
    pub fn posterior(&self, measurement: &Vector<M>) -> Gaussian<N> {
        let mean = self.prior + self.gain * self.innovation(measurement);
        Gaussian { mean, covariance: self.covariance }
    }
}

/// The squared Mahalanobis length of `difference` under the covariance whose Cholesky factor is `factor`.
pub fn squared_mahalanobis<const N: usize>(factor: &Factor<N>, difference: &Vector<N>) -> f64 {
    difference.dot(&factor.solve(difference))
}

/// `matrix` without the asymmetry that rounding left.
fn symmetric<const N: usize>(matrix: Matrix<N, N>) -> Matrix<N, N> {
    (matrix + matrix.transpose()) * 0.5
}
