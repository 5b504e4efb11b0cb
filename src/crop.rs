//! Cuts a window out of a frame and resamples it to a patch of fixed size.
//!
//! The resampling filter is a triangle, as wide as a pixel of the coarser of the two grids, so that enlarging
//! interpolates linearly and shrinking averages. Beyond the image the border pixels go on. A patch may be altered as
//! well: blurred by a wider triangle, mirrored, turned.

use image::{ImageBuffer, Luma, Pixel, Primitive};
use imageproc::definitions::Clamp;
use imageproc::geometric_transformations::{Border, Interpolation, Projection, warp_into};

use crate::frame::{Frame, Plane};
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

    /// A square of one intensity.
    pub(crate) fn grey(side: usize, intensity: u8) -> Self {
        Self { width: side, height: side, planes: vec![vec![intensity; side * side]] }
    }

    /// The planes, to be filled.
    pub(crate) fn planes_mut(&mut self) -> &mut [Vec<u8>] {
        &mut self.planes
    }

    /// Swaps left and right.
    fn mirror(&mut self) {
        for plane in &mut self.planes {
            plane.chunks_exact_mut(self.width).for_each(<[u8]>::reverse);
        }
    }

    /// Turns what it shows about its middle, `degrees` clockwise, each of its pixels being `aspect` times as high as
    /// wide. The border pixels go on. `spare` is room for a plane.
    fn turn(&mut self, degrees: f64, aspect: f64, spare: &mut Vec<u8>) {
        let middle = [self.width, self.height].map(|side| (side as f32 - 1.0) / 2.0);
        self.planes.iter_mut().for_each(|plane| turn_about(plane, self.width, middle, degrees, aspect, spare));
    }

    /// Gives it a size and so many planes; what they hold is not defined.
    pub(crate) fn resize(&mut self, width: usize, height: usize, planes: usize) {
        (self.width, self.height) = (width, height);
        self.planes.resize_with(planes, Vec::new);
        for plane in &mut self.planes {
            plane.resize(width * height, 0);
        }
    }
}

/// Turns what a row-major plane of this width shows about a place, `[column, row]`, by `degrees` clockwise, each of its
/// pixels being `aspect` times as high as wide. Its border goes on. `spare` is room for another plane.
pub(crate) fn turn_about<T>(
    plane: &mut Vec<T>,
    width: usize,
    about: [f32; 2],
    degrees: f64,
    aspect: f64,
    spare: &mut Vec<T>,
) where
    T: Primitive + Clamp<f32> + Into<f32> + Send + Sync,
    Luma<T>: Pixel<Subpixel = T> + Send + Sync,
{
    let ([x, y], aspect) = (about, aspect as f32);
    let turn = Projection::rotate(degrees.to_radians() as f32);
    let turn = Projection::scale(1.0, 1.0 / aspect) * turn * Projection::scale(1.0, aspect);
    let turn = Projection::translate(x, y) * turn * Projection::translate(-x, -y);
    let (width, height) = (width as u32, (plane.len() / width) as u32);
    let image = |data| ImageBuffer::<Luma<T>, _>::from_raw(width, height, data).expect("a plane has a value a pixel");
    spare.resize(plane.len(), T::DEFAULT_MIN_VALUE);
    let (from, mut to) = (image(std::mem::take(plane)), image(std::mem::take(spare)));
    warp_into(&from, turn, Interpolation::Bilinear, Border::Replicate, &mut to);
    (*plane, *spare) = (to.into_raw(), from.into_raw());
}

/// One axis of a resampling: each output pixel is a weighted sum of the same number of neighbouring input pixels.
#[derive(Debug, Default)]
struct Axis {
    /// Input pixels of an output pixel.
    taps: usize,
    /// The first of them, for each output pixel.
    first: Vec<usize>,
    /// Their weights, `outputs x taps`.
    weights: Vec<f32>,
}

impl Axis {
    /// Covers `[origin, origin + length)` of an input of `limit` pixels by `count` output pixels, each a mean over at
    /// least `blur` input pixels to either side. Taps beyond the input fall on its outermost pixels.
    fn plan(&mut self, origin: f64, length: f64, count: usize, limit: usize, blur: f64) {
        let scale = length / count as f64;
        self.plan_within(scale.max(1.0).max(blur), origin, scale, count, limit);
    }

    /// Likewise, each output pixel a mean over `radius` input pixels to either side, `scale` of them from the next.
    fn plan_within(&mut self, radius: f64, origin: f64, scale: f64, count: usize, limit: usize) {
        let last = limit as i64 - 1;
        let reach = (2.0 * radius).ceil() as i64;
        self.taps = (reach as usize).min(limit);
        self.first.clear();
        self.weights.clear();
        self.weights.resize(count * self.taps, 0.0);
        for (i, weights) in self.weights.chunks_exact_mut(self.taps).enumerate() {
            // Centre of the output pixel, in input pixel indices.
            let centre = origin + (i as f64 + 0.5) * scale - 0.5;
            let low = (centre - radius).floor() as i64 + 1;
            let first = low.clamp(0, limit as i64 - self.taps as i64);
            let mut sum = 0.0;
            for j in low..low + reach {
                let weight = (1.0 - (j as f64 - centre).abs() / radius).max(0.0) as f32;
                weights[(j.clamp(0, last) - first) as usize] += weight;
                sum += weight;
            }
            weights.iter_mut().for_each(|w| *w /= sum);
            self.first.push(first as usize);
        }
    }

    /// First tap and weights of each output pixel.
    fn outputs(&self) -> impl Iterator<Item = (usize, &[f32])> {
        self.first.iter().copied().zip(self.weights.chunks_exact(self.taps))
    }

    /// The half-open range of input pixels that any output uses.
    fn extent(&self) -> (usize, usize) {
        let first = self.first.iter().copied().min().unwrap_or(0);
        let end = self.first.iter().copied().max().unwrap_or(0) + self.taps;
        (first, end)
    }

    /// Resamples a line that starts at input pixel `start`.
    fn resample(&self, line: &[f32], start: usize, out: &mut [f32]) {
        // Loops of known length take a fraction of the time; most windows are enlarged or shrunk a little.
        match self.taps {
            2 => self.resample_by::<2>(line, start, out),
            3 => self.resample_by::<3>(line, start, out),
            4 => self.resample_by::<4>(line, start, out),
            _ => out.iter_mut().zip(self.outputs()).for_each(|(value, (first, weights))| {
                *value = line[first - start..].iter().zip(weights).map(|(v, w)| v * w).sum();
            }),
        }
    }

    fn resample_by<const TAPS: usize>(&self, line: &[f32], start: usize, out: &mut [f32]) {
        let (weights, _) = self.weights.as_chunks::<TAPS>();
        for ((value, first), weights) in out.iter_mut().zip(&self.first).zip(weights) {
            let from = first - start;
            *value = line[from..from + TAPS].iter().zip(weights).map(|(v, w)| v * w).sum();
        }
    }
}

/// What is done to patches beside resampling.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Alteration {
    /// Blurs by a triangle that reaches so many pixels of the frame to either side, across and down.
    pub blur: [f64; 2],
    /// Swaps left and right.
    pub mirrored: bool,
    /// Turns about the middle of the patch, in degrees clockwise.
    pub turn: f64,
}

/// The scratch of cropping, reused from frame to frame.
#[derive(Debug, Default)]
pub struct Cropper {
    columns: Axis,
    rows: Axis,
    alteration: Alteration,
    /// One input row as floats, a plane.
    line: Vec<f32>,
    /// Input rows resampled in x: `rows x width`, a plane.
    narrow: Vec<f32>,
    sum: Vec<f32>,
    /// Room to turn a plane.
    spare: Vec<u8>,
}

impl Cropper {
    /// Fills `patch`, `width x height`, with what `window` (pixels of the frame; it may reach beyond the image)
    /// shows.
    pub fn crop(&mut self, frame: &Frame, window: &Rect, width: usize, height: usize, patch: &mut Patch) {
        let planes = if frame.encoding().is_colour() { 3 } else { 1 };
        patch.resize(width, height, planes);
        self.plan(frame, window, width, height);
        for (out, plane) in patch.planes.iter_mut().zip(Plane::COLOURS) {
            self.resample(frame, plane, out);
        }
        self.finish(window, patch);
    }

    /// Fills `patch` likewise with a single plane, the luma: a third of the work where colour does not matter.
    pub fn crop_luma(&mut self, frame: &Frame, window: &Rect, width: usize, height: usize, patch: &mut Patch) {
        patch.resize(width, height, 1);
        self.plan(frame, window, width, height);
        self.resample(frame, Plane::Luma, &mut patch.planes[0]);
        self.finish(window, patch);
    }

    /// Fills `patch`, `side x side`, with what `window` shows as networks for matching are trained on it: interpolated
    /// linearly also where it is shrunk, and of the colour `outside` beyond the image.
    pub fn crop_for_matching(
        &mut self,
        frame: &Frame,
        window: &Rect,
        side: usize,
        outside: [u8; 3],
        patch: &mut Patch,
    ) {
        let planes = if frame.encoding().is_colour() { 3 } else { 1 };
        patch.resize(side, side, planes);
        let ([columns, rows], [across, down], n) = (frame.grid(), density(frame), side as f64);
        self.columns.plan_within(1.0, window.x * across, window.w * across / n, side, columns as usize);
        self.rows.plan_within(1.0, window.y * down, window.h * down / n, side, rows as usize);
        for (out, plane) in patch.planes.iter_mut().zip(Plane::COLOURS) {
            self.resample(frame, plane, out);
        }
        let inside = |low: f64, length: f64, limit: u32| {
            // Pixels of the patch whose centres lie in the image.
            let first = ((-low / length * n - 0.5).ceil().max(0.0) as usize).min(side);
            let end = (((f64::from(limit) - low) / length * n - 0.5).ceil().max(0.0) as usize).min(side);
            first..end
        };
        let (inner_columns, inner_rows) =
            (inside(window.x, window.w, frame.width()), inside(window.y, window.h, frame.height()));
        for (plane, outside) in patch.planes.iter_mut().zip(outside) {
            for (y, row) in plane.chunks_exact_mut(side).enumerate() {
                if inner_rows.contains(&y) && !inner_columns.is_empty() {
                    row[..inner_columns.start].fill(outside);
                    row[inner_columns.end..].fill(outside);
                } else {
                    row.fill(outside);
                }
            }
        }
    }

    /// What `work` crops is altered.
    pub fn altered<T>(&mut self, alteration: Alteration, work: impl FnOnce(&mut Self) -> T) -> T {
        self.alteration = alteration;
        let done = work(self);
        self.alteration = Alteration::default();
        done
    }

    /// Mirrors and turns a patch that shows `window`, as if it had been cropped under this alteration. Blur comes with
    /// cropping alone.
    pub fn alter(&mut self, alteration: &Alteration, window: &Rect, patch: &mut Patch) {
        if alteration.mirrored {
            patch.mirror();
        }
        if alteration.turn != 0.0 {
            let aspect = window.h / patch.height as f64 * (patch.width as f64 / window.w);
            patch.turn(alteration.turn, aspect, &mut self.spare);
        }
    }

    fn finish(&mut self, window: &Rect, patch: &mut Patch) {
        let alteration = self.alteration;
        self.alter(&alteration, window, patch);
    }

    fn plan(&mut self, frame: &Frame, window: &Rect, width: usize, height: usize) {
        let ([columns, rows], [across, down]) = (frame.grid(), density(frame));
        let [x, y] = self.alteration.blur;
        let blur = [x * across, y * down];
        self.columns.plan(window.x * across, window.w * across, width, columns as usize, blur[0]);
        self.rows.plan(window.y * down, window.h * down, height, rows as usize, blur[1]);
    }

    fn resample(&mut self, frame: &Frame, plane: Plane, out: &mut [u8]) {
        self.narrow(frame, plane);
        self.shorten(out);
    }

    /// Resamples every needed input row in x.
    fn narrow(&mut self, frame: &Frame, plane: Plane) {
        let (left, right) = self.columns.extent();
        let (top, bottom) = self.rows.extent();
        let width = self.columns.first.len();
        self.narrow.resize((bottom - top) * width, 0.0);
        self.line.resize(right - left, 0.0);
        for (y, out) in (top..bottom).zip(self.narrow.chunks_exact_mut(width)) {
            frame.line(y, left, plane, &mut self.line);
            self.columns.resample(&self.line, left, out);
        }
    }

    /// Resamples the narrowed rows in y and rounds.
    fn shorten(&mut self, plane: &mut [u8]) {
        let (top, _) = self.rows.extent();
        let width = self.columns.first.len();
        for (out, (first, weights)) in plane.chunks_exact_mut(width).zip(self.rows.outputs()) {
            self.sum.clear();
            self.sum.resize(width, 0.5);
            for (row, weight) in self.narrow[(first - top) * width..].chunks_exact(width).zip(weights) {
                self.sum.iter_mut().zip(row).for_each(|(s, v)| *s += v * weight);
            }
            out.iter_mut().zip(&self.sum).for_each(|(o, s)| *o = *s as u8);
        }
    }
}

/// Pixels of the bytes for a pixel of the frame, across and down.
fn density(frame: &Frame) -> [f64; 2] {
    let [columns, rows] = frame.grid().map(f64::from);
    [columns / f64::from(frame.width()), rows / f64::from(frame.height())]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

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

    #[test]
    fn a_frame_seen_as_a_larger_one_is_cropped_in_its_coordinates() {
        let data: Vec<u8> = (0..24 * 16).map(|i| (i * i % 251) as u8).collect();
        let frame = Frame::new(&data, 24, 16, 24, Encoding::Mono8, None).unwrap();
        let seen = frame.seen_as([48, 64]);
        assert_eq!((seen.bounds(), seen.grid()), (Rect::new(0.0, 0.0, 48.0, 64.0), [24, 16]));
        let twice = crop(&seen, Rect::new(8.0, 12.0, 20.0, 32.0), 10, 8);
        assert_eq!(twice, crop(&frame, Rect::new(4.0, 3.0, 10.0, 8.0), 10, 8));
    }

    #[test]
    fn a_patch_is_mirrored_or_turned_about_its_middle() {
        let data: Vec<u8> = (0..7 * 5).map(|i| (i * i % 251) as u8).collect();
        let frame = Frame::new(&data, 7, 5, 7, Encoding::Mono8, None).unwrap();
        let square = Rect::new(1.0, 0.0, 5.0, 5.0);
        let altered = |mirrored, turn| {
            let mut patch = Patch::default();
            let alteration = Alteration { mirrored, turn, ..Alteration::default() };
            Cropper::default().altered(alteration, |cropper| cropper.crop(&frame, &square, 5, 5, &mut patch));
            patch
        };
        let [plain, mirrored, quarter] = [altered(false, 0.0), altered(true, 0.0), altered(false, 90.0)];
        assert_eq!(plain, crop(&frame, square, 5, 5));
        for y in 0..5 {
            for x in 0..5 {
                assert_eq!(mirrored.rgb(x, y), plain.rgb(4 - x, y), "{x} {y}");
                // Clockwise, the left side comes to the top.
                let (got, wanted) = (quarter.rgb(x, y)[0], plain.rgb(y, 4 - x)[0]);
                assert!(got.abs_diff(wanted) <= 1, "{x} {y}: {got} {wanted}");
            }
        }
        assert_eq!(altered(false, 45.0).rgb(2, 2), plain.rgb(2, 2));
    }

    #[test]
    fn what_a_patch_of_oblong_pixels_shows_is_turned_and_not_the_patch() {
        let view = |data: &[u8], width: usize, turn: f64| {
            let frame = Frame::new(data, 40, 40, 40, Encoding::Mono8, None).unwrap();
            let mut patch = Patch::default();
            let alteration = Alteration { turn, ..Alteration::default() };
            let whole = frame.bounds();
            Cropper::default().altered(alteration, |cropper| cropper.crop(&frame, &whole, width, 40, &mut patch));
            patch
        };
        // A smooth bar that goes across, in pixels half as wide as they are high: turned by a quarter it goes down.
        let bar: Vec<u8> =
            (0..40 * 40).map(|i| (250.0 * (-((i / 40) as f64 - 19.5).powi(2) / 40.0).exp()) as u8).collect();
        let (across, down) = (view(&bar, 80, 0.0), view(&bar, 80, 90.0));
        for i in 12..28 {
            let (got, wanted) = (down.rgb(2 * i, 20)[0], across.rgb(40, i)[0]);
            assert!(got.abs_diff(wanted) < 12, "{i}: {got} {wanted}");
        }
    }

    #[test]
    fn a_plane_turned_by_a_quarter_has_its_left_at_the_top() {
        let map: Vec<f32> = (0..25).map(|i| (i * i % 17) as f32).collect();
        let mut turned = map.clone();
        turn_about(&mut turned, 5, [2.0, 2.0], 90.0, 1.0, &mut Vec::new());
        for (i, value) in turned.iter().enumerate() {
            let (r, c) = (i / 5, i % 5);
            assert!((value - map[(4 - c) * 5 + r]).abs() < 1e-4, "{r} {c}");
        }
    }

    fn noise(pixels: usize) -> Vec<u8> {
        (0..pixels).map(|i| ((i * i * 7 + i * 13) % 251) as u8).collect()
    }

    /// A crop agrees with its definition, pixel by pixel in two dimensions.
    fn agrees(frame: &Frame, window: Rect, [width, height]: [usize; 2], blur: [f64; 2]) {
        let mut patch = Patch::default();
        let alteration = Alteration { blur, ..Alteration::default() };
        Cropper::default().altered(alteration, |cropper| cropper.crop(frame, &window, width, height, &mut patch));
        let scales = [window.w / width as f64, window.h / height as f64];
        let radii = [0, 1].map(|axis| scales[axis].max(1.0).max(blur[axis]));
        let taps = |centre: f64, radius: f64| {
            let around = (centre - radius).floor() as i64..=(centre + radius).ceil() as i64;
            around.map(move |i| (i, (1.0 - (i as f64 - centre).abs() / radius).max(0.0)))
        };
        let last = [frame.width(), frame.height()].map(|side| i64::from(side) - 1);
        for y in 0..height {
            for x in 0..width {
                let cx = window.x + (x as f64 + 0.5) * scales[0] - 0.5;
                let cy = window.y + (y as f64 + 0.5) * scales[1] - 0.5;
                let (mut sum, mut norm) = (0.0, 0.0);
                for (j, down) in taps(cy, radii[1]) {
                    for (i, across) in taps(cx, radii[0]) {
                        let grey = frame.rgb(i.clamp(0, last[0]) as usize, j.clamp(0, last[1]) as usize)[0];
                        sum += across * down * f64::from(grey);
                        norm += across * down;
                    }
                }
                let (got, want) = (f64::from(patch.rgb(x, y)[0]), sum / norm);
                assert!((got - want).abs() <= 0.502, "{window}, {x} {y}: {got} {want}");
            }
        }
    }

    #[test]
    fn resampling_agrees_with_the_direct_sum() {
        let data = noise(23 * 17);
        let frame = Frame::new(&data, 23, 17, 23, Encoding::Mono8, None).unwrap();
        for (window, size, blur) in [
            (Rect::new(3.2, 1.7, 9.0, 7.5), [16, 12], [0.0, 0.0]),
            (Rect::new(-4.0, 2.0, 30.0, 14.0), [8, 8], [0.0, 0.0]),
            (Rect::new(10.0, -6.0, 20.0, 30.0), [20, 5], [0.0, 0.0]),
            (Rect::new(3.2, 1.7, 9.0, 7.5), [16, 12], [2.7, 0.0]),
            (Rect::new(10.0, -6.0, 20.0, 30.0), [20, 5], [1.5, 9.2]),
        ] {
            agrees(&frame, window, size, blur);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            rng_seed: RngSeed::Fixed(1), failure_persistence: None, ..ProptestConfig::with_cases(64)
        })]

        #[test]
        fn any_window_agrees_with_the_direct_sum(
            [width, height] in prop::array::uniform2(1usize..24),
            corner in prop::array::uniform2(-30.0..30.0),
            sides in prop::array::uniform2(0.5..40.0),
            size in prop::array::uniform2(1usize..16),
            blur in prop::array::uniform2(prop_oneof![Just(0.0), 0.0..9.0]),
        ) {
            let data = noise(width * height);
            let frame = Frame::new(&data, width as u32, height as u32, width, Encoding::Mono8, None).unwrap();
            agrees(&frame, Rect::new(corner[0], corner[1], sides[0], sides[1]), size, blur);
        }
    }
}
