//! The incremental solution against closed forms, a batch solution by another method, and its own conditions.

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Example, Set, Svm, SvmParams};

type Sample = (Vec<f32>, bool);

/// How closely the conditions hold: the ridge on the kernel's diagonal moves a margin by up to `C * RIDGE`, and
/// duplicates in great number make the problem ill-conditioned besides.
const HELD: f64 = 1e-6;

fn params(c: f64, gamma: f64) -> SvmParams {
    SvmParams { c, gamma, max_support: usize::MAX }
}

fn learned(samples: &[Sample], params: SvmParams) -> Svm {
    let mut svm = Svm::new(samples[0].0.len(), params);
    for (x, positive) in samples {
        svm.add(x, *positive);
    }
    svm
}

fn kernel(a: &[f32], b: &[f32], gamma: f64) -> f64 {
    let squared: f64 = a.iter().zip(b).map(|(&p, &q)| (p as f64 - q as f64).powi(2)).sum();
    (-gamma * squared).exp()
}

fn label(positive: bool) -> f64 {
    if positive { 1.0 } else { -1.0 }
}

/// Two Gaussian-like clouds `shift` apart along every axis; `share` of the samples is positive.
fn clouds(seed: u64, count: usize, dim: usize, shift: f32, share: f64) -> Vec<Sample> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..count)
        .map(|_| {
            let positive = rng.random_bool(share);
            let offset = if positive { shift } else { 0.0 };
            (
                (0..dim).map(|_| rng.random_range(-1.0f32..1.0) + rng.random_range(-1.0f32..1.0) + offset).collect(),
                positive,
            )
        })
        .collect()
}

/// The conditions of eqs 14 and 15 of the LCMHT paper, from the coefficients and the bias alone.
fn assert_conditions(svm: &Svm, params: SvmParams) {
    let all: Vec<Example> = (0..svm.len()).map(|i| svm.example(i)).collect();
    let balance: f64 = all.iter().map(|e| e.alpha * label(e.positive)).sum();
    assert!(balance.abs() < 1e-8, "sum of signed coefficients is {balance}");
    for e in &all {
        let sum: f64 =
            all.iter().map(|o| o.alpha * label(o.positive) * kernel(o.features, e.features, params.gamma)).sum();
        let f = sum + svm.bias();
        let m = label(e.positive) * f - 1.0;
        assert!((f - svm.margin(e.features)).abs() < 1e-12);
        assert!((m - e.margin).abs() < HELD, "margin {m} is kept as {}", e.margin);
        assert!((0.0..=params.c).contains(&e.alpha), "coefficient {}", e.alpha);
        match e.set {
            Set::Margin => assert!(m.abs() < HELD, "margin vector at {m}"),
            Set::Error => assert!(m < HELD && e.alpha == params.c, "error vector at {m}, {}", e.alpha),
            Set::Reserve => assert!(m > -HELD && e.alpha == 0.0, "reserve vector at {m}, {}", e.alpha),
        }
    }
}

/// Projection on `0 <= a <= c, y.a = 0`, by bisection of the multiplier.
fn project(a: &[f64], y: &[f64], c: f64) -> Vec<f64> {
    let at = |t: f64| -> Vec<f64> { a.iter().zip(y).map(|(a, y)| (a - t * y).clamp(0.0, c)).collect() };
    let (mut low, mut high) = (-1e3, 1e3);
    for _ in 0..100 {
        let mid = (low + high) / 2.0;
        let balance: f64 = at(mid).iter().zip(y).map(|(a, y)| a * y).sum();
        if balance > 0.0 { low = mid } else { high = mid }
    }
    at((low + high) / 2.0)
}

/// Coefficients and bias by accelerated projected gradients with restarts on the dense problem.
fn batch(samples: &[Sample], params: SvmParams) -> (Vec<f64>, f64) {
    let n = samples.len();
    let y: Vec<f64> = samples.iter().map(|s| label(s.1)).collect();
    let k: Vec<Vec<f64>> =
        (0..n).map(|i| (0..n).map(|j| kernel(&samples[i].0, &samples[j].0, params.gamma)).collect()).collect();
    let value = |a: &[f64], i: usize| (0..n).map(|j| y[j] * a[j] * k[i][j]).sum::<f64>();
    let lipschitz = k.iter().map(|row| row.iter().sum::<f64>()).fold(0.0, f64::max);
    let (mut a, mut ahead, mut speed) = (vec![0.0; n], vec![0.0; n], 1.0f64);
    for round in 0..200_000 {
        let gradient: Vec<f64> = (0..n).map(|i| y[i] * value(&ahead, i) - 1.0).collect();
        let moved: Vec<f64> = ahead.iter().zip(&gradient).map(|(a, g)| a - g / lipschitz).collect();
        let next = project(&moved, &y, params.c);
        let uphill: f64 = (0..n).map(|i| (ahead[i] - next[i]) * (next[i] - a[i])).sum();
        let change = next.iter().zip(&a).map(|(p, q)| (p - q).abs()).fold(0.0, f64::max);
        let faster = if uphill > 0.0 { 1.0 } else { (1.0 + (1.0 + 4.0 * speed * speed).sqrt()) / 2.0 };
        let push = if uphill > 0.0 { 0.0 } else { (speed - 1.0) / faster };
        ahead = next.iter().zip(&a).map(|(p, q)| p + push * (p - q)).collect();
        (a, speed) = (next, faster);
        if round > 10 && change < 1e-14 {
            break;
        }
    }
    let free: Vec<f64> =
        (0..n).filter(|&i| 1e-6 < a[i] && a[i] < params.c - 1e-6).map(|i| y[i] - value(&a, i)).collect();
    assert!(!free.is_empty(), "the bias needs a free coefficient");
    let bias = free.iter().sum::<f64>() / free.len() as f64;
    assert!(free.iter().all(|b| (b - bias).abs() < 1e-9), "the batch solution has not converged");
    (a, bias)
}

#[test]
fn two_points_have_the_closed_form() {
    let (a, b) = (vec![0.0f32, 0.0], vec![0.0f32, 1.0]);
    let k = (-0.5f64).exp();
    // f = +-1 at the points gives a = 1 / (1 - K) and b = 0.
    let svm = learned(&[(a.clone(), true), (b.clone(), false)], params(10.0, 0.5));
    assert!((svm.example(0).alpha - 1.0 / (1.0 - k)).abs() < 1e-7);
    assert!((svm.example(1).alpha - 1.0 / (1.0 - k)).abs() < 1e-7);
    assert!(svm.bias().abs() < 1e-12);
    assert!((svm.margin(&a) - 1.0).abs() < 1e-7 && (svm.margin(&b) + 1.0).abs() < 1e-7);
    // With C = 2 < 1 / (1 - K) both are error vectors, and f(a) = 2 (1 - K) stays below 1.
    let bounded = learned(&[(a.clone(), true), (b, false)], params(2.0, 0.5));
    assert_eq!((bounded.example(0).alpha, bounded.example(1).set), (2.0, Set::Error));
    assert!((bounded.margin(&a) - 2.0 * (1.0 - k)).abs() < 1e-7);
}

#[test]
fn the_increments_reach_the_batch_solution() {
    // (samples, dimensions, shift, share of positives, C): separable, overlapping, unbalanced, tight, loose.
    let cases = [
        (30, 4, 3.0, 0.5, 2.0),
        (40, 4, 0.5, 0.5, 2.0),
        (40, 6, 0.8, 0.15, 2.0),
        (40, 3, 0.3, 0.4, 0.5),
        (30, 5, 1.0, 0.5, 50.0),
    ];
    for (case, (count, dim, shift, share, c)) in cases.into_iter().enumerate() {
        for seed in 0..4 {
            let samples = clouds(100 * case as u64 + seed, count, dim, shift, share);
            let params = params(c, 0.4);
            let svm = learned(&samples, params);
            let (alphas, bias) = batch(&samples, params);
            assert!((svm.bias() - bias).abs() < 2e-6, "case {case}, seed {seed}: bias {} is {bias}", svm.bias());
            for (i, alpha) in alphas.iter().enumerate() {
                let own = svm.example(i).alpha;
                assert!((own - alpha).abs() < 1e-5, "case {case}, seed {seed}: coefficient {own} is {alpha}");
            }
            for (probe, _) in clouds(7, 20, dim, shift, 0.5) {
                let terms = samples.iter().zip(&alphas);
                let f: f64 = bias + terms.map(|(s, a)| a * label(s.1) * kernel(&s.0, &probe, 0.4)).sum::<f64>();
                assert!((svm.margin(&probe) - f).abs() < 2e-6);
            }
            assert_eq!(svm.resolves(), 0, "case {case}, seed {seed}: the increments carried it all");
        }
    }
}

#[test]
fn the_order_does_not_matter_and_removal_undoes() {
    for seed in 0..8 {
        let mut samples = clouds(seed, 60, 5, 0.7, 0.4);
        let params = params(2.0, 0.3);
        let svm = learned(&samples, params);
        samples.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
        let other = learned(&samples, params);
        let mut longer = other.clone();
        let extra = clouds(900 + seed, 25, 5, 0.7, 0.6);
        extra.iter().for_each(|(x, positive)| longer.add(x, *positive));
        for (x, _) in &extra {
            let index = (0..longer.len()).find(|&i| longer.example(i).features == x.as_slice()).unwrap();
            longer.remove(index);
        }
        assert_eq!(longer.len(), svm.len());
        for (probe, _) in clouds(77, 20, 5, 0.7, 0.5).iter().chain(&samples) {
            let f = svm.margin(probe);
            assert!((f - other.margin(probe)).abs() < 1e-7);
            assert!((f - longer.margin(probe)).abs() < 1e-7);
        }
        assert_eq!((svm.resolves(), other.resolves(), longer.resolves()), (0, 0, 0));
    }
}

#[test]
fn a_batch_of_candidates_scores_as_single_ones() {
    let mut svm = learned(&clouds(3, 80, 37, 0.4, 0.3), params(2.0, 0.05));
    for count in [1, 7, 300] {
        let candidates = clouds(4, count, 37, 0.4, 0.5);
        let rows: Vec<f32> = candidates.iter().flat_map(|(x, _)| x.iter().copied()).collect();
        let mut out = vec![f64::NAN; count];
        svm.margins(&rows, &mut out);
        for ((x, _), f) in candidates.iter().zip(out) {
            assert!((svm.margin(x) - f).abs() < 1e-5);
        }
        // What is learned or unlearned in between counts.
        svm.add(&rows[..37], count != 7);
        svm.remove(0);
    }
}

#[test]
fn one_class_alone_decides_for_itself() {
    let mut svm = Svm::new(2, SvmParams::default());
    let mut out = [1.0; 2];
    svm.margins(&[0.0, 1.0, 2.0, 3.0], &mut out);
    assert_eq!((svm.margin(&[3.0, 4.0]), out), (0.0, [0.0; 2]));
    for i in 0..3 {
        svm.add(&[i as f32, 1.0], false);
        assert!(!svm.is_trained());
        assert_eq!(svm.margin(&[9.0, 9.0]), -1.0);
    }
    svm.add(&[0.0, 0.0], true);
    assert!(svm.is_trained());
    assert!(svm.margin(&[0.0, 0.0]) > svm.margin(&[0.0, 1.0]));
    svm.remove(3);
    assert_eq!(svm.margin(&[0.0, 0.0]), -1.0);
}

#[test]
fn the_greatest_margin_goes_first_and_its_absence_is_exact() {
    let samples = clouds(5, 60, 3, 1.0, 0.4);
    let limit = 24;
    let mut bounded = Svm::new(3, SvmParams { max_support: limit, ..params(2.0, 0.3) });
    let mut kept: Vec<Sample> = Vec::new();
    for (x, positive) in &samples {
        kept.push((x.clone(), *positive));
        if kept.len() > limit {
            let full = learned(&kept, params(2.0, 0.3));
            let gone = (0..full.len())
                .max_by(|&i, &j| {
                    let key = |i: usize| (full.example(i).margin.max(0.0), -full.example(i).alpha);
                    key(i).partial_cmp(&key(j)).unwrap()
                })
                .unwrap();
            assert_eq!(full.example(gone).set, Set::Reserve, "the case is about reserve vectors");
            kept.remove(gone);
        }
        bounded.add(x, *positive);
        assert_eq!(bounded.len(), kept.len());
        let full = learned(&kept, params(2.0, 0.3));
        for (probe, _) in &samples {
            assert!((bounded.margin(probe) - full.margin(probe)).abs() < 1e-7);
        }
    }
}

#[test]
fn other_settings_solve_the_same_examples_anew() {
    let samples = clouds(6, 50, 4, 0.6, 0.4);
    let mut svm = learned(&samples, params(2.0, 0.3));
    svm.retune(params(0.7, 0.9));
    let fresh = learned(&samples, params(0.7, 0.9));
    for (x, _) in &samples {
        assert!((svm.margin(x) - fresh.margin(x)).abs() < 1e-7);
    }
    svm.retune(SvmParams { max_support: 10, ..params(0.7, 0.9) });
    assert_eq!(svm.len(), 10);
    assert!(svm.is_trained());
    assert_conditions(&svm, params(0.7, 0.9));
}

#[test]
fn contradictions_and_repetitions_are_borne() {
    let mut svm = Svm::new(2, params(2.0, 1.0));
    for round in 0..40 {
        svm.add(&[1.0, 2.0], round % 2 == 0);
        svm.add(&[1.0, 2.5], round % 3 == 0);
        assert_conditions(&svm, params(2.0, 1.0));
    }
    while !svm.is_empty() {
        svm.remove(svm.len() / 2);
        assert_conditions(&svm, params(2.0, 1.0));
    }
    assert_eq!(svm.margin(&[1.0, 2.0]), 0.0);
}

proptest! {
    #![proptest_config(ProptestConfig {
        rng_seed: RngSeed::Fixed(1), failure_persistence: None, ..ProptestConfig::default()
    })]

    /// Coordinates on a coarse grid make duplicates, contradictions and ties frequent.
    #[test]
    fn the_conditions_hold_after_every_operation(
        operations in prop::collection::vec(
            (prop::array::uniform2(0u8..6), any::<bool>(), 0u8..100, any::<prop::sample::Index>()), 1..70,
        ),
        c in prop::sample::select(vec![0.1, 1.0, 2.0, 5.0]),
        grid in prop::sample::select(vec![0.05f32, 0.3, 1.0]),
    ) {
        let params = params(c, 0.8);
        let mut svm = Svm::new(2, params);
        for (point, positive, what, index) in operations {
            if what < 30 && !svm.is_empty() {
                svm.remove(index.index(svm.len()));
            } else {
                svm.add(&point.map(|v| f32::from(v) * grid), positive);
            }
            assert_conditions(&svm, params);
        }
    }

    #[test]
    fn the_conditions_hold_in_general_position(
        seed in any::<u64>(), shift in 0.0f32..2.0, share in 0.05f64..0.95, gamma in 0.05f64..3.0,
    ) {
        let params = params(2.0, gamma);
        let mut svm = Svm::new(3, params);
        for (i, (x, positive)) in clouds(seed, 50, 3, shift, share).into_iter().enumerate() {
            svm.add(&x, positive);
            assert_conditions(&svm, params);
            if i % 5 == 4 {
                svm.remove(seed as usize % svm.len());
                assert_conditions(&svm, params);
            }
        }
    }
}
