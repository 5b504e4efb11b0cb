//! The adaptive first-order motion model (eq 6): the target is somewhere around where it was, the farther the faster it
//! moved of late. While it is lost, it may be farther away with every frame.

use std::collections::VecDeque;

use crate::filter::Vector;
use crate::filter::bounds::Bounds;
use crate::frame::{Frame, MIN_TARGET_SIDE};
use crate::geometry::Rect;
use crate::params::{EtepfModes, EtepfParticles};

/// A state: the centre (u, v) in pixels, and the scale s, 1 at first.
pub(super) type Place = Vector<3>;

/// The area of a search is so many standard deviations of the noise wide, when that is at its greatest.
const DEVIATIONS: f64 = 4.0;

/// Frames whose steps give the noise (C of eq 6).
const HISTORY: usize = 5;
/// Growth of the noise with each frame in FIND.
const WIDEN: f64 = 1.2;

/// What is remembered of the last steps.
pub(super) struct ParticleMotion {
    /// Steps of the centre in a frame period, the oldest in front.
    steps: VecDeque<[f64; 2]>,
    /// Growth of the noise, above 1 while the target is lost.
    widening: f64,
}

impl ParticleMotion {
    /// Of a target that has stood still.
    pub(super) fn new() -> Self {
        Self { steps: VecDeque::new(), widening: 1.0 }
    }

    /// The standard deviations of a step over `dt` frame periods: the diagonal of `C`. Those of the centre are the root
    /// mean square of the last steps, no less than the floor, and no more than fits the area of a search.
    pub(super) fn noise(&self, size: [f64; 2], dt: f64, particles: &EtepfParticles, modes: &EtepfModes) -> Place {
        let of_centre = |axis: usize| {
            let squares: f64 = self.steps.iter().map(|step| step[axis] * step[axis]).sum();
            let speed = (squares / self.steps.len().max(1) as f64).sqrt().max(particles.least_noise);
            let most = (modes.extent * size[axis] / DEVIATIONS).max(particles.least_noise);
            (speed * self.widening * dt).min(most)
        };
        Place::from([of_centre(0), of_centre(1), particles.scale_noise])
    }

    /// The target has moved by `step` pixels over `dt` frame periods.
    pub(super) fn moved(&mut self, step: [f64; 2], dt: f64) {
        while self.steps.len() >= HISTORY {
            self.steps.pop_front();
        }
        self.steps.push_back(step.map(|s| s / dt));
        self.widening = 1.0;
    }

    /// The target was not found.
    pub(super) fn missed(&mut self) {
        // Far beyond what any area allows for.
        const MOST: f64 = 1e6;
        self.widening = (self.widening * WIDEN).min(MOST);
    }

    /// The target was found again: how it moved before tells nothing.
    pub(super) fn restart(&mut self) {
        self.steps.clear();
        self.widening = 1.0;
    }

    /// The mean of the last steps, in pixels a frame period.
    pub(super) fn velocity(&self) -> [f64; 2] {
        let count = self.steps.len().max(1) as f64;
        // From a zero without a sign: the sum of nothing is -0.
        [0, 1].map(|axis| self.steps.iter().fold(0.0, |sum, step| sum + step[axis]) / count)
    }
}

/// What a state may be: the centre is within the image and within the area of a search around the last place; the box
/// is not smaller than what can be followed, nor larger than the image.
pub(super) fn bounds(frame: &Frame, size: [f64; 2], last: &Place, modes: &EtepfModes) -> Bounds<3> {
    let image = frame.bounds();
    let area = Rect::around([last[0], last[1]], size.map(|side| side * last[2] * modes.extent));
    let least = (MIN_TARGET_SIDE / size[0].min(size[1])).min(1.0);
    let most = (image.w / size[0]).min(image.h / size[1]).max(1.0);
    Bounds {
        low: Place::from([area.x.max(0.0), area.y.max(0.0), least]),
        high: Place::from([(area.x + area.w).min(image.w), (area.y + area.h).min(image.h), most]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Encoding;
    use crate::params::Params;

    const SIZE: [f64; 2] = [20.0, 40.0];

    fn noise(motion: &ParticleMotion, dt: f64) -> [f64; 3] {
        let params = Params::default().etepf;
        motion.noise(SIZE, dt, &params.particles, &params.modes).into()
    }

    #[test]
    fn the_noise_follows_the_latest_steps_down_to_the_floor() {
        let EtepfParticles { least_noise, scale_noise, .. } = Params::default().etepf.particles;
        let mut motion = ParticleMotion::new();
        assert_eq!(noise(&motion, 1.0), [least_noise, least_noise, scale_noise]);
        // Frames that were skipped: 30 px over three periods are 10 a period.
        (0..HISTORY).for_each(|_| motion.moved([30.0, -3.0], 3.0));
        assert_eq!(noise(&motion, 1.0), [10.0, least_noise, scale_noise]);
        assert_eq!(noise(&motion, 2.0)[0], 20.0);
        assert_eq!(motion.velocity(), [10.0, -1.0]);
        // Half of the steps: the root of the mean square.
        motion.moved([20.0, 0.0], 1.0);
        let want = ((100.0 * (HISTORY - 1) as f64 + 400.0) / HISTORY as f64).sqrt();
        assert!((noise(&motion, 1.0)[0] - want).abs() < 1e-12);
        (0..HISTORY).for_each(|_| motion.moved([0.0, 0.0], 1.0));
        assert_eq!(noise(&motion, 1.0)[0], least_noise, "what is older is forgotten");
    }

    #[test]
    fn the_latest_steps_are_kept() {
        let mut motion = ParticleMotion::new();
        assert!(motion.velocity().iter().all(|v| *v == 0.0 && v.is_sign_positive()));
        (1..=7).for_each(|n| motion.moved([f64::from(n), 0.0], 1.0));
        assert_eq!(motion.velocity()[0], f64::from(3 + 4 + 5 + 6 + 7) / 5.0);
    }

    #[test]
    fn a_search_widens_up_to_its_area_and_ends_when_the_target_is_found() {
        let modes = Params::default().etepf.modes;
        let mut motion = ParticleMotion::new();
        let floor = noise(&motion, 1.0)[0];
        motion.missed();
        assert!((noise(&motion, 1.0)[0] - floor * WIDEN).abs() < 1e-12);
        (0..5000).for_each(|_| motion.missed());
        assert_eq!(noise(&motion, 1.0)[..2], SIZE.map(|side| modes.extent * side / DEVIATIONS));
        motion.restart();
        assert_eq!(noise(&motion, 1.0)[0], floor);
    }

    #[test]
    fn a_state_stays_in_the_image_and_of_a_size_that_can_be_followed() {
        let data = vec![0; 100 * 60];
        let frame = Frame::new(&data, 100, 60, 100, Encoding::Mono8, None).unwrap();
        let modes = EtepfModes { extent: 2.0, ..Params::default().etepf.modes };
        let nearest = |last: [f64; 3], place: [f64; 3]| -> [f64; 3] {
            bounds(&frame, SIZE, &last.into(), &modes).nearest(&place.into()).into()
        };
        assert_eq!(nearest([50.0, 30.0, 1.0], [55.0, 40.0, 1.1]), [55.0, 40.0, 1.1]);
        assert_eq!(nearest([50.0, 30.0, 1.0], [95.0, 90.0, 9.0]), [70.0, 60.0, 1.5], "two sizes around the last place");
        assert_eq!(nearest([95.0, 30.0, 1.0], [150.0, -90.0, 0.0]), [100.0, 0.0, 0.2]);
    }
}
