//! The one-dimensional scale filter, in the manner of DSST (Danelljan, Häger, Khan and Felsberg, *Accurate scale
//! estimation for robust visual tracking*, BMVC 2014).
//!
//! The target is cropped at a ladder of scales around its present size; each crop's HOG (of its luma) is one column of
//! a sample. A correlation filter along the ladder answers with its peak at the scale that fits.

use std::sync::Arc;

use rustfft::{Fft, FftPlanner, num_complex::Complex32};

use crate::crop::{Cropper, Patch};
use crate::dcf::response::highest;
use crate::dcf::window::wrapped;
use crate::features::hog::Hog;
use crate::features::{CELL, FeatureMap};
use crate::frame::{Frame, MIN_TARGET_SIDE};
use crate::geometry::Rect;

/// Steps of the ladder.
const SCALES: usize = 17;
/// Width of the Gaussian label, in steps.
const LABEL_SIGMA: f64 = 1.0;
/// Regularisation, relative to the mean energy of a frequency.
const REGULARISATION: f32 = 0.01;

/// The filter. It works for one target, whose shape fixes the size of the crops.
pub struct ScaleFilter {
    /// Ratio of neighbouring scales.
    step: f64,
    patch_size: [usize; 2],
    window: [f32; SCALES],
    label: [Complex32; SCALES],
    forward: Arc<dyn Fft<f32>>,
    inverse: Arc<dyn Fft<f32>>,
    /// Spectra of the present sample, `features x SCALES`.
    sample: Vec<Complex32>,
    numerator: Vec<Complex32>,
    denominator: [f32; SCALES],
    scratch: Vec<Complex32>,
    hog: Hog,
    patch: Patch,
    map: FeatureMap,
}

impl ScaleFilter {
    /// A filter for targets of the shape of `target`, seen in crops of about `area` square pixels. `step` is the
    /// ratio of neighbouring scales, above 1.
    pub fn new(target: &Rect, step: f64, area: f64) -> Self {
        let shrink = (area / target.area()).sqrt();
        let side = |length: f64| ((length * shrink / CELL as f64).round().max(2.0) as usize) * CELL;
        let mut planner = FftPlanner::new();
        let (forward, inverse) = (planner.plan_fft_forward(SCALES), planner.plan_fft_inverse(SCALES));
        let mut label: [Complex32; SCALES] = std::array::from_fn(|i| {
            let d = wrapped(i, SCALES) as f64 / LABEL_SIGMA;
            Complex32::new((-0.5 * d * d).exp() as f32, 0.0)
        });
        forward.process(&mut label);
        let scratch = forward.get_inplace_scratch_len().max(inverse.get_inplace_scratch_len());
        Self {
            step,
            patch_size: [side(target.w), side(target.h)],
            window: std::array::from_fn(|i| {
                (std::f32::consts::PI * (i as f32 + 1.0) / (SCALES as f32 + 1.0)).sin().powi(2)
            }),
            label,
            forward,
            inverse,
            sample: Vec::new(),
            numerator: Vec::new(),
            denominator: [0.0; SCALES],
            scratch: vec![Complex32::default(); scratch],
            hog: Hog::default(),
            patch: Patch::default(),
            map: FeatureMap::default(),
        }
    }

    /// The box `target` in the size that the target has by now, within what the image can hold. Call after the first
    /// [`learn`](Self::learn).
    pub fn resized(&mut self, frame: &Frame, cropper: &mut Cropper, target: &Rect) -> Rect {
        let factor = self.estimate(frame, cropper, target);
        let least = (MIN_TARGET_SIDE / target.w.min(target.h)).min(1.0);
        let most = (f64::from(frame.width()) / target.w).min(f64::from(frame.height()) / target.h).max(1.0);
        target.scaled(factor.clamp(least, most))
    }

    /// The factor by which the target has grown since `target` was its box.
    fn estimate(&mut self, frame: &Frame, cropper: &mut Cropper, target: &Rect) -> f64 {
        self.extract(frame, cropper, target);
        let energy = self.denominator.iter().sum::<f32>() / SCALES as f32;
        let mut response = [Complex32::default(); SCALES];
        for (x, n) in self.sample.chunks_exact(SCALES).zip(self.numerator.chunks_exact(SCALES)) {
            response.iter_mut().zip(x).zip(n).for_each(|((r, x), n)| *r += n.conj() * x);
        }
        for (r, d) in response.iter_mut().zip(&self.denominator) {
            *r /= d + REGULARISATION * energy;
        }
        self.inverse.process_with_scratch(&mut response, &mut self.scratch);
        let peak = highest(&response.map(|r| r.re), 1, SCALES, true);
        self.step.powf(peak.displacement[0])
    }

    /// Blends the target as it is now into the filter with weight `learning_rate`; the first time it is taken
    /// whole.
    pub fn learn(&mut self, frame: &Frame, cropper: &mut Cropper, target: &Rect, learning_rate: f32) {
        self.extract(frame, cropper, target);
        let first = self.numerator.is_empty();
        let rate = if first { 1.0 } else { learning_rate };
        self.numerator.resize(self.sample.len(), Complex32::default());
        let mut energy = [0.0; SCALES];
        for (x, n) in self.sample.chunks_exact(SCALES).zip(self.numerator.chunks_exact_mut(SCALES)) {
            for (i, (x, n)) in x.iter().zip(n).enumerate() {
                *n = *n * (1.0 - rate) + x * self.label[i].conj() * rate;
                energy[i] += x.norm_sqr();
            }
        }
        self.denominator.iter_mut().zip(energy).for_each(|(d, e)| *d = *d * (1.0 - rate) + e * rate);
    }

    /// Crops the target at each scale and transforms its features along the ladder.
    fn extract(&mut self, frame: &Frame, cropper: &mut Cropper, target: &Rect) {
        let [width, height] = self.patch_size;
        for i in 0..SCALES {
            let factor = self.step.powi(i as i32 - (SCALES / 2) as i32);
            cropper.crop_luma(frame, &target.scaled(factor), width, height, &mut self.patch);
            self.hog.compute(&self.patch, &mut self.map);
            self.sample.resize(self.map.data.len() * SCALES, Complex32::default());
            // The present size stands at index 0 of the wrapped axis, as the label's peak does.
            let at = (i + SCALES - SCALES / 2) % SCALES;
            for (row, v) in self.sample.chunks_exact_mut(SCALES).zip(&self.map.data) {
                row[at] = Complex32::new(v * self.window[i], 0.0);
            }
        }
        self.forward.process_with_scratch(&mut self.sample, &mut self.scratch);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Encoding;

    /// A textured disc of the given radius in the middle of a grey image.
    fn disc(radius: f64) -> Vec<u8> {
        (0..200 * 200)
            .map(|i| {
                let (x, y) = (f64::from(i % 200) - 99.5, f64::from(i / 200) - 99.5);
                let (u, v) = (x / radius, y / radius);
                let texture = (u * 9.0).sin() * (v * 7.0).cos() + (u * v * 11.0).sin();
                if u.hypot(v) < 1.0 { (128.0 + 50.0 * texture) as u8 } else { 90 }
            })
            .collect()
    }

    #[test]
    fn growth_and_shrinkage_are_recovered() {
        let target = |r: f64| Rect::around([100.0, 100.0], [2.0 * r, 2.0 * r]);
        let first = disc(30.0);
        let frame = Frame::new(&first, 200, 200, 200, Encoding::Mono8, None).unwrap();
        let mut cropper = Cropper::default();
        for area in [512.0, 2048.0, 16384.0] {
            let mut filter = ScaleFilter::new(&target(30.0), 1.02, area);
            filter.learn(&frame, &mut cropper, &target(30.0), 0.02);
            assert!((filter.estimate(&frame, &mut cropper, &target(30.0)) - 1.0).abs() < 0.005);
            for factor in [0.94, 0.97, 1.03, 1.06] {
                let data = disc(30.0 * factor);
                let frame = Frame::new(&data, 200, 200, 200, Encoding::Mono8, None).unwrap();
                let got = filter.estimate(&frame, &mut cropper, &target(30.0));
                assert!((got - factor).abs() < 0.02, "{got} for {factor} in crops of {area} square pixels");
            }
        }
    }
}
