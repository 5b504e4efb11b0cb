//! Bounds of a state, and Gaussian noise that stays within them: a step that would lead out is reflected at the border.
//!
//! The density of a reflected step at `y` is that of the Gaussian at `y` and at all its mirror images, `y + 2k(b - a)`
//! and `2a - y + 2k(b - a)` for every integer `k`: what would be drawn there ends up at `y`.

use std::f64::consts::TAU;

use super::Vector;

/// Standard deviations beyond which a Gaussian has no weight that counts: less than 1e-15 of its greatest density.
const REACH: f64 = 8.5;
/// Below this width, in standard deviations, a reflected Gaussian is as good as uniform: its density differs by less
/// than `2 exp(-2 pi^2)` of that (Poisson's summation formula), 6e-9.
const NARROW: f64 = 0.5;

/// What a state may be: a box, which holds its borders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds<const N: usize> {
    /// The least of each quantity.
    pub low: Vector<N>,
    /// The greatest; nowhere below the least.
    pub high: Vector<N>,
}

impl<const N: usize> Bounds<N> {
    /// The nearest state that may be.
    pub fn nearest(&self, state: &Vector<N>) -> Vector<N> {
        state.zip_zip_map(&self.low, &self.high, f64::clamp)
    }

    /// Where a step to `state` ends that is reflected at the borders as often as it meets one.
    pub fn reflected(&self, state: &Vector<N>) -> Vector<N> {
        state.zip_zip_map(&self.low, &self.high, reflected)
    }

    /// The logarithm of the density at `x` of a step from `mean`, Gaussian of these standard deviations and reflected;
    /// but for a constant that depends on `N` alone. Both states are within the bounds, and none of the deviations is
    /// 0. A quantity that cannot vary has none.
    pub fn log_density(&self, x: &Vector<N>, mean: &Vector<N>, deviations: &Vector<N>) -> f64 {
        let z = (x - mean).component_div(deviations);
        let direct = -0.5 * z.norm_squared() - deviations.iter().map(|d| d.ln()).sum::<f64>();
        let images = |i: usize| log_images(x[i], mean[i], deviations[i], [self.low[i], self.high[i]]);
        direct + (0..N).map(images).sum::<f64>()
    }
}

fn reflected(x: f64, low: f64, high: f64) -> f64 {
    if (low..=high).contains(&x) {
        return x;
    }
    let width = high - low;
    let along = (x - low).rem_euclid(2.0 * width);
    // Where there is no width, there is no remainder either.
    if along.is_nan() { low } else { (low + along.min(2.0 * width - along)).clamp(low, high) }
}

/// The logarithm of how many times the density is that of the Gaussian alone: 0 far from the borders.
fn log_images(x: f64, mean: f64, deviation: f64, [low, high]: [f64; 2]) -> f64 {
    let width = high - low;
    let exponent = |at: f64| -0.5 * ((at - mean) / deviation).powi(2);
    let direct = exponent(x);
    if width <= 0.0 {
        return deviation.ln() - direct;
    }
    if width < NARROW * deviation {
        // The Gaussian above lacks the factor of 1 / sqrt(2 pi).
        return (TAU.sqrt() * deviation / width).ln() - direct;
    }
    let most = (REACH * deviation / (2.0 * width)).ceil() as i32 + 1;
    let images = (-most..=most).flat_map(|k| {
        let turn = 2.0 * f64::from(k) * width;
        [(k != 0).then_some(x + turn), Some(2.0 * low - x + turn)].into_iter().flatten()
    });
    images.map(|at| (exponent(at) - direct).exp()).sum::<f64>().ln_1p()
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOX: Bounds<1> = Bounds { low: Vector::<1>::new(-1.0), high: Vector::<1>::new(2.0) };

    #[test]
    fn a_step_is_reflected_as_often_as_it_meets_a_border() {
        for (x, want) in [(0.5, 0.5), (-1.0, -1.0), (2.0, 2.0), (2.5, 1.5), (-1.5, -0.5), (5.5, -0.5), (-7.5, -0.5)] {
            let got = BOX.reflected(&Vector::from([x]))[0];
            assert!((got - want).abs() < 1e-12, "{x}: {got}");
        }
        let point = Bounds { low: Vector::from([1.0]), high: Vector::from([1.0]) };
        assert_eq!(point.reflected(&Vector::from([3.0]))[0], 1.0);
    }

    #[test]
    fn the_density_of_a_reflected_step_sums_to_one_and_far_from_the_borders_is_the_gaussians() {
        const STEPS: usize = 30_000;
        let constant = (2.0 * std::f64::consts::PI).sqrt();
        for deviation in [0.05, 0.4, 1.0, 5.9, 6.1, 100.0] {
            for mean in [-1.0, -0.7, 0.5, 2.0] {
                let step = 3.0 / STEPS as f64;
                let density = |i: usize| {
                    let x = Vector::from([-1.0 + (i as f64 + 0.5) * step]);
                    BOX.log_density(&x, &Vector::from([mean]), &Vector::from([deviation])).exp() / constant
                };
                let sum: f64 = (0..STEPS).map(|i| density(i) * step).sum();
                assert!((sum - 1.0).abs() < 1e-6, "{deviation} {mean}: {sum}");
            }
        }
        let [x, mean, deviation] = [0.6, 0.5, 0.1];
        let got = BOX.log_density(&Vector::from([x]), &Vector::from([mean]), &Vector::from([deviation]));
        let z: f64 = (x - mean) / deviation;
        assert_eq!(got, -0.5 * (z * z) - deviation.ln());
    }
}
