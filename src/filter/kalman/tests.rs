//! The steps against numbers worked out by hand, against the information form and Bayes' rule, and over a long run.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::filter::motion::{MotionModel, Noise};

#[test]
fn scalar_update_by_hand() {
    // S = 4 + 1 = 5, K = 4/5, m = 10 + 4/5 * 2, P = (1 - 4/5) * 4.
    let prior = Gaussian { mean: Vector::from([10.0]), covariance: Matrix::from([[4.0]]) };
    let correction = Correction::new(&prior, &Matrix::from([[1.0]]), &Matrix::from([[1.0]])).unwrap();
    let z = Vector::from([12.0]);
    let posterior = correction.posterior(&z);
    assert_eq!(correction.innovation(&z)[0], 2.0);
    assert!((correction.innovation_factor().l()[(0, 0)] - 5.0_f64.sqrt()).abs() < 1e-15);
    assert!((posterior.mean[0] - 11.6).abs() < 1e-14);
    assert!((posterior.covariance[(0, 0)] - 0.8).abs() < 1e-14);
    // -(ln 2 pi + ln 5 + 2^2 / 5) / 2
    assert!((correction.log_likelihood(&z) + 2.1236574894217).abs() < 1e-12);
}

#[test]
fn position_and_velocity_by_hand() {
    let mut state = Gaussian { mean: Vector::from([0.0, 1.0]), covariance: Matrix::identity() };
    let f = Matrix::<2, 2>::new(1.0, 1.0, 0.0, 1.0);
    let q = Matrix::<2, 2>::new(0.25, 0.5, 0.5, 1.0);
    state.predict(&f, &q);
    assert_eq!(state.mean, Vector::from([1.0, 1.0]));
    assert_eq!(state.covariance, Matrix::<2, 2>::new(2.25, 1.5, 1.5, 2.0));
    // S = 2.25 + 0.75 = 3, K = [2.25, 1.5] / 3, innovation 3.
    let correction = Correction::new(&state, &Matrix::<1, 2>::new(1.0, 0.0), &Matrix::from([[0.75]])).unwrap();
    let posterior = correction.posterior(&Vector::from([4.0]));
    assert!((posterior.mean - Vector::from([3.25, 2.5])).amax() < 1e-14);
    assert!((posterior.covariance - Matrix::<2, 2>::new(0.5625, 0.375, 0.375, 1.25)).amax() < 1e-14);
}

/// A symmetric positive definite matrix with eigenvalues of at least 1.
fn covariance<const N: usize>(rng: &mut ChaCha8Rng) -> Matrix<N, N> {
    let a = Matrix::<N, N>::from_fn(|_, _| rng.random_range(-1.0..1.0));
    a * a.transpose() + Matrix::identity()
}

/// The logarithm of `N(x; m, P)` from an inverse and a determinant.
fn log_density<const N: usize>(x: &Vector<N>, m: &Vector<N>, p: &Matrix<N, N>) -> f64 {
    let (p, d) = (
        nalgebra::DMatrix::from_column_slice(N, N, p.as_slice()),
        nalgebra::DVector::from_column_slice((x - m).as_slice()),
    );
    -0.5 * ((p.clone() * std::f64::consts::TAU).determinant().ln() + d.dot(&(p.try_inverse().unwrap() * &d)))
}

/// Random priors, measurement matrices and noises: the posterior must be `P^-1 <- P^-1 + H^T R^-1 H`,
/// `P^-1 m <- P^-1 m + H^T R^-1 z`, and the likelihood `p(z) = p(z | x) p(x) / p(x | z)` at any `x`.
#[test]
fn update_agrees_with_the_information_form_and_with_bayes_rule() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    for _ in 0..100 {
        let prior = Gaussian {
            mean: Vector::<6>::from_fn(|_, _| rng.random_range(-9.0..9.0)),
            covariance: covariance(&mut rng),
        };
        let h = Matrix::<4, 6>::from_fn(|_, _| rng.random_range(-1.0..1.0));
        let r = covariance::<4>(&mut rng);
        let z = Vector::<4>::from_fn(|_, _| rng.random_range(-9.0..9.0));
        let correction = Correction::new(&prior, &h, &r).unwrap();
        let posterior = correction.posterior(&z);

        let (prior_information, weight) =
            (prior.covariance.try_inverse().unwrap(), h.transpose() * r.try_inverse().unwrap());
        let p = (prior_information + weight * h).try_inverse().unwrap();
        let m = p * (prior_information * prior.mean + weight * z);
        assert!((posterior.covariance - p).amax() < 1e-12);
        assert!((posterior.mean - m).amax() < 1e-12);

        let x = Vector::<6>::from_fn(|_, _| rng.random_range(-2.0..2.0));
        let bayes =
            log_density(&z, &(h * x), &r) + log_density(&x, &prior.mean, &prior.covariance) - log_density(&x, &m, &p);
        assert!((correction.log_likelihood(&z) - bayes).abs() < 1e-10);
    }
}

#[test]
fn a_far_measurement_has_a_finite_log_likelihood() {
    let prior = Gaussian { mean: Vector::<1>::zeros(), covariance: Matrix::from([[3.0]]) };
    let correction = Correction::new(&prior, &Matrix::from([[1.0]]), &Matrix::from([[1.0]])).unwrap();
    // S = 4, so 2e4 lies 1e4 standard deviations away: -1e8 / 2 - ln 2 - ln(2 pi) / 2.
    let far = correction.log_likelihood(&Vector::from([2e4]));
    assert!((far + 5e7 + 2.0_f64.ln() + 0.5 * std::f64::consts::TAU.ln()).abs() < 1e-6);
}

#[test]
fn a_prior_that_is_no_covariance_gives_none() {
    let prior = Gaussian { mean: Vector::<1>::zeros(), covariance: Matrix::from([[-3.0]]) };
    assert!(Correction::new(&prior, &Matrix::from([[1.0]]), &Matrix::from([[1.0]])).is_none());
}

/// Exact measurements of a hardly known state, long gaps and tiny steps, 10,000 times.
#[test]
fn covariance_stays_positive_definite_through_ill_conditioned_steps() {
    let noise = Noise { process: [1e-6, 1e-2, 1e-8, 1e-3], measurement: [1e-8, 1e-6, 1e-4, 1e-8] };
    let model = MotionModel::centre_size(noise);
    let (h, r) = (model.measurement(), model.measurement_noise());
    let loose = model.diagonal(&Vector::repeat(1e8), &Vector::repeat(1e8));
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut state = Gaussian { mean: Vector::zeros(), covariance: loose };
    let mut short = loose;
    let (mut short_form_failures, mut widest) = (0, 0.0_f64);
    for step in 0..10_000 {
        let dt = [1e-2, 1.0, 50.0, 1e3][rng.random_range(0..4)];
        let (f, q) = (model.transition(dt), model.process_noise(dt));
        state.predict(&f, &q);
        short = f * short * f.transpose() + q;
        if step % 5 != 0 {
            let s = h * short * h.transpose() + r;
            let gain = s.try_inverse().map(|s| short * h.transpose() * s);
            short = gain.map_or(short, |k| short - k * h * short);
            let z = Vector::from_fn(|_, _| rng.random_range(-1e3..1e3));
            state = Correction::new(&state, &h, &r).expect("S is positive definite").posterior(&z);
        }
        assert!(state.mean.iter().all(|v| v.is_finite()), "step {step}");
        assert_eq!(state.covariance, state.covariance.transpose(), "step {step}");
        assert!(Factor::new(state.covariance).is_some(), "step {step}: {}", state.covariance);
        let diagonal = state.covariance.diagonal();
        widest = widest.max(diagonal.max() / diagonal.min());
        if Factor::new(short).is_none() {
            short_form_failures += 1;
            short = loose;
        }
    }
    // What makes the run a test: variances far apart, on which (I - K H) P does fail.
    assert!(widest > 1e12, "{widest:e}");
    assert!(short_form_failures > 0);
}
