//! Cuts a window out of a frame and resamples it to a patch of fixed size.
//!
//! The resampling filter is a triangle, as wide as a pixel of the coarser of the two grids, so that enlarging
//! interpolates linearly and shrinking averages. Beyond the image the border pixels go on.

use crate::frame::Frame;
use crate::geometry::Rect;

/// An image patch as three planes of 8-bit intensities: red, green, blue, each row-major `height x width`.
/// Patches of frames without colour hold a single plane.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Patch {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    planes: Vec<Vec<u8>>,
}

impl Patch {
    /// The planes there are: three of a colour frame, one of a grey one.
    pub fn planes(&self) -> &[Vec<u8>] {
        &self.planes
    }

    /// Red, green and blue of the pixel in column `x` of row `y`.
    pub fn rgb(&self, x: usize, y: usize) -> [u8; 3] {
        let at = y * self.width + x;
        match self.planes.as_slice() {
            [r, g, b] => [r[at], g[at], b[at]],
            grey => [grey[0][at]; 3],
        }
    }

    fn resize(&mut self, width: usize, height: usize, planes: usize) {
        (self.width, self.height) = (width, height);
        self.planes.resize_with(planes, Vec::new);
        for plane in &mut self.planes {
            plane.resize(width * height, 0);
        }
    }
}

/// The input pixels that make up one output pixel of a one-dimensional resampling.
#[derive(Clone, Copy, Debug)]
struct Taps {
    /// First input pixel.
    first: usize,
    /// First weight of this output in [`Axis::weights`]; as many as input pixels.
    at: usize,
    count: usize,
}

/// One axis of a resampling: for each output pixel its taps, clamped to the image.
#[derive(Debug, Default)]
struct Axis {
    taps: Vec<Taps>,
    weights: Vec<f32>,
}

impl Axis {
    /// Covers `[origin, origin + length)` of an input of `limit` pixels by `count` output pixels.
    fn plan(&mut self, origin: f64, length: f64, count: usize, limit: usize) {
        let scale = length / count as f64;
        let radius = scale.max(1.0);
        self.taps.clear();
        self.weights.clear();
        for i in 0..count {
            // Centre of the output pixel, in input pixel indices.
            let centre = origin + (i as f64 + 0.5) * scale - 0.5;
            let low = (centre - radius).floor() as i64 + 1;
            let high = (centre + radius).ceil() as i64 - 1;
            let last = limit as i64 - 1;
            let first = low.clamp(0, last);
            let count = (high.clamp(0, last) - first + 1) as usize;
            let at = self.weights.len();
            self.weights.resize(at + count, 0.0);
            let mut sum = 0.0;
            for j in low..=high {
                let weight = (1.0 - (j as f64 - centre).abs() / radius).max(0.0) as f32;
                self.weights[at + (j.clamp(0, last) - first) as usize] += weight;
                sum += weight;
            }
            self.weights[at..].iter_mut().for_each(|w| *w /= sum);
            self.taps.push(Taps { first: first as usize, at, count });
        }
    }

    fn weights(&self, taps: &Taps) -> &[f32] {
        &self.weights[taps.at..taps.at + taps.count]
    }

    /// The half-open range of input pixels that any output uses.
    fn extent(&self) -> (usize, usize) {
        let first = self.taps.iter().map(|t| t.first).min().unwrap_or(0);
        let end = self.taps.iter().map(|t| t.first + t.count).max().unwrap_or(0);
        (first, end)
    }
}

/// The scratch of cropping, reused from frame to frame.
#[derive(Debug, Default)]
pub struct Cropper {
    columns: Axis,
    rows: Axis,
    /// One input row as floats, a plane.
    line: Vec<f32>,
    /// Input rows resampled in x: `rows x width`, a plane.
    narrow: Vec<f32>,
    sum: Vec<f32>,
}

impl Cropper {
    /// Fills `patch`, `width x height`, with what `window` (pixels of the frame; it may reach beyond the image)
    /// shows.
    pub fn crop(&mut self, frame: &Frame, window: &Rect, width: usize, height: usize, patch: &mut Patch) {
        let channels = frame.encoding().channels();
        let planes = if frame.encoding().is_colour() { 3 } else { 1 };
        patch.resize(width, height, planes);
        self.columns.plan(window.x, window.w, width, frame.width() as usize);
        self.rows.plan(window.y, window.h, height, frame.height() as usize);
        for (plane, channel) in patch.planes.iter_mut().zip(channels) {
            self.narrow(frame, channel);
            self.shorten(plane);
        }
    }

    /// Resamples every needed input row in x.
    fn narrow(&mut self, frame: &Frame, channel: usize) {
        let (left, right) = self.columns.extent();
        let (top, bottom) = self.rows.extent();
        let stride = frame.encoding().bytes();
        let width = self.columns.taps.len();
        self.narrow.resize((bottom - top) * width, 0.0);
        self.line.resize(right - left, 0.0);
        for (y, out) in (top..bottom).zip(self.narrow.chunks_exact_mut(width)) {
            let row = &frame.row(y)[left * stride + channel..];
            for (value, pixel) in self.line.iter_mut().zip(row.iter().step_by(stride)) {
                *value = f32::from(*pixel);
            }
            for (value, taps) in out.iter_mut().zip(&self.columns.taps) {
                let from = taps.first - left;
                *value =
                    self.line[from..from + taps.count].iter().zip(self.columns.weights(taps)).map(|(v, w)| v * w).sum();
            }
        }
    }

    /// Resamples the narrowed rows in y and rounds.
    fn shorten(&mut self, plane: &mut [u8]) {
        let (top, _) = self.rows.extent();
        let width = self.columns.taps.len();
        for (out, taps) in plane.chunks_exact_mut(width).zip(&self.rows.taps) {
            self.sum.clear();
            self.sum.resize(width, 0.5);
            let from = (taps.first - top) * width;
            for (row, weight) in self.narrow[from..].chunks_exact(width).zip(self.rows.weights(taps)) {
                self.sum.iter_mut().zip(row).for_each(|(s, v)| *s += v * weight);
            }
            out.iter_mut().zip(&self.sum).for_each(|(o, s)| *o = *s as u8);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Encoding;

    fn crop(frame: &Frame, window: Rect, width: usize, height: usize) -> Patch {
        let mut patch = Patch::default();
        Cropper::default().crop(frame, &window, width, height, &mut patch);
        patch
    }

    #[test]
    fn a_window_of_the_patch_size_is_copied_and_goes_on_beyond_the_border() {
        let data: Vec<u8> = (0..5 * 4 * 3).map(|i| i as u8 * 4).collect();
        let frame = Frame::new(&data, 5, 4, 15, Encoding::Rgb8, None).unwrap();
        let patch = crop(&frame, Rect::new(-2.0, -1.0, 6.0, 6.0), 6, 6);
        for y in 0..6 {
            for x in 0..6 {
                let (fx, fy) = ((x as i64 - 2).clamp(0, 4), (y as i64 - 1).clamp(0, 3));
                assert_eq!(patch.rgb(x, y), frame.rgb(fx as usize, fy as usize), "{x} {y}");
            }
        }
        let far = crop(&frame, Rect::new(-90.0, 70.0, 6.0, 6.0), 2, 2);
        assert_eq!(far.rgb(1, 0), frame.rgb(0, 3));
    }

    /// The same by its definition, pixel by pixel in two dimensions.
    #[test]
    fn resampling_agrees_with_the_direct_sum() {
        let (w, h) = (23, 17);
        let data: Vec<u8> = (0..w * h).map(|i| ((i * i * 7 + i * 13) % 251) as u8).collect();
        let frame = Frame::new(&data, w as u32, h as u32, w, Encoding::Mono8, None).unwrap();
        for (window, pw, ph) in [
            (Rect::new(3.2, 1.7, 9.0, 7.5), 16, 12),
            (Rect::new(-4.0, 2.0, 30.0, 14.0), 8, 8),
            (Rect::new(10.0, -6.0, 20.0, 30.0), 20, 5),
        ] {
            let patch = crop(&frame, window, pw, ph);
            let (sx, sy) = (window.w / pw as f64, window.h / ph as f64);
            let kernel = |d: f64, r: f64| (1.0 - d.abs() / r).max(0.0);
            for y in 0..ph {
                for x in 0..pw {
                    let cx = window.x + (x as f64 + 0.5) * sx - 0.5;
                    let cy = window.y + (y as f64 + 0.5) * sy - 0.5;
                    let (mut sum, mut norm) = (0.0, 0.0);
                    for j in -40i64..80 {
                        for i in -40i64..80 {
                            let weight = kernel(i as f64 - cx, sx.max(1.0)) * kernel(j as f64 - cy, sy.max(1.0));
                            let (fx, fy) = (i.clamp(0, w as i64 - 1), j.clamp(0, h as i64 - 1));
                            sum += weight * f64::from(data[fy as usize * w + fx as usize]);
                            norm += weight;
                        }
                    }
                    let got = f64::from(patch.rgb(x, y)[0]);
                    assert!((got - sum / norm).abs() <= 0.502, "{x} {y}: {got} {}", sum / norm);
                }
            }
        }
    }
}
