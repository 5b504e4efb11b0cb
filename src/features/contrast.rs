//! Whether a picture shows anything that could be followed.
//!
//! A wall, a lens cap or a clear sky tell one place from no other: what answers there answers anywhere, and a box would
//! creep. What counts is how much the intensities vary in and around a target in a way that fixes a place in both
//! directions. So what varies along one axis alone is taken out, as shades and the edges of long things do, and so is a
//! slope.

use crate::crop::{Cropper, Patch};
use crate::frame::Frame;
use crate::geometry::Rect;

/// Contrast, in levels of 8 bits, below which nothing can be followed. Noise of two levels up and down, as JPEG leaves
/// it on a plain wall, has 1.4 at most; where targets are in real sequences, infrared ones and ones from the air among
/// them, it is above 10.
pub const LEAST_CONTRAST: f64 = 2.0;
/// Side of the area that is looked at around a target, in target sizes: one of a single colour shows against what is
/// around it.
pub const AROUND: f64 = 2.0;
/// Samples along a side of what is looked at, at most: twelve along a target, as many as it has cells in the default
/// filter. Each is a mean, in which the noise of pixels is evened out.
const SAMPLES: usize = 24;

/// How much a target and its surroundings vary: the standard deviation of the intensities, in levels of 8 bits, of the
/// colour channel that shows most.
pub fn contrast(frame: &Frame, target: &Rect) -> f64 {
    let mut patch = Patch::default();
    Cropper::default().crop(frame, &target.scaled(AROUND), SAMPLES, SAMPLES, &mut patch);
    let whole = Tile { left: 0, top: 0, width: SAMPLES, height: SAMPLES };
    patch.planes().iter().map(|plane| whole.contrast(plane, SAMPLES)).fold(0.0, f64::max)
}

/// Whether a patch shows anything in it that could be followed, where [`AROUND`] times a target's size is `tile`, width
/// and height in pixels of the patch. A small thing in a wide plain area counts.
pub fn shows_anything(patch: &Patch, tile: [usize; 2]) -> bool {
    let [width, height] = [tile[0].clamp(1, patch.width), tile[1].clamp(1, patch.height)];
    // The middle first: mostly something is there, and that is all the work.
    let middle = Tile { left: (patch.width - width) / 2, top: (patch.height - height) / 2, width, height };
    let others = starts(patch.height, height)
        .flat_map(|top| starts(patch.width, width).map(move |left| Tile { left, top, width, height }));
    std::iter::once(middle)
        .chain(others)
        .any(|tile| patch.planes().iter().any(|plane| tile.contrast(plane, patch.width) >= LEAST_CONTRAST))
}

/// Where tiles of a length begin that cover a side, each overlapping the next by half at least.
fn starts(side: usize, tile: usize) -> impl Iterator<Item = usize> {
    let steps = (2 * (side - tile)).div_ceil(tile).max(1);
    (0..=steps).map(move |i| i * (side - tile) / steps)
}

/// A part of a plane.
#[derive(Clone, Copy, Debug)]
struct Tile {
    left: usize,
    top: usize,
    width: usize,
    height: usize,
}

impl Tile {
    /// The standard deviation of a plane's values in this tile, means over [`SAMPLES`] parts of a side, without a slope
    /// and what varies along one axis alone; of both axes, that which leaves less.
    fn contrast(&self, plane: &[u8], stride: usize) -> f64 {
        let [across, down] = [self.width, self.height].map(|side| side.div_ceil(SAMPLES));
        let [m, n] = [self.width / across, self.height / down];
        let (mut rows, mut columns) = ([0.0; SAMPLES], [0.0; SAMPLES]);
        let (rows, columns) = (&mut rows[..n], &mut columns[..m]);
        let mut squares = 0.0;
        for (y, row) in rows.iter_mut().enumerate() {
            let mut sums = [0u32; SAMPLES];
            for line in plane.chunks(stride).skip(self.top + y * down).take(down) {
                let blocks = line[self.left..].chunks(across);
                sums.iter_mut().zip(blocks).take(m).for_each(|(sum, values)| {
                    *sum += values.iter().map(|&v| u32::from(v)).sum::<u32>();
                });
            }
            for (column, sum) in columns.iter_mut().zip(sums) {
                let value = f64::from(sum) / (across * down) as f64;
                *column += value;
                *row += value;
                squares += value * value;
            }
        }
        let count = (m * n) as f64;
        let mean = rows.iter().sum::<f64>() / count;
        let variance = squares / count - mean * mean;
        // Of the means of columns and of rows: their variance, and that of the slope among them.
        let [(by_columns, slope_across), (by_rows, slope_down)] =
            [(&*columns, n), (&*rows, m)].map(|(sums, length)| {
                let middle = (sums.len() as f64 - 1.0) / 2.0;
                let (mut spread, mut along, mut width) = (0.0, 0.0, 0.0);
                for (i, sum) in sums.iter().enumerate() {
                    let (value, place) = (sum / length as f64 - mean, i as f64 - middle);
                    (spread, along, width) = (spread + value * value, along + place * value, width + place * place);
                }
                let count = sums.len() as f64;
                (spread / count, if width > 0.0 { along * along / width / count } else { 0.0 })
            });
        let left = (variance - by_columns - slope_down).min(variance - by_rows - slope_across);
        left.max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Encoding;

    const SIDE: usize = 160;
    const TARGET: Rect = Rect::new(60.0, 50.0, 40.0, 60.0);

    fn grey(pixel: impl Fn(usize, usize) -> f64) -> f64 {
        let data: Vec<u8> = (0..SIDE * SIDE).map(|i| pixel(i % SIDE, i / SIDE).round() as u8).collect();
        contrast(&Frame::new(&data, SIDE as u32, SIDE as u32, SIDE, Encoding::Mono8, None).unwrap(), &TARGET)
    }

    /// Noise of so many levels up and down.
    fn noise(x: usize, y: usize, levels: usize) -> f64 {
        let mut v = (x as u32).wrapping_mul(374_761_393) ^ (y as u32).wrapping_mul(668_265_263);
        v = (v ^ (v >> 13)).wrapping_mul(1_274_126_177);
        ((v >> 16) as usize % (2 * levels + 1)) as f64 - levels as f64
    }

    #[test]
    fn nothing_varies_enough_in_plain_and_noisy_pictures_and_on_slopes() {
        for value in [0.0, 90.0, 255.0] {
            assert_eq!(grey(|_, _| value), 0.0);
        }
        for levels in [1, 2, 3, 6] {
            let got = grey(|x, y| 100.0 + noise(x, y, levels));
            assert!(got < LEAST_CONTRAST, "{levels}: {got}");
        }
        assert!(grey(|x, _| x as f64) < 1.0);
        assert!(grey(|x, y| (x + y) as f64 / 2.0) < 1.0, "aslant");
    }

    #[test]
    fn what_varies_along_one_axis_alone_fixes_no_place() {
        let stripes = |v: usize| 120.0 + 100.0 * (v as f64 / 5.0).sin();
        assert!(grey(|x, _| stripes(x)) < 0.5 && grey(|_, y| stripes(y)) < 0.5);
        assert!(grey(|x, y| (stripes(x) + stripes(y)) / 2.0) > 10.0, "both together do");
        assert!(grey(|x, y| stripes(x) * stripes(y) / 255.0) > 10.0);
    }

    #[test]
    fn a_target_of_a_single_colour_shows_against_what_is_around_it() {
        let inside = |x: usize, y: usize| (60..100).contains(&x) && (50..110).contains(&y);
        assert!(grey(|x, y| if inside(x, y) { 108.0 } else { 100.0 }) > LEAST_CONTRAST, "eight levels");
        assert!(grey(|x, y| if inside(x, y) { 103.0 } else { 100.0 }) < LEAST_CONTRAST, "three");
        // Red and green of the same brightness.
        let pixel = |i: usize| if inside(i % SIDE, i / SIDE) { [200, 60, 90] } else { [90, 116, 90] };
        let data: Vec<u8> = (0..SIDE * SIDE).flat_map(pixel).collect();
        let frame = Frame::new(&data, SIDE as u32, SIDE as u32, 3 * SIDE, Encoding::Rgb8, None).unwrap();
        assert!(contrast(&frame, &TARGET) > 10.0);
    }

    /// The same by its definition: planes and means are fitted and taken away, one after the other.
    #[test]
    fn the_contrast_is_what_is_left_without_a_slope_and_the_means_of_an_axis() {
        let (w, h) = (13, 9);
        let data: Vec<u8> = (0..w * h).map(|i| (i * i * 7 % 97 + i % w * 5 + i / w * 3) as u8).collect();
        let tile = Tile { left: 0, top: 0, width: w, height: h };
        let mean = |of: &dyn Fn(usize) -> f64, n: usize| (0..n).map(of).sum::<f64>() / n as f64;
        let [middle_x, middle_y] = [w, h].map(|side| (side as f64 - 1.0) / 2.0);
        let whole = mean(&|i| f64::from(data[i]), w * h);
        let slope = |place: &dyn Fn(usize) -> f64| {
            let product = (0..w * h).map(|i| place(i) * f64::from(data[i])).sum::<f64>();
            product / (0..w * h).map(|i| place(i).powi(2)).sum::<f64>()
        };
        let (x, y) = (|i: usize| (i % w) as f64 - middle_x, |i: usize| (i / w) as f64 - middle_y);
        let (a, b) = (slope(&x), slope(&y));
        let flat: Vec<f64> = (0..w * h).map(|i| f64::from(data[i]) - whole - a * x(i) - b * y(i)).collect();
        let without = |group: &dyn Fn(usize) -> usize, members: usize| {
            let sum = |g: usize| (0..w * h).filter(|&i| group(i) == g).map(|i| flat[i]).sum::<f64>();
            mean(&|i| (flat[i] - sum(group(i)) / members as f64).powi(2), w * h).sqrt()
        };
        let wanted = without(&|i| i % w, h).min(without(&|i| i / w, w));
        assert!((tile.contrast(&data, w) - wanted).abs() < 1e-9, "{} {wanted}", tile.contrast(&data, w));
    }

    #[test]
    fn a_small_thing_in_a_wide_plain_area_is_seen_wherever_it_is() {
        let data = vec![50; SIDE * SIDE];
        let shows = |data: &[u8]| {
            let frame = Frame::new(data, SIDE as u32, SIDE as u32, SIDE, Encoding::Mono8, None).unwrap();
            let mut patch = Patch::default();
            Cropper::default().crop(&frame, &frame.bounds(), SIDE, SIDE, &mut patch);
            shows_anything(&patch, [SIDE / 2; 2])
        };
        assert!(!shows(&data));
        for (left, top) in [(0, 0), (70, 70), (120, 0), (40, 120), (120, 120)] {
            let mut data = data.clone();
            (0..40 * 40).for_each(|i| data[(top + i / 40) * SIDE + left + i % 40] = 70);
            assert!(shows(&data), "{left} {top}");
        }
    }
}
