//! Where the target is expected: the GM-PHD filter over the constant-velocity model that the parameters choose.
//!
//! Lengths count in sizes of the marked target, so that one set of variances fits targets of any size, and time counts
//! in frames.

use crate::filter::gm_phd::{GmPhd, GmPhdSettings};
use crate::filter::kalman::Gaussian;
use crate::filter::mixture::{Component, ReductionSettings};
use crate::filter::motion::{BoxForm, MotionModel, Noise};
use crate::filter::{Matrix, Vector};
use crate::geometry::{Rect, distance};
use crate::params::{Group as _, LcmhtMotion, MotionForm, Need};

/// Variances of the accelerations of the centre and of the steps (or accelerations) of the form's other two quantities,
/// and of what is measured of the four.
const NOISE: Noise<4> = Noise { process: [4e-4, 4e-4, 1e-4, 1e-4], measurement: [0.01; 4] };
/// Probabilities that a target goes on (p_s), and that it is measured (p_D).
const SURVIVAL: f64 = 0.99;
const DETECTION: f64 = 0.95;
/// Mean number of false measurements in the image (lambda of eq 24, the paper's value).
const CLUTTER_RATE: f64 = 4.0;
/// Weight of the component born at a measurement (eq 19), and variance of its velocity in squared target sizes a frame.
const BIRTH_WEIGHT: f64 = 0.01;
const BIRTH_VELOCITY: f64 = 0.01;
/// Components of less weight are dropped, and those closer than this (U) merged (the paper's values).
const PRUNE_BELOW: f64 = 1e-5;
const MERGE_WITHIN: f64 = 4.0;
/// Components that are kept, the heaviest first.
const MAX_COMPONENTS: usize = 50;
/// Share of a peak's rank that its distance from the expected place decides.
const PRIOR: f64 = 0.5;
/// Sides of measured boxes spread over this many target sizes: the extent of the clutter in width and in height.
const SIZE_RANGE: f64 = 2.0;
/// Share of the velocity that a target keeps from one frame in which it was not seen to the next: what moves out of
/// sight seldom goes on for long as it did.
const COAST: f64 = 0.97;
/// Rate at which the mean squared surprise follows that of a frame.
const SURPRISE_RATE: f64 = 0.1;
/// The mean squared surprise of a target that nothing is known of yet, in squared target sizes.
const FIRST_SURPRISE: f64 = 0.04;
/// Half width of the prior, in root mean squared surprises.
const PRIOR_SURPRISES: f64 = 3.0;
/// Growth of the prior's width with each frame in which the target was not seen.
const PRIOR_GROWTH: f64 = 0.1;

/// The motion of one target.
pub(super) struct TargetMotion {
    settings: LcmhtMotion,
    /// Of the image, in square pixels.
    area: f64,
    phd: Box<dyn Intensity>,
    form: BoxForm,
    /// A target size, in pixels.
    unit: f64,
    /// Mean squared distance of a target found from where it was expected, in squared target sizes.
    surprise: f64,
    /// Frames since the target was last seen.
    unseen: u32,
    measurements: Vec<Vector<4>>,
}

impl TargetMotion {
    /// The motion of a target at rest in `rect`, in an image of `area` square pixels.
    pub(super) fn new(settings: &LcmhtMotion, rect: &Rect, area: f64) -> Self {
        let unit = rect.scale();
        let form = match settings.form {
            MotionForm::Size | MotionForm::MovingSize => BoxForm::CentreSize,
            MotionForm::AreaAspect => BoxForm::CentreAreaAspect,
            MotionForm::AspectHeight => BoxForm::CentreAspectHeight,
        };
        let volume = area / (unit * unit) * SIZE_RANGE * SIZE_RANGE;
        let intensity: Box<dyn Intensity> = match settings.form {
            MotionForm::Size => Box::new(filter(MotionModel::centre_size(NOISE), volume)),
            MotionForm::MovingSize => Box::new(filter(MotionModel::centre_moving_size(NOISE), volume)),
            MotionForm::AreaAspect => Box::new(filter(MotionModel::centre_area_aspect(NOISE), volume)),
            MotionForm::AspectHeight => Box::new(filter(MotionModel::centre_aspect_height(NOISE), volume)),
        };
        let mut motion = Self {
            settings: settings.clone(),
            area,
            phd: intensity,
            form,
            unit,
            surprise: FIRST_SURPRISE,
            unseen: 0,
            measurements: Vec::new(),
        };
        motion.phd.reset(&motion.measurement(rect));
        motion
    }

    /// Takes over changed settings, the target being in `rect`, and says whether the filter begins anew for them.
    pub(super) fn retune(&mut self, settings: &LcmhtMotion, rect: &Rect) -> bool {
        let anew = settings.differs(&self.settings, Need::Motion);
        if anew {
            *self = Self { surprise: self.surprise, unseen: self.unseen, ..Self::new(settings, rect, self.area) };
        } else {
            self.settings = settings.clone();
        }
        anew
    }

    /// The centre that is expected `dt` frames after the target was at `centre`, in pixels.
    pub(super) fn expected(&self, centre: [f64; 2], dt: f64) -> [f64; 2] {
        let [vx, vy] = self.velocity();
        if self.settings.enabled { [centre[0] + vx * dt, centre[1] + vy * dt] } else { centre }
    }

    /// Predicts the intensity `dt` frames ahead (eqs 20 and 21).
    pub(super) fn predict(&mut self, dt: f64) {
        self.phd.predict(dt);
    }

    /// Velocity of the centre, in pixels a frame.
    pub(super) fn velocity(&self) -> [f64; 2] {
        let kept = COAST.powi(self.unseen.min(1000) as i32) * self.unit;
        self.phd.velocity().map_or([0.0; 2], |v| v.map(|v| v * kept))
    }

    /// How well `place` agrees with `expected`, in `0..=1`.
    pub(super) fn prior(&self, expected: [f64; 2], place: [f64; 2]) -> f64 {
        if !self.settings.enabled {
            return 1.0;
        }
        1.0 - PRIOR + PRIOR * self.nearness(expected, place)
    }

    /// How near `place` is to `expected` for this target, 1 there and falling off as a Gaussian.
    pub(super) fn nearness(&self, expected: [f64; 2], place: [f64; 2]) -> f64 {
        let growth = 1.0 + PRIOR_GROWTH * f64::from(self.unseen);
        let width =
            (PRIOR_SURPRISES * self.surprise.sqrt() * growth).clamp(self.settings.prior_min, self.settings.prior_max);
        (-0.5 * (distance(expected, place) / (width * self.unit)).powi(2)).exp()
    }

    /// Takes in the box in which the target was found, having been expected at `expected`.
    pub(super) fn saw(&mut self, rect: &Rect, expected: [f64; 2]) {
        let error = distance(rect.centre(), expected) / self.unit;
        self.surprise += SURPRISE_RATE * (error * error - self.surprise);
        self.unseen = 0;
        self.measurements.clear();
        self.measurements.push(self.measurement(rect));
        self.phd.update(&self.measurements);
    }

    /// The target was not seen in this frame.
    pub(super) fn missed(&mut self) {
        self.unseen = self.unseen.saturating_add(1);
    }

    /// Filters proposals (eqs 22 to 24) and gives the box of the heaviest component, in pixels; `None` where there is
    /// none.
    pub(super) fn filter(&mut self, proposals: impl Iterator<Item = Rect>) -> Option<Rect> {
        self.measurements.clear();
        let (form, unit) = (self.form, self.unit);
        self.measurements.extend(proposals.map(|rect| form.measurement(&divided(&rect, unit))));
        self.phd.update(&self.measurements);
        let values = self.phd.heaviest()?;
        Some(divided(&self.form.rect(&values), 1.0 / self.unit))
    }

    /// Starts anew from a target at rest in `rect`.
    pub(super) fn restart(&mut self, rect: &Rect) {
        self.unseen = 0;
        self.surprise = self.surprise.max(FIRST_SURPRISE);
        let measurement = self.measurement(rect);
        self.phd.reset(&measurement);
    }

    fn measurement(&self, rect: &Rect) -> Vector<4> {
        self.form.measurement(&divided(rect, self.unit))
    }
}

fn divided(rect: &Rect, by: f64) -> Rect {
    Rect::new(rect.x / by, rect.y / by, rect.w / by, rect.h / by)
}

/// A GM-PHD filter whose newborns are as uncertain as a measurement and of any velocity within reason.
fn filter<const N: usize>(model: MotionModel<N, 4>, clutter_volume: f64) -> GmPhd<N, 4> {
    let velocities = Vector::from_element(BIRTH_VELOCITY);
    let birth_covariance = model.diagonal(&Vector::from(NOISE.measurement), &velocities);
    GmPhd::new(
        model,
        GmPhdSettings {
            survival: SURVIVAL,
            detection: DETECTION,
            clutter_rate: CLUTTER_RATE,
            clutter_volume,
            birth_weight: BIRTH_WEIGHT,
            birth_covariance,
            reduction: ReductionSettings {
                prune_below: PRUNE_BELOW,
                merge_within: MERGE_WITHIN,
                max_components: MAX_COMPONENTS,
            },
        },
    )
}

/// A GM-PHD filter over boxes, whatever its motion model.
trait Intensity: Send {
    fn predict(&mut self, dt: f64);
    fn update(&mut self, measurements: &[Vector<4>]);
    /// The measured quantities of the heaviest component.
    fn heaviest(&self) -> Option<Vector<4>>;
    /// The velocity of its centre, in target sizes a frame.
    fn velocity(&self) -> Option<[f64; 2]>;
    /// Forgets all but a target at rest that would be measured so.
    fn reset(&mut self, measurement: &Vector<4>);
}

impl<const N: usize> Intensity for GmPhd<N, 4> {
    fn predict(&mut self, dt: f64) {
        self.predict(dt);
    }

    fn update(&mut self, measurements: &[Vector<4>]) {
        self.update(measurements);
    }

    fn heaviest(&self) -> Option<Vector<4>> {
        self.heaviest().map(|c| self.model().values(&c.state.mean))
    }

    fn velocity(&self) -> Option<[f64; 2]> {
        self.heaviest().map(|c| {
            let v = self.model().velocities(&c.state.mean);
            [v[0], v[1]]
        })
    }

    fn reset(&mut self, measurement: &Vector<4>) {
        let covariance: Matrix<N, N> = self.settings().birth_covariance;
        let state = Gaussian { mean: self.model().at_rest(measurement), covariance };
        self.reset(&[Component { weight: 1.0, state }]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::Params;

    fn motion(form: MotionForm) -> TargetMotion {
        let params = Params::default().lcmht;
        let settings = LcmhtMotion { form, ..params.motion };
        TargetMotion::new(&settings, &Rect::new(100.0, 100.0, 30.0, 60.0), 640.0 * 480.0)
    }

    #[test]
    fn every_form_learns_the_velocity_of_a_steady_target() {
        for form in [MotionForm::Size, MotionForm::MovingSize, MotionForm::AreaAspect, MotionForm::AspectHeight] {
            let mut motion = motion(form);
            let mut rect = Rect::new(100.0, 100.0, 30.0, 60.0);
            let mut expected = rect.centre();
            for _ in 0..60 {
                rect = rect.shifted(3.0, -1.0);
                motion.predict(1.0);
                motion.saw(&rect, expected);
                expected = [rect.centre()[0] + 3.0, rect.centre()[1] - 1.0];
            }
            let [vx, vy] = motion.velocity();
            assert!((vx - 3.0).abs() < 0.1 && (vy + 1.0).abs() < 0.1, "{form:?}: {vx} {vy}");
            // Two frames ahead in one step.
            let ahead = motion.expected(rect.centre(), 2.0);
            assert!((ahead[0] - rect.centre()[0] - 6.0).abs() < 0.2, "{form:?}");
            // What is unseen slows down.
            (0..20).for_each(|_| motion.missed());
            assert!(motion.velocity()[0] < 0.6 * vx);
        }
    }

    #[test]
    fn a_proposal_that_recurs_where_the_target_was_expected_is_heaviest() {
        let mut motion = motion(MotionForm::Size);
        let there = Rect::new(104.0, 101.0, 30.0, 60.0);
        for k in 0..4 {
            motion.predict(1.0);
            motion.missed();
            let clutter = Rect::new(300.0 + 37.0 * f64::from(k), 200.0 - 41.0 * f64::from(k), 30.0, 60.0);
            let best = motion.filter([clutter, there].into_iter()).unwrap();
            assert!(best.iou(&there) > 0.7, "{best}");
        }
    }

    #[test]
    fn the_prior_prefers_the_expected_place() {
        let motion = motion(MotionForm::Size);
        assert_eq!(motion.prior([5.0, 5.0], [5.0, 5.0]), 1.0);
        let (near, far) = (motion.prior([5.0, 5.0], [15.0, 5.0]), motion.prior([5.0, 5.0], [205.0, 5.0]));
        assert!(near > far && far >= 1.0 - PRIOR - 1e-12);
    }
}
