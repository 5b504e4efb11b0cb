//! CIE LUV colour and the normalised gradient magnitude: the features that the re-detector adds to HOG.

use std::sync::LazyLock;

use super::{CELL, FeatureMap};
use crate::crop::Patch;

/// Channels of [`Luv::compute`]: L, u, v and the normalised gradient magnitude.
pub const CHANNELS: usize = 4;

/// L, u* and v* are divided by this, so that each lies within about -1..1, as HOG does.
const SCALE: f32 = 1.0 / 100.0;
/// Chromaticity of the white point D65.
const WHITE_U: f32 = 0.197_839_82;
const WHITE_V: f32 = 0.468_336_3;
/// Below this relative luminance lightness is linear in it: (6/29)^3.
const LINEAR_BELOW: f32 = 0.008_856_452;
/// The slope of that part: (29/3)^3.
const LINEAR_SLOPE: f32 = 903.296_3;
/// Added to the mean magnitude before dividing, in intensities: a flat surround does not blow up noise.
const MAGNITUDE_FLOOR: f32 = 5.0;
/// Half side of the square, in cells, over whose mean a magnitude is normalised.
const SURROUND: usize = 2;

/// sRGB's inverse transfer function for 8-bit values.
static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        let v = i as f32 / 255.0;
        if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
    })
});

/// L*, u*, v* of an sRGB colour under D65, each divided by 100.
pub fn luv(rgb: [u8; 3]) -> [f32; 3] {
    let [r, g, b] = rgb.map(|v| LINEAR[usize::from(v)]);
    let x = 0.412_456_4 * r + 0.357_576_1 * g + 0.180_437_5 * b;
    let y = 0.212_672_9 * r + 0.715_152_2 * g + 0.072_175 * b;
    let z = 0.019_333_9 * r + 0.119_192 * g + 0.950_304_1 * b;
    let lightness = if y > LINEAR_BELOW { 116.0 * y.cbrt() - 16.0 } else { LINEAR_SLOPE * y };
    let sum = x + 15.0 * y + 3.0 * z;
    if sum <= 0.0 {
        return [0.0; 3];
    }
    let (u, v) = (4.0 * x / sum, 9.0 * y / sum);
    [lightness * SCALE, 13.0 * lightness * (u - WHITE_U) * SCALE, 13.0 * lightness * (v - WHITE_V) * SCALE]
}

/// Computes the map, with scratch that is reused from patch to patch.
#[derive(Debug, Default)]
pub struct Luv {
    /// Mean gradient magnitude of each cell.
    magnitude: Vec<f32>,
}

impl Luv {
    /// Fills `map` with four channels on a grid of [`CELL`]-pixel cells: the means of L, u and v, and the mean
    /// gradient magnitude divided by its mean over the surrounding 5 x 5 cells.
    pub fn compute(&mut self, patch: &Patch, map: &mut FeatureMap) {
        let (rows, cols) = (patch.height / CELL, patch.width / CELL);
        map.resize(rows, cols, CHANNELS);
        let cells = rows * cols;
        self.magnitude.clear();
        for row in 0..rows {
            for col in 0..cols {
                let mut rgb = [0u32; 3];
                let mut magnitude = 0.0;
                for y in row * CELL..(row + 1) * CELL {
                    for x in col * CELL..(col + 1) * CELL {
                        rgb.iter_mut().zip(patch.rgb(x, y)).for_each(|(s, v)| *s += u32::from(v));
                        magnitude += gradient_magnitude(patch, x, y);
                    }
                }
                let pixels = (CELL * CELL) as u32;
                let colour = luv(rgb.map(|s| ((s + pixels / 2) / pixels) as u8));
                for (channel, value) in colour.into_iter().enumerate() {
                    map.data[channel * cells + row * cols + col] = value;
                }
                self.magnitude.push(magnitude / pixels as f32);
            }
        }
        for row in 0..rows {
            for col in 0..cols {
                let at = row * cols + col;
                map.data[3 * cells + at] = self.magnitude[at] / (self.surround(row, col, rows, cols) + MAGNITUDE_FLOOR);
            }
        }
    }

    /// Mean magnitude over the cells around, as far as there are any.
    fn surround(&self, row: usize, col: usize, rows: usize, cols: usize) -> f32 {
        let range = |i: usize, n: usize| i.saturating_sub(SURROUND)..(i + SURROUND + 1).min(n);
        let (mut sum, mut count) = (0.0, 0);
        for r in range(row, rows) {
            for c in range(col, cols) {
                sum += self.magnitude[r * cols + c];
                count += 1;
            }
        }
        sum / count as f32
    }
}

/// Magnitude of the central difference of green, the plane that carries most of the luminance.
fn gradient_magnitude(patch: &Patch, x: usize, y: usize) -> f32 {
    let planes = patch.planes();
    let plane = &planes[planes.len() / 2];
    let at = |x: usize, y: usize| f32::from(plane[y * patch.width + x]);
    let (left, right) = (x.saturating_sub(1), (x + 1).min(patch.width - 1));
    let (up, down) = (y.saturating_sub(1), (y + 1).min(patch.height - 1));
    (at(right, y) - at(left, y)).hypot(at(x, down) - at(x, up))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crop::Cropper;
    use crate::frame::{Encoding, Frame};

    /// Values of sRGB's primaries in CIE LUV under D65, from the definition of the colour space.
    #[test]
    fn primaries_have_their_published_coordinates() {
        for (rgb, want) in [
            ([255, 255, 255], [100.0, 0.0, 0.0]),
            ([255, 0, 0], [53.24, 175.01, 37.75]),
            ([0, 255, 0], [87.73, -83.08, 107.40]),
            ([0, 0, 255], [32.30, -9.40, -130.34]),
            ([0, 0, 0], [0.0, 0.0, 0.0]),
        ] {
            for (got, want) in luv(rgb).into_iter().zip(want) {
                assert!((got * 100.0 - want).abs() < 0.1, "{rgb:?}: {} {want}", got * 100.0);
            }
        }
    }

    #[test]
    fn the_magnitude_is_relative_to_its_surround() {
        let data: Vec<u8> = (0..40 * 40).map(|i| ((i % 40) * 4) as u8).collect();
        let frame = Frame::new(&data, 40, 40, 40, Encoding::Mono8, None).unwrap();
        let mut patch = Patch::default();
        Cropper::default().crop(&frame, &frame.bounds(), 40, 40, &mut patch);
        let mut map = FeatureMap::default();
        Luv::default().compute(&patch, &mut map);
        assert_eq!((map.rows, map.cols, map.channels), (10, 10, 4));
        // A ramp of 4 a pixel has a gradient of 8 everywhere inside.
        assert!((map.plane(3)[5 * 10 + 5] - 8.0 / 13.0).abs() < 1e-6);
        assert!((map.plane(0)[5 * 10 + 5] - luv([86; 3])[0]).abs() < 1e-6, "{}", map.plane(0)[55]);
    }
}
