use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::crop::Cropper;
use crate::frame::{Encoding, Frame};

fn patch(data: &[u8], width: usize, height: usize, encoding: Encoding) -> Patch {
    let step = width * encoding.bytes();
    let frame = Frame::new(data, width as u32, height as u32, step, encoding, None).unwrap();
    let mut patch = Patch::default();
    Cropper::default().crop(&frame, &frame.bounds(), width, height, &mut patch);
    patch
}

/// One pixel by the textbook: Gaussians in a sorted list, in double precision.
#[derive(Default)]
struct Pixel {
    frames: usize,
    /// Weight, mean, variance.
    gaussians: Vec<(f64, [f64; 3], f64)>,
}

impl Pixel {
    fn apply(&mut self, colour: [f64; 3], planes: usize, s: &BackgroundSettings) -> bool {
        let mean_square = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>() / 3.0;
        self.frames += 1;
        let rate = 1.0 / self.frames.min(s.window) as f64;
        let fits = |d: f64, variance: f64| d.sqrt() <= s.deviations * variance.sqrt();
        let found = self.gaussians.iter().position(|g| fits(mean_square(g.1, colour), g.2));
        self.gaussians.iter_mut().for_each(|g| g.0 *= 1.0 - rate);
        let mark = match found {
            Some(at) => {
                let g = &mut self.gaussians[at];
                g.0 += rate;
                let speed = rate / g.0;
                let d = mean_square(g.1, colour);
                g.2 = (g.2 + speed * (d - g.2)).max(s.least_deviation.powi(2));
                (0..3).for_each(|i| g.1[i] += speed * (colour[i] - g.1[i]));
                *g
            }
            None => {
                self.gaussians.truncate(s.gaussians - 1);
                self.gaussians.push((rate, colour, s.initial_deviation.powi(2)));
                *self.gaussians.last().unwrap()
            }
        };
        let sum: f64 = self.gaussians.iter().map(|g| g.0).sum();
        self.gaussians.iter_mut().for_each(|g| g.0 /= sum);
        self.gaussians.sort_by(|a, b| (b.0 / b.2.sqrt()).total_cmp(&(a.0 / a.2.sqrt())));
        let mut weights = 0.0;
        let count = self.gaussians.iter().position(|g| {
            weights += g.0;
            weights > s.share
        });
        let background = &self.gaussians[..count.unwrap() + 1];
        if background.iter().any(|g| g.1 == mark.1 && g.2 == mark.2) {
            return false;
        }
        let shadow = |g: &(f64, [f64; 3], f64)| {
            let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
            let a = dot(g.1, colour) / dot(g.1, g.1);
            a > s.shadow && a < 1.0 && fits(mean_square(g.1.map(|v| a * v), colour), g.2)
        };
        planes == 1 || !background.iter().any(shadow)
    }
}

const QUIET: usize = 20;

/// A noisy street for longer than the window, so that no two Gaussians ever tie; then two that take turns, visitors and
/// shadows.
fn scene(rng: &mut ChaCha8Rng, base: &[[u8; 3]], pixel: usize, frame: usize) -> [u8; 3] {
    let noise = rng.random_range(-6i32..=6);
    let kind = if frame < QUIET { 19 } else { rng.random_range(0..20) };
    let other = rng.random_range(0..255);
    let colour = base[pixel].map(|v| match kind {
        0 => other,
        1 | 2 => i32::from(v) * 3 / 4,
        3..=8 => i32::from(v) + 40,
        _ => i32::from(v),
    });
    std::array::from_fn(|i| (colour[i] + noise + rng.random_range(-2i32..=2)).clamp(0, 255) as u8)
}

#[test]
fn every_pixel_agrees_with_the_textbook() {
    let (width, height) = (13, 7);
    for (gaussians, window, shadow, encoding) in [
        (4, 15, 0.6, Encoding::Rgb8),
        (2, 12, 1.0, Encoding::Rgb8),
        (3, 18, 0.4, Encoding::Bgr8),
        (5, 19, 0.6, Encoding::Mono8),
    ] {
        // Numbers that differences of intensities and counts never make exactly.
        let settings =
            BackgroundSettings { gaussians, window, shadow, share: 0.7012, deviations: 2.4142, ..Default::default() };
        let mut rng = ChaCha8Rng::seed_from_u64(gaussians as u64);
        let base: Vec<[u8; 3]> =
            (0..width * height).map(|_| std::array::from_fn(|_| rng.random_range(30..200))).collect();
        let mut background = Background::new(settings.clone());
        let mut pixels: Vec<Pixel> = (0..width * height).map(|_| Pixel::default()).collect();
        let (mut mask, mut seen) = (Vec::new(), [0, 0]);
        for frame in 0..80 {
            let bytes = encoding.bytes();
            let data: Vec<u8> =
                (0..width * height).flat_map(|i| scene(&mut rng, &base, i, frame)[..bytes].to_vec()).collect();
            let patch = patch(&data, width, height, encoding);
            background.apply(&patch, &mut mask);
            for (i, pixel) in pixels.iter_mut().enumerate() {
                let colour = patch.rgb(i % width, i / width).map(f64::from);
                let moving = pixel.apply(colour, patch.planes().len(), &settings);
                assert_eq!(
                    mask[i] != 0,
                    moving,
                    "{gaussians} Gaussians, frame {frame}, pixel {i}: {:?}",
                    pixel.gaussians
                );
                seen[usize::from(moving)] += 1;
            }
        }
        assert!(seen[0] > 1000 && seen[1] > 200, "both kinds must come up: {seen:?}");
    }
}

const SIDE: usize = 20;

fn flat(colour: [u8; 3]) -> Patch {
    let data: Vec<u8> = (0..SIDE * SIDE).flat_map(|_| colour).collect();
    patch(&data, SIDE, SIDE, Encoding::Rgb8)
}

/// The share of foreground in a patch.
fn share(background: &mut Background, patch: &Patch) -> f64 {
    let mut mask = Vec::new();
    background.apply(patch, &mut mask);
    assert_eq!(mask.len(), patch.width * patch.height);
    mask.iter().map(|m| f64::from(*m)).sum::<f64>() / mask.len() as f64
}

#[test]
fn what_comes_is_foreground_until_it_has_stayed() {
    let (street, van) = (flat([90, 100, 110]), flat([30, 120, 60]));
    let settings = BackgroundSettings { window: 50, ..Default::default() };
    let mut background = Background::new(settings);
    assert_eq!((0..60).map(|_| share(&mut background, &street)).sum::<f64>(), 0.0, "from the first frame on");
    let stays = (0..).take_while(|_| share(&mut background, &van) == 1.0).count();
    // Its weight exceeds 1 - T after ln T / ln (1 - 1 / L) frames.
    assert!((16..=19).contains(&stays), "{stays}");
    assert_eq!(share(&mut background, &street), 0.0, "the street is still known");
    assert_eq!(share(&mut background, &flat([200, 10, 10])), 1.0);
}

#[test]
fn a_shadow_is_darker_and_of_the_same_colour() {
    let mut background = Background::new(BackgroundSettings { shadow: 0.5, ..Default::default() });
    (0..50).for_each(|_| {
        share(&mut background, &flat([100, 150, 200]));
    });
    assert_eq!(share(&mut background, &flat([70, 105, 140])), 0.0);
    assert_eq!(share(&mut background, &flat([40, 60, 80])), 1.0, "too dark");
    assert_eq!(share(&mut background, &flat([130, 195, 255])), 1.0, "a light is none");
    assert_eq!(share(&mut background, &flat([140, 105, 70])), 1.0, "of another colour");
}

#[test]
fn what_was_learned_moves_along_and_what_comes_in_is_new() {
    let (width, height) = (37, 11);
    let value = |x: i64, y: i64| [(x * 7 + 100) as u8, (y * 11 + 90) as u8, 60];
    // The window's first pixel lies at (left, top) of the scene.
    let window = |left: i64, top: i64| {
        let pixels = (0..width * height).flat_map(|i| value(i % width + left, i / width + top));
        patch(&pixels.collect::<Vec<u8>>(), width as usize, height as usize, Encoding::Rgb8)
    };
    for (right, down) in [(3, 0), (-5, 2), (0, -4), (9, 10), (-40, 0), (0, 0)] {
        let mut background = Background::new(BackgroundSettings::default());
        (0..30).for_each(|_| assert_eq!(share(&mut background, &window(0, 0)), 0.0));
        background.shift(right, down);
        assert_eq!(share(&mut background, &window(-right, -down)), 0.0, "{right} {down}");
        // Where it is known, something else is foreground; what has come in has been seen once.
        assert_eq!(share(&mut background, &flat_of(width, height, [250, 0, 250])), 1.0, "{right} {down}");
        background.shift(right, down);
        let known = (width - 2 * right.abs()).max(0) * (height - 2 * down.abs()).max(0);
        let moved = share(&mut background, &window(0, 0)) * (width * height) as f64;
        if right != 0 || down != 0 {
            assert!(moved >= known as f64 * 0.9, "{right} {down}: {moved} of {known} moved");
        }
    }
}

fn flat_of(width: i64, height: i64, colour: [u8; 3]) -> Patch {
    let data: Vec<u8> = (0..width * height).flat_map(|_| colour).collect();
    patch(&data, width as usize, height as usize, Encoding::Rgb8)
}

#[test]
fn a_patch_of_another_shape_begins_anew() {
    let mut background = Background::new(BackgroundSettings::default());
    (0..20).for_each(|_| {
        share(&mut background, &flat([100, 150, 200]));
    });
    let grey = patch(&[9; SIDE * SIDE], SIDE, SIDE, Encoding::Mono8);
    assert_eq!(share(&mut background, &grey), 0.0);
    assert_eq!(background.frames(), 1);
    background.clear();
    assert_eq!(share(&mut background, &patch(&[200; SIDE * SIDE], SIDE, SIDE, Encoding::Mono8)), 0.0);
}
