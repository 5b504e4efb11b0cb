//! The paper's correlation filter: a kernel ridge regression for each layer, in closed form (LCMHT eqs 1 to 9).
//!
//! The linear kernel of eq 9 is divided by the number of values summed, cells times channels, so that the
//! coefficients and the regularisation mean the same for every layer and a perfect match peaks near 1.

use rustfft::num_complex::Complex32;

use super::fft::Fft2;
use super::sample::Sample;

/// The fixed settings of a filter.
#[derive(Clone, Debug, PartialEq)]
pub struct KernelisedSettings {
    /// Regularisation, lambda of eq 2.
    pub regularisation: f32,
    /// Weight of each layer's response, gamma of eq 6.
    pub layer_weights: Vec<f32>,
}

/// Template and coefficients of all layers.
pub struct KernelisedFilter {
    settings: KernelisedSettings,
    label: Vec<Complex32>,
    /// The learned template, X of eq 8a; empty before the first sample.
    template: Vec<Complex32>,
    /// The learned coefficients, A of eq 8b: `layers x bins`.
    coefficients: Vec<Complex32>,
    kernel: Vec<Complex32>,
    fused: Vec<Complex32>,
}

impl KernelisedFilter {
    /// An untrained filter. `label` is a map of the shape of `fft`, its peak at cell (0, 0).
    ///
    /// # Panics
    /// Where `label` is not of that shape.
    pub fn new(settings: KernelisedSettings, fft: &mut Fft2, label: &[f32]) -> Self {
        let mut spectrum = vec![Complex32::default(); fft.bins()];
        fft.forward(label, &mut spectrum);
        Self {
            coefficients: vec![Complex32::default(); settings.layer_weights.len() * fft.bins()],
            settings,
            label: spectrum,
            template: Vec::new(),
            kernel: vec![Complex32::default(); fft.bins()],
            fused: vec![Complex32::default(); fft.bins()],
        }
    }

    /// Trains on a sample (eq 4) and blends the outcome in with weight `learning_rate` (eq 8); the first sample is
    /// taken whole.
    ///
    /// # Panics
    /// Where a layer of the sample reaches beyond its spectra, or they are not of the shape of `fft`.
    pub fn learn(&mut self, fft: &Fft2, sample: &Sample, learning_rate: f32) {
        let first = self.template.is_empty();
        let rate = if first { 1.0 } else { learning_rate };
        if first {
            self.template.resize(sample.spectra.len(), Complex32::default());
        }
        blend(&mut self.template, &sample.spectra, rate);
        let bins = fft.bins();
        for (layer, learned) in sample.layers.iter().zip(self.coefficients.chunks_exact_mut(bins)) {
            let x = &sample.spectra[layer.start * bins..layer.end * bins];
            linear_kernel(x, x, fft.cells(), &mut self.kernel);
            for ((a, k), y) in learned.iter_mut().zip(&self.kernel).zip(&self.label) {
                *a = *a * (1.0 - rate) + y / (k + self.settings.regularisation) * rate;
            }
        }
    }

    /// The response map (eqs 5 and 6): the layers' responses, summed by weight.
    ///
    /// # Panics
    /// Where nothing has been learned, the sample has other layers than those learned, or the map is not of the shape
    /// of `fft`.
    pub fn respond(&mut self, fft: &mut Fft2, sample: &Sample, response: &mut [f32]) {
        let bins = fft.bins();
        self.fused.fill(Complex32::default());
        let layers = sample.layers.iter().zip(self.coefficients.chunks_exact(bins));
        for ((layer, coefficients), &weight) in layers.zip(&self.settings.layer_weights) {
            let range = layer.start * bins..layer.end * bins;
            linear_kernel(&self.template[range.clone()], &sample.spectra[range], fft.cells(), &mut self.kernel);
            for ((sum, a), k) in self.fused.iter_mut().zip(coefficients).zip(&self.kernel) {
                *sum += a * k * weight;
            }
        }
        fft.inverse(&self.fused, response);
    }
}

/// The linear kernel of all cyclic shifts (eq 9), as a spectrum, over the number of values summed.
fn linear_kernel(a: &[Complex32], b: &[Complex32], cells: usize, kernel: &mut [Complex32]) {
    kernel.fill(Complex32::default());
    for (a, b) in a.chunks_exact(kernel.len()).zip(b.chunks_exact(kernel.len())) {
        for ((k, a), b) in kernel.iter_mut().zip(a).zip(b) {
            *k += a.conj() * b;
        }
    }
    let channels = a.len() / kernel.len();
    let scale = 1.0 / (channels * cells) as f32;
    kernel.iter_mut().for_each(|k| *k *= scale);
}

fn blend(old: &mut [Complex32], new: &[Complex32], rate: f32) {
    old.iter_mut().zip(new).for_each(|(o, n)| *o = *o * (1.0 - rate) + n * rate);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dcf::window::label;

    const ROWS: usize = 4;
    const COLS: usize = 6;
    const CELLS: usize = ROWS * COLS;
    const LAMBDA: f32 = 1e-2;

    fn maps(seed: usize) -> Vec<f32> {
        (0..3 * CELLS).map(|i| ((i * i * 11 + i * (5 + seed) + seed * 37) % 41) as f32 / 41.0).collect()
    }

    fn sample(fft: &mut Fft2, maps: &[f32]) -> Sample {
        let mut spectra = vec![Complex32::default(); 3 * fft.bins()];
        for (map, spectrum) in maps.chunks_exact(CELLS).zip(spectra.chunks_exact_mut(fft.bins())) {
            fft.forward(map, spectrum);
        }
        Sample::new(vec![0..2, 2..3], spectra)
    }

    fn filter(fft: &mut Fft2) -> KernelisedFilter {
        let settings = KernelisedSettings { regularisation: LAMBDA, layer_weights: vec![1.0, 0.4] };
        KernelisedFilter::new(settings, fft, &label(ROWS, COLS, 0.7))
    }

    fn shifted(map: &[f32], by: usize) -> impl Fn(usize) -> f32 + '_ {
        move |cell| {
            let (r, c) = ((cell / COLS + by / COLS) % ROWS, (cell % COLS + by % COLS) % COLS);
            map[r * COLS + c]
        }
    }

    /// Kernel ridge regression over all cyclic shifts, by the dense dual solution (K + lambda I) a = y.
    #[test]
    fn one_training_agrees_with_dense_kernel_ridge_regression() {
        let mut fft = Fft2::new(ROWS, COLS);
        let (x, z) = (maps(0), maps(3));
        let mut filter = filter(&mut fft);
        let s = sample(&mut fft, &x);
        filter.learn(&fft, &s, 1.0);
        let mut response = vec![0.0; CELLS];
        let t = sample(&mut fft, &z);
        filter.respond(&mut fft, &t, &mut response);
        let y = label(ROWS, COLS, 0.7);
        let mut want = [0.0f64; CELLS];
        for (layer, weight) in [(0..2usize, 1.0), (2..3, 0.4)] {
            let scale = 1.0 / (layer.len() * CELLS) as f64;
            let kernel = |a: &[f32], i: usize, b: &[f32], j: usize| -> f64 {
                let channels = layer.clone();
                scale
                    * channels
                        .map(|d| {
                            let (a, b) = (&a[d * CELLS..(d + 1) * CELLS], &b[d * CELLS..(d + 1) * CELLS]);
                            let (a, b) = (shifted(a, i), shifted(b, j));
                            (0..CELLS).map(|c| f64::from(a(c) * b(c))).sum::<f64>()
                        })
                        .sum::<f64>()
            };
            let k = nalgebra::DMatrix::from_fn(CELLS, CELLS, |i, j| kernel(&x, i, &x, j))
                + nalgebra::DMatrix::identity(CELLS, CELLS) * f64::from(LAMBDA);
            let target = nalgebra::DVector::from_iterator(CELLS, y.iter().map(|&v| f64::from(v)));
            let dual = k.lu().solve(&target).unwrap();
            for (shift, want) in want.iter_mut().enumerate() {
                *want += weight * (0..CELLS).map(|i| dual[i] * kernel(&x, i, &z, shift)).sum::<f64>();
            }
        }
        for (got, want) in response.iter().zip(want) {
            assert!((f64::from(*got) - want).abs() < 1e-4, "{got} {want}");
        }
    }

    #[test]
    fn a_perfect_match_peaks_near_the_sum_of_the_weights() {
        let mut fft = Fft2::new(ROWS, COLS);
        let mut filter = filter(&mut fft);
        let s = sample(&mut fft, &maps(0));
        filter.settings.regularisation = 1e-4;
        filter.learn(&fft, &s, 0.01);
        let mut response = vec![0.0; CELLS];
        filter.respond(&mut fft, &s, &mut response);
        assert!((response[0] - 1.4).abs() < 0.03, "{}", response[0]);
    }

    #[test]
    fn template_and_coefficients_are_interpolated() {
        let mut fft = Fft2::new(ROWS, COLS);
        let (a, b) = (sample(&mut fft, &maps(0)), sample(&mut fft, &maps(1)));
        let (mut both, mut second) = (filter(&mut fft), filter(&mut fft));
        both.learn(&fft, &a, 0.25);
        let (template, coefficients) = (both.template.clone(), both.coefficients.clone());
        second.learn(&fft, &b, 1.0);
        both.learn(&fft, &b, 0.25);
        for ((got, old), new) in both.template.iter().zip(&template).zip(&second.template) {
            assert!((got - (old * 0.75 + new * 0.25)).norm() < 1e-5);
        }
        for ((got, old), new) in both.coefficients.iter().zip(&coefficients).zip(&second.coefficients) {
            assert!((got - (old * 0.75 + new * 0.25)).norm() < 1e-3 * (1.0 + got.norm()));
        }
    }
}
