//! How far a mean can be trusted: confidence intervals by the bootstrap, and the p value of a paired comparison.
//!
//! Sequences differ far more than starts do, and another set of videos is what a figure is meant for. So sequences are
//! drawn first, and for each one drawn its starts: the two-stage bootstrap of Davison and Hinkley (*Bootstrap Methods
//! and their Application*, 1997, section 3.8).

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

/// Draws of a bootstrap, and of the signs of a paired test.
const DRAWS: usize = 4000;
/// Share of the draws that an interval leaves out on either side: 95 % lie within.
const TAIL: f64 = 0.025;
/// Seed of all draws: the same figures give the same intervals.
const SEED: u64 = 0;

/// A mean with its 95 % confidence interval.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Interval {
    /// Over sequences, of the mean over the starts of each.
    pub mean: f64,
    /// The lower end.
    pub low: f64,
    /// The upper end.
    pub high: f64,
}

impl Interval {
    /// Of figures by sequence and start; `None` where there are none.
    pub fn of(figures: &[Vec<f64>]) -> Option<Self> {
        let figures: Vec<&[f64]> = figures.iter().map(Vec::as_slice).filter(|starts| !starts.is_empty()).collect();
        if figures.is_empty() {
            return None;
        }
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let mut draw = |_| {
            let one = |_| {
                let starts = figures[rng.random_range(0..figures.len())];
                mean((0..starts.len()).map(|_| starts[rng.random_range(0..starts.len())]))
            };
            mean((0..figures.len()).map(one))
        };
        let mut means: Vec<f64> = (0..DRAWS).map(&mut draw).collect();
        means.sort_by(f64::total_cmp);
        let at = |share: f64| means[((DRAWS - 1) as f64 * share).round() as usize];
        let all = mean(figures.iter().map(|starts| mean(starts.iter().copied())));
        Some(Self { mean: all, low: at(TAIL), high: at(1.0 - TAIL) })
    }
}

/// How probable differences at least so far from 0 on average are if neither of two setups is better: the two-sided
/// randomisation test of Fisher, in which each sequence's difference may as well have the other sign.
pub fn p_value(differences: &[f64]) -> f64 {
    let observed = differences.iter().sum::<f64>().abs();
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    // Sums that are equal but for rounding count as equal.
    let least = observed * (1.0 - 1e-9);
    let mut is_as_far = |_: &usize| {
        let signed = differences.iter().map(|d| if rng.random::<bool>() { *d } else { -d });
        signed.sum::<f64>().abs() >= least
    };
    // What was observed is one of the ways that it can be.
    (1 + (0..DRAWS).filter(&mut is_as_far).count()) as f64 / (1 + DRAWS) as f64
}

/// The mean of at least one value.
pub(super) fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    values.sum::<f64>() / count
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The interval of a mean of so many values of a known variance is about 1.96 standard errors to either side.
    #[test]
    fn an_interval_is_as_wide_as_theory_says() {
        let values: Vec<Vec<f64>> = (0..100).map(|i| vec![f64::from(i % 2)]).collect();
        let Interval { mean, low, high } = Interval::of(&values).unwrap();
        assert_eq!(mean, 0.5);
        let half = 1.96 * (0.25f64 / 100.0).sqrt();
        assert!((high - mean - half).abs() < 0.015 && (mean - low - half).abs() < 0.015, "{low} {high}");
    }

    #[test]
    fn starts_widen_an_interval_less_than_sequences() {
        let width = |figures: &[Vec<f64>]| Interval::of(figures).map(|i| i.high - i.low).unwrap();
        let starts: Vec<_> = (0..20).map(|_| vec![0.4, 0.6]).collect();
        let sequences: Vec<_> = (0..20).map(|i| vec![if i % 2 == 0 { 0.4 } else { 0.6 }; 2]).collect();
        let same: Vec<_> = (0..20).map(|_| vec![0.5; 2]).collect();
        assert_eq!(width(&same), 0.0);
        assert!(0.0 < width(&starts) && width(&starts) < width(&sequences));
        assert_eq!(Interval::of(&[]), None);
        assert_eq!(Interval::of(&[vec![]]), None);
        assert_eq!(Interval::of(&[vec![0.25, 0.75], vec![]]).unwrap().mean, 0.5);
    }

    /// Of `n` differences of one sign, two of the 2^n choices of signs are as far from 0.
    #[test]
    fn a_p_value_is_the_share_of_choices_of_signs_that_are_as_far() {
        for n in [1, 3, 5] {
            let exact = 2.0 * 0.5f64.powi(n);
            let found = p_value(&vec![0.1; n as usize]);
            assert!((found - exact).abs() < 0.02, "{n}: {found} {exact}");
        }
        assert!(p_value(&[0.1; 20]) < 0.001);
        assert_eq!(p_value(&[]), 1.0);
        assert_eq!(p_value(&[0.1, -0.1]), 1.0);
    }
}
