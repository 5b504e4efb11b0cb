//! What reduction keeps: weight, mean and covariance on merging, the heaviest on capping, nothing of the pruned.

use super::*;

const MERGE_ONLY: ReductionSettings =
    ReductionSettings { prune_below: 0.0, merge_within: 4.0, max_components: usize::MAX };

fn component<const N: usize>(weight: f64, mean: [f64; N], variances: [f64; N]) -> Component<N> {
    let covariance = Matrix::from_diagonal(&Vector::from(variances));
    Component { weight, state: Gaussian { mean: Vector::from(mean), covariance } }
}

fn reduced<const N: usize>(mixture: &[Component<N>], settings: &ReductionSettings) -> Vec<Component<N>> {
    let mut mixture = mixture.to_vec();
    Reducer::default().reduce(&mut mixture, settings);
    mixture
}

fn weights<const N: usize>(mixture: &[Component<N>]) -> Vec<f64> {
    mixture.iter().map(|c| c.weight).collect()
}

#[test]
fn merging_by_hand() {
    // Weights 3 : 1, means 0 and 2: mean 0.5, covariance (3 (1 + 0.25) + 1 (5 + 2.25)) / 4 = 2.75.
    let merged = reduced(&[component(0.2, [2.0], [5.0]), component(0.6, [0.0], [1.0])], &MERGE_ONLY);
    assert_eq!(merged.len(), 1);
    assert!((merged[0].weight - 0.8).abs() < 1e-15);
    assert!((merged[0].state.mean[0] - 0.5).abs() < 1e-15);
    assert!((merged[0].state.covariance[(0, 0)] - 2.75).abs() < 1e-15);
}

#[test]
fn the_lighter_component_measures_the_distance() {
    // Squared distance 9, that is 9 under the variance 1 and 1.8 under the variance 5.
    let (narrow, wide) = ([1.0], [5.0]);
    assert_eq!(reduced(&[component(0.6, [0.0], narrow), component(0.2, [3.0], wide)], &MERGE_ONLY).len(), 1);
    assert_eq!(reduced(&[component(0.6, [0.0], wide), component(0.2, [3.0], narrow)], &MERGE_ONLY).len(), 2);
}

#[test]
fn components_at_the_limit_stay_apart() {
    let at = |x| reduced(&[component(0.6, [0.0], [1.0]), component(0.2, [x], [1.0])], &MERGE_ONLY).len();
    assert_eq!([at(1.99), at(2.0)], [1, 2]);
    let none = ReductionSettings { merge_within: 0.0, ..MERGE_ONLY };
    assert_eq!(reduced(&[component(0.6, [0.0], [1.0]); 3], &none).len(), 3);
}

/// The heaviest takes its neighbours before the next one does, whatever the order in the mixture.
#[test]
fn the_heaviest_merges_first() {
    let row = [component(0.3, [1.5], [1.0]), component(0.2, [3.0], [1.0]), component(0.5, [0.0], [1.0])];
    let merged = reduced(&row, &MERGE_ONLY);
    assert_eq!(weights(&merged), [0.8, 0.2]);
    assert_eq!(merged[1], row[1]);
}

#[test]
fn merging_keeps_weight_mean_and_second_moment_of_the_whole() {
    let mixture: Vec<_> = (0..40)
        .map(|i| {
            let t = f64::from(i);
            component(
                0.01 + 0.02 * (t * 0.7).sin().powi(2),
                [t.sin() * 6.0, (2.0 * t).cos() * 6.0],
                [1.0 + t * 0.1, 2.0],
            )
        })
        .collect();
    let merged = reduced(&mixture, &MERGE_ONLY);
    assert!(merged.len() > 1 && merged.len() < 20, "{}", merged.len());
    let moments = |m: &[Component<2>]| {
        let mut sums = (0.0, Vector::<2>::zeros(), Matrix::<2, 2>::zeros());
        for c in m {
            let (mean, covariance) = (c.state.mean, c.state.covariance);
            sums.0 += c.weight;
            sums.1 += mean * c.weight;
            sums.2 += (covariance + mean * mean.transpose()) * c.weight;
        }
        sums
    };
    let (before, after) = (moments(&mixture), moments(&merged));
    assert!((before.0 - after.0).abs() < 1e-13);
    assert!((before.1 - after.1).amax() < 1e-13);
    assert!((before.2 - after.2).amax() < 1e-12);
}

#[test]
fn pruned_weight_is_gone_and_nothing_weightless_stays() {
    let settings = ReductionSettings { prune_below: 1e-5, ..MERGE_ONLY };
    let mixture = [component(0.5, [0.0], [1.0]), component(0.99e-5, [50.0], [1.0]), component(1e-5, [90.0], [1.0])];
    assert_eq!(weights(&reduced(&mixture, &settings)), [0.5, 1e-5]);
    assert!(reduced(&[component(0.0, [0.0], [1.0]); 2], &MERGE_ONLY).is_empty());
}

#[test]
fn the_cap_keeps_the_heaviest() {
    let settings = ReductionSettings { max_components: 3, ..MERGE_ONLY };
    let mixture: Vec<_> = [0.1, 0.7, 0.3, 0.9, 0.2].iter().map(|&w| component(w, [w * 1e3], [1.0])).collect();
    assert_eq!(weights(&reduced(&mixture, &settings)), [0.9, 0.7, 0.3]);
}
