//! What the camera does (MAPTrack, section 3.1): corners of a reference picture are followed through all that come, and
//! the motion that most of them share is the camera's.
//!
//! Corners are looked for in each picture where the last motion puts them, turned as it says, and always compared with
//! the reference itself, so that errors do not add up. When too few are left in view or look as they did, the current
//! picture becomes the reference, and what is found from then on goes on from its own motion.

use super::camera::CameraMotion;
use super::corners::CornerFinder;
use super::mode::{Mode, Pair, mode};
use super::optical_flow::{self, Pyramid, Windows};
use crate::crop::Patch;

/// Corners of a reference, at most.
const CORNERS: usize = 150;
/// A corner is found where no more than this share of its window's variance is left as difference.
const RESIDUAL: f64 = 0.3;
/// So many corners must agree on a motion, and this share of those found.
const LEAST_MEMBERS: usize = 8;
const LEAST_SHARE: f64 = 0.3;
/// A new reference is taken when fewer than this share of its corners agree.
const WORN: f64 = 0.5;
/// A new reference is taken, too, after so many pictures in a row without a motion.
const PATIENCE: usize = 10;

/// Follows the camera's motion.
#[derive(Clone, Debug, Default)]
pub struct Stabiliser {
    /// Width and height.
    size: [usize; 2],
    corners: CornerFinder,
    places: Vec<[f64; 2]>,
    windows: Windows,
    pyramid: Pyramid,
    pairs: Vec<Pair>,
    /// From the windows' picture to the first one; `None` before that.
    base: Option<CameraMotion>,
    /// From the last picture to the windows', as far as known.
    last: Option<CameraMotion>,
    /// Pictures in a row without a motion.
    failures: usize,
}

impl Stabiliser {
    /// Forgets all pictures.
    pub fn clear(&mut self) {
        self.base = None;
    }

    /// The motion from a picture to the first one since the start; `None` where too few corners agree. Of several
    /// planes, the middle one is looked at (green). A picture of another size is a first one.
    pub fn step(&mut self, picture: &Patch) -> Option<CameraMotion> {
        let size = [picture.width, picture.height];
        let plane = &picture.planes()[picture.planes().len() / 2];
        self.pyramid.build(plane, picture.width);
        let (Some(base), true) = (self.base, size == self.size) else {
            self.size = size;
            let still = CameraMotion::none(picture.width, picture.height);
            self.refer(plane, still);
            return Some(still);
        };
        let last = self.last.unwrap_or(CameraMotion::none(picture.width, picture.height));
        self.follow(&last);
        let Mode { motion, members } = mode(&self.pairs, &last);
        let agreed = members >= LEAST_MEMBERS && members as f64 >= LEAST_SHARE * self.pairs.len() as f64;
        if !agreed {
            self.failures += 1;
            if self.failures >= PATIENCE {
                self.refer(plane, last.then(&base));
            }
            return None;
        }
        self.failures = 0;
        self.last = Some(motion);
        let total = motion.then(&base);
        if (members as f64) < WORN * self.windows.places().len() as f64 {
            self.refer(plane, total);
        }
        Some(total)
    }

    /// Makes the current picture the reference; its own motion is known.
    fn refer(&mut self, plane: &[u8], motion: CameraMotion) {
        let [width, height] = self.size;
        // Corners spread evenly would be so far apart; half of that lets the better places have more.
        let distance = 0.5 * (plane.len() as f64 / CORNERS as f64).sqrt();
        let margin = optical_flow::RADIUS + 2;
        self.corners.find(plane, width, margin, CORNERS, distance, &mut self.places);
        self.windows.take(&self.pyramid, &self.places);
        self.base = Some(motion);
        self.last = Some(CameraMotion::none(width, height));
        self.failures = 0;
    }

    /// Finds the corners in the current picture.
    fn follow(&mut self, last: &CameraMotion) {
        self.pairs.clear();
        let there = last.inverse();
        for (i, place) in self.windows.places().iter().enumerate() {
            let found = self.windows.find(i, &self.pyramid, there.apply(*place), there.angle);
            if let Some(found) = found.filter(|found| found.residual <= RESIDUAL) {
                self.pairs.push(Pair { from: found.place, to: *place });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::crop::Cropper;
    use crate::frame::{Encoding, Frame};

    /// What the virtual camera sees: smaller than the pictures that it looks at.
    const WIDTH: usize = 320;
    const HEIGHT: usize = 200;

    /// Pictures of a real street with people who walk, grey, row-major; the clip goes forth and back.
    fn clip() -> Vec<(usize, Vec<u8>)> {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/demo/img");
        let read = |i: usize| {
            let image = image::open(folder.join(format!("{i:03}.jpg"))).unwrap().to_luma8();
            (image.width() as usize, image.into_raw())
        };
        let once: Vec<_> = (0..100).map(read).collect();
        let back = once.iter().rev().skip(1).cloned();
        once.iter().cloned().chain(back).collect()
    }

    /// The part of a picture that the camera sees, pixel by pixel, interpolated linearly; beyond it the picture is
    /// mirrored. `view` takes places of the camera to those of its first view.
    fn look((width, data): &(usize, Vec<u8>), view: &CameraMotion) -> Patch {
        let height = data.len() / width;
        let corner = [(width - WIDTH) as f64 / 2.0, (height - HEIGHT) as f64 / 2.0];
        let mirrored = |v: i64, n: usize| {
            let v = v.rem_euclid(2 * n as i64) as usize;
            if v < n { v } else { 2 * n - 1 - v }
        };
        let at = |x: i64, y: i64| f64::from(data[mirrored(y, height) * width + mirrored(x, *width)]);
        let pixel = |i: usize| {
            let place = view.apply([(i % WIDTH) as f64 + 0.5, (i / WIDTH) as f64 + 0.5]);
            let [x, y] = [place[0] + corner[0] - 0.5, place[1] + corner[1] - 0.5];
            let (u, v) = (x.floor() as i64, y.floor() as i64);
            let (a, b) = (x - x.floor(), y - y.floor());
            let up = at(u, v) * (1.0 - a) + at(u + 1, v) * a;
            let down = at(u, v + 1) * (1.0 - a) + at(u + 1, v + 1) * a;
            (up * (1.0 - b) + down * b).round() as u8
        };
        let seen: Vec<u8> = (0..WIDTH * HEIGHT).map(pixel).collect();
        patch(&seen)
    }

    fn patch(data: &[u8]) -> Patch {
        let frame = Frame::new(data, WIDTH as u32, HEIGHT as u32, WIDTH, Encoding::Mono8, None).unwrap();
        let mut patch = Patch::default();
        Cropper::default().crop(&frame, &frame.bounds(), WIDTH, HEIGHT, &mut patch);
        patch
    }

    /// The largest errors over views: in pixels, in degrees. Each picture must have a motion.
    fn errors(views: &[CameraMotion], pictures: &[(usize, Vec<u8>)]) -> [f64; 2] {
        let mut stabiliser = Stabiliser::default();
        let mut worst = [0.0f64; 2];
        for (i, view) in views.iter().enumerate() {
            let motion = stabiliser.step(&look(&pictures[i % pictures.len()], view));
            let motion = motion.unwrap_or_else(|| panic!("no motion in picture {i}"));
            let off = (motion.shift[0] - view.shift[0]).hypot(motion.shift[1] - view.shift[1]);
            worst = [worst[0].max(off), worst[1].max((motion.angle - view.angle).to_degrees().abs())];
        }
        worst
    }

    fn still() -> CameraMotion {
        CameraMotion::none(WIDTH, HEIGHT)
    }

    /// What is asked of a motion.
    const PIXELS: f64 = 0.5;
    const DEGREES: f64 = 0.2;

    #[test]
    fn a_camera_that_shakes_pans_and_rotates_is_followed_for_300_pictures() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let view = |i: usize| {
            let t = i as f64;
            let mut shake = |size: f64| if i == 0 { 0.0 } else { rng.random_range(-size..size) };
            let [x, y, turn] = [shake(6.0), shake(6.0), shake(0.5)];
            let shift = [90.0 * (t / 60.0).sin() + x, 40.0 * (t / 37.0).sin() + y];
            CameraMotion { angle: (4.0 * (t / 45.0).sin() + turn).to_radians(), shift, ..still() }
        };
        let views: Vec<CameraMotion> = (0..300).map(view).collect();
        let [pixels, degrees] = errors(&views, &clip());
        assert!(pixels < PIXELS && degrees < DEGREES, "{pixels} px, {degrees} degrees");
    }

    #[test]
    fn a_long_pan_leaves_the_reference_without_losing_count() {
        let view = |i: usize| CameraMotion { shift: [9.0 * i as f64, -1.5 * i as f64], ..still() };
        let views: Vec<CameraMotion> = (0..120).map(view).collect();
        let [pixels, degrees] = errors(&views, &clip()[..1]);
        assert!(pixels < PIXELS && degrees < DEGREES, "{pixels} px, {degrees} degrees");
    }

    #[test]
    fn where_too_little_agrees_it_says_so_and_then_starts_again() {
        let clip = clip();
        let mut stabiliser = Stabiliser::default();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut noise = || patch(&(0..WIDTH * HEIGHT).map(|_| rng.random()).collect::<Vec<u8>>());
        let moved = CameraMotion { shift: [5.0, 3.0], ..still() };
        assert_eq!(stabiliser.step(&look(&clip[0], &still())), Some(still()));
        assert!(stabiliser.step(&look(&clip[1], &moved)).is_some());
        for _ in 0..3 {
            assert_eq!(stabiliser.step(&noise()), None);
        }
        let again = stabiliser.step(&look(&clip[2], &moved)).expect("the reference is kept for a while");
        assert!((again.shift[0] - 5.0).abs() < PIXELS, "{again:?}");
        for _ in 0..PATIENCE {
            assert_eq!(stabiliser.step(&patch(&vec![90; WIDTH * HEIGHT])), None);
        }
        assert_eq!(stabiliser.step(&look(&clip[3], &still())), None, "the blank is the reference now");
        stabiliser.clear();
        assert_eq!(stabiliser.step(&look(&clip[3], &moved)), Some(still()), "a first picture");
    }
}
