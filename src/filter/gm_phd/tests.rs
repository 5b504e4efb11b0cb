//! The recursion against numbers worked out by hand, against an integration on a grid, and in whole runs.

use super::*;
use crate::filter::motion::{Noise, Place};

type Walk = GmPhd<1, 1>;

const NO_REDUCTION: ReductionSettings =
    ReductionSettings { prune_below: 0.0, merge_within: 0.0, max_components: usize::MAX };

/// A position that is measured and walks at random.
fn random_walk(process: f64, measurement: f64) -> MotionModel<1, 1> {
    let place = Place { value: 0, velocity: None };
    MotionModel::new([place], Noise { process: [process], measurement: [measurement] })
}

fn component(weight: f64, mean: f64, variance: f64) -> Component<1> {
    Component { weight, state: Gaussian { mean: Vector::from([mean]), covariance: Matrix::from([[variance]]) } }
}

fn measured(values: &[f64]) -> Vec<Vector<1>> {
    values.iter().map(|&z| Vector::from([z])).collect()
}

fn assert_component(actual: &Component<1>, expected: [f64; 3]) {
    let found = [actual.weight, actual.state.mean[0], actual.state.covariance[(0, 0)]];
    let equal = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12);
    assert!(equal, "{found:?} is not {expected:?}");
}

#[test]
fn two_components_and_one_measurement_by_hand() {
    let settings = GmPhdSettings {
        detection: 0.9,
        clutter_rate: 2.0,
        clutter_volume: 100.0,
        birth_weight: 0.0,
        reduction: NO_REDUCTION,
        ..GmPhdSettings::new(1.0, Matrix::identity())
    };
    let mut filter = Walk::new(random_walk(0.5, 1.0), settings);
    filter.reset(&[component(0.4, 3.0, 4.0), component(0.8, 0.0, 1.0)]);
    filter.update(&measured(&[1.0]));
    // S = 2 and 5, K = 1/2 and 4/5; q = N(1; 0, 2) = 0.2196956 and N(1; 3, 5) = 0.1195934; the shares p_D w q are
    // 0.1581809 and 0.0430536 beside clutter of 0.02.
    let found = filter.components();
    assert_eq!(found.len(), 4);
    assert_component(&found[0], [0.7149918684895927, 0.5, 0.5]);
    assert_component(&found[1], [0.19460631558054922, 1.4, 0.8]);
    assert_component(&found[2], [0.08, 0.0, 1.0]);
    assert_component(&found[3], [0.04, 3.0, 4.0]);
}

#[test]
fn one_birth_by_hand() {
    let settings = GmPhdSettings {
        birth_weight: 0.1,
        reduction: NO_REDUCTION,
        ..GmPhdSettings::new(1000.0, Matrix::from([[9.0]]))
    };
    let mut filter = Walk::new(random_walk(0.5, 1.0), settings);
    filter.update(&measured(&[7.0]));
    // q = N(0; 0, 10) = 0.1261566, so 0.98 * 0.1 q beside clutter of 4/1000; and the missed part, 0.02 * 0.1.
    let found = filter.components();
    assert_eq!(found.len(), 2);
    assert_component(&found[0], [0.7555512681106968, 7.0, 0.9]);
    assert_component(&found[1], [0.002, 7.0, 9.0]);
}

#[test]
fn survival_is_a_probability_a_frame() {
    let settings = GmPhdSettings { survival: 0.9, ..GmPhdSettings::new(1.0, Matrix::identity()) };
    let mut filter = Walk::new(random_walk(0.5, 1.0), settings);
    filter.reset(&[component(1.0, 3.0, 4.0)]);
    filter.predict(1.0);
    assert_component(filter.heaviest().unwrap(), [0.9, 3.0, 4.5]);
    filter.predict(2.0);
    assert_component(filter.heaviest().unwrap(), [0.729, 3.0, 5.0]);
}

/// The density of a normal distribution.
fn normal(x: f64, mean: f64, variance: f64) -> f64 {
    (-(x - mean).powi(2) / (2.0 * variance)).exp() / (std::f64::consts::TAU * variance).sqrt()
}

/// An intensity on a line, as its values at equal steps; integrals are sums. Knows nothing of Gaussian components.
struct Grid {
    values: Vec<f64>,
}

impl Grid {
    const STEP: f64 = 0.125;
    const COUNT: usize = 1000;

    fn x(i: usize) -> f64 {
        i as f64 * Self::STEP - 50.0
    }

    fn integral(&self) -> f64 {
        self.values.iter().sum::<f64>() * Self::STEP
    }

    fn step(&mut self, settings: &GmPhdSettings<1>, process: f64, measurement: f64, z: &[f64]) {
        let old = &self.values;
        let moved = |i| (0..Self::COUNT).map(|j| normal(Self::x(i), Self::x(j), process) * old[j]).sum::<f64>();
        let born = |x| z.iter().map(|&z| normal(x, z, settings.birth_covariance[(0, 0)])).sum::<f64>();
        let predicted: Vec<f64> = (0..Self::COUNT)
            .map(|i| settings.survival * moved(i) * Self::STEP + settings.birth_weight * born(Self::x(i)))
            .collect();
        self.values = predicted.iter().map(|d| (1.0 - settings.detection) * d).collect();
        for &z in z {
            let shares: Vec<f64> = predicted
                .iter()
                .enumerate()
                .map(|(i, d)| settings.detection * normal(z, Self::x(i), measurement) * d)
                .collect();
            let total = settings.clutter_rate / settings.clutter_volume + shares.iter().sum::<f64>() * Self::STEP;
            for (value, share) in self.values.iter_mut().zip(&shares) {
                *value += share / total;
            }
        }
    }

    /// The intensity of `filter` less this one, at each step.
    fn differences(&self, filter: &Walk) -> Vec<f64> {
        let mixture = |x| {
            let density = |c: &Component<1>| normal(x, c.state.mean[0], c.state.covariance[(0, 0)]);
            filter.components().iter().map(|c| c.weight * density(c)).sum::<f64>()
        };
        self.values.iter().enumerate().map(|(i, v)| mixture(Self::x(i)) - v).collect()
    }
}

/// Frames with one, two and no measurement: a target from 0 on, another from 12 on, clutter.
const FRAMES: [&[f64]; 6] = [&[0.1], &[0.4, 12.3], &[], &[1.9, 11.0], &[1.2, -17.0], &[12.1]];

/// Runs the filter beside a grid and gives `check` both after each frame.
fn beside_a_grid(reduction: ReductionSettings, check: impl Fn(&Walk, &Grid)) {
    let (process, measurement) = (0.7, 1.3);
    let settings = GmPhdSettings {
        survival: 0.95,
        detection: 0.8,
        clutter_rate: 1.5,
        clutter_volume: 60.0,
        birth_weight: 0.1,
        birth_covariance: Matrix::from([[6.0]]),
        reduction,
    };
    let mut filter = Walk::new(random_walk(process, measurement), settings);
    let mut grid = Grid { values: vec![0.0; Grid::COUNT] };
    for z in FRAMES {
        filter.predict(1.0);
        filter.update(&measured(z));
        grid.step(&settings, process, measurement, z);
        check(&filter, &grid);
    }
}

#[test]
fn recursion_agrees_with_an_integration_on_a_grid() {
    beside_a_grid(NO_REDUCTION, |filter, grid| {
        let largest = grid.differences(filter).iter().fold(0.0_f64, |m, d| m.max(d.abs()));
        assert!(largest < 1e-12, "{largest:e}");
        assert!((filter.expected_targets() - grid.integral()).abs() < 1e-12);
    });
}

/// The expected number of targets to the left of any place, with reduction and without.
#[test]
fn reduction_changes_the_recursion_little() {
    beside_a_grid(ReductionSettings::default(), |filter, grid| {
        let (mut left, mut largest) = (0.0, 0.0_f64);
        for difference in grid.differences(filter) {
            left += difference * Grid::STEP;
            largest = largest.max(f64::abs(left));
        }
        assert!(largest < 0.03, "{largest} of {}", grid.integral());
        assert!((filter.expected_targets() / grid.integral() - 1.0).abs() < 0.005);
    });
}

/// The weight of what lies within 5 of `x`.
fn weight_near(filter: &Walk, x: f64) -> f64 {
    filter.components().iter().filter(|c| (c.state.mean[0] - x).abs() < 5.0).map(|c| c.weight).sum()
}

#[test]
fn clutter_far_away_does_not_raise_the_weight_of_the_target() {
    let settings = GmPhdSettings::new(1000.0, Matrix::from([[9.0]]));
    let mut alone = Walk::new(random_walk(0.5, 1.0), settings);
    alone.update(&measured(&[0.0]));
    let mut disturbed = alone.clone();
    for (frame, clutter) in [300.0, -450.0, 120.0, 420.0, -200.0].into_iter().enumerate() {
        let target = 0.3 * frame as f64;
        alone.predict(1.0);
        alone.update(&measured(&[target]));
        disturbed.predict(1.0);
        disturbed.update(&measured(&[clutter, target]));
        let (calm, noisy) = (weight_near(&alone, target), weight_near(&disturbed, target));
        assert!(noisy <= calm + 1e-12, "frame {frame}: {noisy} > {calm}");
        assert!((disturbed.heaviest().unwrap().state.mean[0] - target).abs() < 2.0);
    }
}

/// Five frames of a target against one frame of proposals: the heaviest component stays with the target.
#[test]
fn a_remembered_target_outweighs_new_proposals() {
    let settings = GmPhdSettings { detection: 0.7, ..GmPhdSettings::new(100.0, Matrix::from([[9.0]])) };
    let mut filter = Walk::new(random_walk(0.5, 1.0), settings);
    for _ in 0..5 {
        filter.predict(1.0);
        filter.update(&measured(&[0.0]));
    }
    filter.predict(1.0);
    filter.update(&measured(&[40.0, 1.0, -30.0, 25.0, -45.0]));
    assert!(filter.heaviest().unwrap().state.mean[0].abs() < 1.0);
}

#[test]
fn expected_number_settles_at_the_number_of_targets() {
    let settings = GmPhdSettings::new(1000.0, Matrix::from([[9.0]]));
    for targets in [vec![], vec![0.0], vec![-100.0, 50.0], vec![-100.0, 50.0, 200.0]] {
        let mut filter = Walk::new(random_walk(0.5, 1.0), settings);
        for _ in 0..30 {
            filter.predict(1.0);
            filter.update(&measured(&targets));
        }
        let count = targets.len() as f64;
        assert!((filter.expected_targets() - count).abs() <= 0.06 * count, "{}", filter.expected_targets());
    }
}

#[test]
fn without_measurements_targets_fade_and_are_forgotten() {
    let settings = GmPhdSettings { survival: 0.9, detection: 0.5, ..GmPhdSettings::new(1000.0, Matrix::identity()) };
    let mut filter = Walk::new(random_walk(0.5, 1.0), settings);
    filter.reset(&[component(1.0, 0.0, 1.0)]);
    for frame in 1..=14 {
        filter.predict(1.0);
        filter.update(&[]);
        assert!((filter.expected_targets() - 0.45_f64.powi(frame)).abs() < 1e-15);
    }
    // 0.45^15 is below 1e-5.
    filter.predict(1.0);
    filter.update(&[]);
    assert_eq!(filter.heaviest(), None);
}

/// A measurement 10,000 standard deviations away has a likelihood of exp(-5e7): 0 in `f64`.
#[test]
fn likelihoods_below_the_range_of_numbers_give_finite_weights() {
    let no_births = GmPhdSettings { birth_weight: 0.0, ..GmPhdSettings::new(1000.0, Matrix::identity()) };
    let filter = |clutter_rate| {
        let mut filter = Walk::new(random_walk(0.5, 1.0), GmPhdSettings { clutter_rate, ..no_births });
        filter.reset(&[component(0.6, 0.0, 3.0), component(0.4, -4.0, 3.0)]);
        filter.update(&measured(&[2e4]));
        assert!(filter.components().iter().all(|c| c.weight.is_finite() && c.state.mean[0].is_finite()));
        filter
    };
    // Clutter explains it: what is left is missed.
    assert!((filter(4.0).expected_targets() - 0.02).abs() < 1e-12);
    // There is no clutter: a target it must be, and the nearer component's, by exp(2e4).
    let sure = filter(0.0);
    assert!((sure.heaviest().unwrap().weight - 1.0).abs() < 1e-12);
    assert!((sure.heaviest().unwrap().state.mean[0] - 15_000.0).abs() < 1e-9);
    assert!((sure.expected_targets() - 1.02).abs() < 1e-12);
}

#[test]
fn resetting_forgets_and_retuning_does_not() {
    let settings = GmPhdSettings::new(1000.0, Matrix::from([[9.0]]));
    let mut filter = Walk::new(random_walk(0.5, 1.0), settings);
    filter.update(&measured(&[3.0]));
    let known = *filter.heaviest().unwrap();
    let settings = GmPhdSettings { detection: 0.5, ..settings };
    filter.retune(random_walk(2.0, 1.0), settings);
    assert_eq!((filter.heaviest(), filter.settings()), (Some(&known), &settings));
    filter.predict(1.0);
    assert_eq!(filter.heaviest().unwrap().state.covariance[(0, 0)], known.state.covariance[(0, 0)] + 2.0);
    filter.reset(&[]);
    assert_eq!(filter.heaviest(), None);
}

/// A box that moves steadily among false boxes, hidden for ten frames: velocity is learnt, and carries it through.
#[test]
fn a_moving_box_is_found_again_where_its_motion_led() {
    let noise = Noise { process: [0.05, 0.05, 1.0, 1.0], measurement: [4.0, 4.0, 9.0, 9.0] };
    let model = MotionModel::centre_size(noise);
    let birth = model.diagonal(&Vector::from([25.0, 25.0, 25.0, 25.0]), &Vector::from([9.0, 9.0, 0.0, 0.0]));
    let mut filter = GmPhd::new(model, GmPhdSettings::new(640.0 * 480.0 * 20.0 * 40.0, birth));
    let truth = |frame: f64| Vector::from([100.0 + 3.0 * frame, 200.0 - frame, 30.0, 60.0]);
    for frame in 0..30 {
        filter.predict(1.0);
        filter.update(&[truth(f64::from(frame))]);
    }
    let state = filter.heaviest().unwrap().state;
    assert!((model.values(&state.mean) - truth(29.0)).amax() < 0.1);
    assert!((model.velocities(&state.mean) - Vector::from([3.0, -1.0, 0.0, 0.0])).amax() < 0.05);
    filter.predict(10.0);
    let false_boxes =
        [[90.0, 90.0], [185.0, 120.0], [400.0, 300.0], [20.0, 440.0]].map(|[x, y]| Vector::from([x, y, 30.0, 60.0]));
    let [a, b, c, d] = false_boxes;
    filter.update(&[a, b, truth(39.0), c, d]);
    let found = filter.heaviest().unwrap();
    assert!(found.weight > 0.9, "{}", found.weight);
    assert!((model.values(&found.state.mean) - truth(39.0)).amax() < 1.0);
}
