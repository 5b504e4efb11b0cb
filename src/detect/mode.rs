//! The most common motion of many places (MAPTrack, section 3.1, step 3): for each of some angles the translations of
//! all places are counted in bins; the angle whose fullest bins in x and in y hold most is the mode. Around it, angles
//! and bins are made finer and counted again. The places in the last bins are the background; their least-squares
//! motion is finer than any bin.

use super::camera::CameraMotion;
use crate::geometry::turned;

/// A place of the current picture and the same one in the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// In the current picture.
    pub from: [f64; 2],
    /// In the reference.
    pub to: [f64; 2],
}

/// Bins in x, and as many in y.
const BINS: usize = 64;
/// Angles on each side of the middle one.
const ANGLES: i32 = 8;
/// Width of the bins at first and at last, in pixels; each time they are halved.
const COARSE: f64 = 4.0;
const FINE: f64 = 0.5;
/// Rounds of least squares over the places that agree.
const ROUNDS: usize = 3;

/// The mode, and how many places agree with it to about half a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode {
    /// The motion from the current picture to the reference.
    pub motion: CameraMotion,
    /// Places that agree.
    pub members: usize,
}

/// The mode of the motions of pairs. It is looked for within some 100 pixels and 4 degrees (for a picture of 768 x 576;
/// the smaller the picture, the more) of a first guess.
pub fn mode(pairs: &[Pair], guess: &CameraMotion) -> Mode {
    let mut best = *guess;
    // An angle's step moves the corners by a bin.
    let radius = guess.centre[0].hypot(guess.centre[1]);
    let mut width = COARSE;
    while width >= FINE {
        best = narrow(pairs, &best, width, width / radius);
        width /= 2.0;
    }
    refine(pairs, best)
}

/// The fullest bins of this width around a motion.
fn narrow(pairs: &[Pair], around: &CameraMotion, width: f64, step: f64) -> CameraMotion {
    let (mut best, mut most) = (*around, 0);
    // From the middle out: of equals, the nearest counts.
    for k in (0..=2 * ANGLES).map(|k| if k % 2 == 0 { k / 2 } else { -(k + 1) / 2 }) {
        let angle = around.angle + f64::from(k) * step;
        let mut bins = [[0u32; BINS]; 2];
        for pair in pairs {
            let shift = translation(pair, angle, around.centre);
            for (bins, (shift, middle)) in bins.iter_mut().zip(shift.into_iter().zip(around.shift)) {
                let bin = ((shift - middle) / width).floor() + (BINS / 2) as f64;
                if (0.0..BINS as f64).contains(&bin) {
                    bins[bin as usize] += 1;
                }
            }
        }
        // Neighbours count together, as a bin's edge may cut through the mode.
        let fullest = bins.map(|bins| {
            let sums = bins.array_windows().map(|[a, b]| a + b).enumerate();
            sums.fold((0, 0), |best, (at, sum)| if sum > best.1 { (at, sum) } else { best })
        });
        let count = fullest[0].1 + fullest[1].1;
        if count > most {
            most = count;
            let middle = |i: usize| around.shift[i] + (fullest[i].0 as f64 + 1.0 - (BINS / 2) as f64) * width;
            best = CameraMotion { angle, shift: [middle(0), middle(1)], ..*around };
        }
    }
    best
}

/// Where a pair's place went, but for a rotation.
fn translation(pair: &Pair, angle: f64, centre: [f64; 2]) -> [f64; 2] {
    let turned = turned([pair.from[0] - centre[0], pair.from[1] - centre[1]], angle);
    std::array::from_fn(|i| pair.to[i] - centre[i] - turned[i])
}

/// The least-squares motion of the pairs that agree.
fn refine(pairs: &[Pair], mut motion: CameraMotion) -> Mode {
    let mut members = 0;
    for round in 0..ROUNDS {
        // The angle is known to a step at first.
        let tolerance = if round == 0 { 2.0 * FINE } else { FINE };
        let agrees = |pair: &&Pair| {
            let there = motion.apply(pair.from);
            (there[0] - pair.to[0]).hypot(there[1] - pair.to[1]) <= tolerance
        };
        let agreeing = || pairs.iter().filter(agrees);
        members = agreeing().count();
        if members < 2 {
            break;
        }
        let mean = |place: fn(&Pair) -> [f64; 2]| {
            let sum = agreeing().map(place).fold([0.0; 2], |s, p| [s[0] + p[0], s[1] + p[1]]);
            sum.map(|v| v / members as f64)
        };
        let (from, to) = (mean(|p| p.from), mean(|p| p.to));
        let (mut dot, mut cross) = (0.0, 0.0);
        for pair in agreeing() {
            let a = [pair.from[0] - from[0], pair.from[1] - from[1]];
            let b = [pair.to[0] - to[0], pair.to[1] - to[1]];
            dot += a[0] * b[0] + a[1] * b[1];
            cross += a[0] * b[1] - a[1] * b[0];
        }
        let angle = cross.atan2(dot);
        let shift = translation(&Pair { from, to }, angle, motion.centre);
        motion = CameraMotion { angle, shift, ..motion };
    }
    Mode { motion, members }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Places of which a share moves with the camera, to about a tenth of a pixel, and the rest in two other ways.
    fn pairs(motion: &CameraMotion, share: f64, seed: u64) -> Vec<Pair> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let pair = |i: usize| {
            let from = [rng.random_range(0.0..768.0), rng.random_range(0.0..576.0)];
            let [x, y] = motion.apply(from);
            let noise = [rng.random_range(-0.1..0.1), rng.random_range(-0.1..0.1)];
            let own = match i {
                _ if (i as f64) < 100.0 * share => [0.0; 2],
                _ if i.is_multiple_of(2) => [9.0, 1.0],
                _ => [rng.random_range(-80.0..80.0), rng.random_range(-80.0..80.0)],
            };
            Pair { from, to: [x + noise[0] + own[0], y + noise[1] + own[1]] }
        };
        (0..100).map(pair).collect()
    }

    #[test]
    fn the_mode_is_the_cameras_motion_whatever_the_others_do() {
        let still = CameraMotion::none(768, 576);
        for (degrees, shift) in [(0.0, [0.0, 0.0]), (2.7, [31.0, -14.3]), (-3.3, [-60.2, 50.0]), (0.4, [0.5, 90.0])] {
            let camera = CameraMotion { angle: f64::to_radians(degrees), shift, ..still };
            for share in [1.0, 0.7, 0.5] {
                let Mode { motion, members } = mode(&pairs(&camera, share, 1), &still);
                let off = (motion.shift[0] - shift[0]).hypot(motion.shift[1] - shift[1]);
                let turned = (motion.angle - camera.angle).to_degrees().abs();
                assert!(off < 0.05 && turned < 0.02, "{degrees} {shift:?} {share}: {motion:?}");
                let want = 100.0 * share;
                assert!((want - 1.0..want + 8.0).contains(&(members as f64)), "{members} of {want}");
            }
        }
    }

    #[test]
    fn few_agree_where_there_is_no_motion_in_common() {
        let still = CameraMotion::none(768, 576);
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut place = || [rng.random_range(0.0..768.0), rng.random_range(0.0..576.0)];
        let pairs: Vec<Pair> = (0..100).map(|_| Pair { from: place(), to: place() }).collect();
        assert!(mode(&pairs, &still).members < 8);
        assert_eq!(mode(&[], &still), Mode { motion: still, members: 0 });
    }
}
