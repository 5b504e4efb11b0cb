//! The default correlation filter: confined to the target and trained on a memory of samples.
//!
//! Minimises, over filters f of D channels that vanish outside the mask m,
//!
//! ```text
//! sum_k a_k | sum_d (m f_d) * x_kd - y |^2 + lambda |f|^2
//! ```
//!
//! where `*` is cyclic cross-correlation, x_k are remembered samples with weights a_k that sum to 1, and y is the
//! Gaussian label. The mask keeps the background out of the filter (in the manner of Kiani Galoogahi, Fagg and
//! Lucey, *Learning background-aware correlation filters*, ICCV 2017); the memory keeps the target's earlier looks
//! in it (in the manner of Danelljan et al., *ECO*, CVPR 2017). Solved by conjugate gradients on the normal
//! equations, warm-started from the present filter: a step costs two FFTs a channel and no inversion.

use std::ops::Range;

use multiversion::multiversion;
use rustfft::num_complex::Complex32;

use super::fft::Fft2;
use super::sample::Sample;

/// The fixed settings of a filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaskedSettings {
    /// Samples of the first frame, the true one and altered ones, which are never forgotten.
    pub looks: usize,
    /// Samples remembered at the most, more than the looks.
    pub memory: usize,
    /// Weight that the first sample never falls below.
    pub first_weight: f32,
    /// Weight of the filter's norm, relative to the energy of the first sample's spectra as [`MaskedFilter`] sums it.
    pub regularisation: f32,
}

/// The filter and the samples it was trained on.
pub struct MaskedFilter {
    settings: MaskedSettings,
    /// The channels of samples that it works on.
    channels: Range<usize>,
    /// Spectra of the remembered samples, `memory x channels x bins`, packed; those of the first frame come first.
    samples: Vec<Pack>,
    /// Weight of each remembered sample; they sum to 1.
    weights: Vec<f32>,
    /// Altered looks at the first frame whose samples have not come yet, the last ones; the true sample stands in for
    /// them.
    awaited: usize,
    /// The weights that the samples have until all looks have come.
    present: Vec<f32>,
    /// Spectrum of the label, packed.
    label: Vec<Pack>,
    /// Indices of the cells where the filter may differ from zero.
    support: Vec<u32>,
    /// Filter coefficients, `channels x support`.
    coefficients: Vec<f32>,
    /// Spectra of the filter, `channels x bins`.
    filter: Vec<Complex32>,
    solver: Solver,
    /// Steps of conjugate gradients since the start.
    #[cfg(test)]
    pub(crate) steps: usize,
}

/// Vectors of the conjugate gradient method and scratch for the transforms.
#[derive(Default)]
struct Solver {
    residual: Vec<f32>,
    direction: Vec<f32>,
    image: Vec<f32>,
    map: Vec<f32>,
    spectra: Vec<Complex32>,
    sums: Vec<Complex32>,
    /// A filter that the normal equations are applied to and what comes of it, `channels x bins`, packed.
    packed_filter: Vec<Pack>,
    product: Vec<Pack>,
}

/// Bins of a pack.
const LANES: usize = 8;

/// The values of neighbouring bins, real and imaginary parts apart, as vector units like them. Bins beyond the last are
/// 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Pack {
    re: [f32; LANES],
    im: [f32; LANES],
}

impl Pack {
    fn of(values: &[Complex32]) -> Self {
        let mut pack = Self::default();
        for (i, value) in values.iter().enumerate() {
            (pack.re[i], pack.im[i]) = (value.re, value.im);
        }
        pack
    }

    /// Adds `a conj(b)`.
    #[inline(always)]
    fn add_product(&mut self, a: &Self, b: &Self) {
        for i in 0..LANES {
            self.re[i] += a.re[i] * b.re[i] + a.im[i] * b.im[i];
            self.im[i] += a.im[i] * b.re[i] - a.re[i] * b.im[i];
        }
    }

    #[inline(always)]
    fn times(&self, factor: f32) -> Self {
        Self { re: self.re.map(|v| v * factor), im: self.im.map(|v| v * factor) }
    }
}

/// The packs of spectra of `bins` bins each.
fn packs(spectra: &[Complex32], bins: usize) -> impl Iterator<Item = Pack> {
    spectra.chunks_exact(bins).flat_map(|spectrum| spectrum.chunks(LANES).map(Pack::of))
}

/// The spectra of `bins` bins each that packs hold.
fn unpack(packs: &[Pack], bins: usize, spectra: &mut [Complex32]) {
    for (packs, spectrum) in packs.chunks_exact(bins.div_ceil(LANES)).zip(spectra.chunks_exact_mut(bins)) {
        for (pack, values) in packs.iter().zip(spectrum.chunks_mut(LANES)) {
            let parts = pack.re.iter().zip(&pack.im);
            values.iter_mut().zip(parts).for_each(|(value, (&re, &im))| *value = Complex32 { re, im });
        }
    }
}

impl MaskedFilter {
    /// An untrained filter on these channels of samples. `label` and `mask` are maps of the shape of `fft`.
    pub fn new(settings: MaskedSettings, fft: &mut Fft2, channels: Range<usize>, label: &[f32], mask: &[f32]) -> Self {
        let mut spectrum = vec![Complex32::default(); fft.bins()];
        fft.forward(label, &mut spectrum);
        let support: Vec<u32> = (0..mask.len() as u32).filter(|&i| mask[i as usize] > 0.0).collect();
        let unknowns = channels.len() * support.len();
        let size = channels.len() * fft.bins().div_ceil(LANES);
        Self {
            settings,
            filter: vec![Complex32::default(); channels.len() * fft.bins()],
            samples: Vec::with_capacity(settings.memory * size),
            weights: Vec::with_capacity(settings.memory),
            awaited: 0,
            present: Vec::with_capacity(settings.memory),
            label: packs(&spectrum, fft.bins()).collect(),
            coefficients: vec![0.0; unknowns],
            solver: Solver {
                residual: vec![0.0; unknowns],
                direction: vec![0.0; unknowns],
                image: vec![0.0; unknowns],
                map: vec![0.0; fft.cells()],
                spectra: vec![Complex32::default(); channels.len() * fft.bins()],
                sums: vec![Complex32::default(); fft.bins()],
                packed_filter: vec![Pack::default(); size],
                product: vec![Pack::default(); size],
            },
            support,
            channels,
            #[cfg(test)]
            steps: 0,
        }
    }

    /// What a sample has in the channels of this filter.
    fn own<'a>(&self, sample: &'a Sample) -> &'a [Complex32] {
        let bins = self.solver.sums.len();
        &sample.spectra[self.channels.start * bins..self.channels.end * bins]
    }

    /// Samples in the memory.
    pub fn remembered(&self) -> usize {
        self.weights.len()
    }

    /// Puts a sample into the memory with weight `learning_rate` (the first: 1), without training. When the memory
    /// is full, the lightest sample that is not of the first frame gives way.
    ///
    /// # Panics
    /// Where the sample lacks channels of this filter, or a full memory holds nothing but the first frame.
    pub fn remember(&mut self, sample: &Sample, learning_rate: f32) {
        let slot = self.take_slot(learning_rate);
        self.fill(slot, sample);
        self.weigh();
    }

    /// Makes room for altered looks at the first frame, whose sample has been remembered: as if each had been
    /// remembered by now, at these rates. Until [`remember_look`](Self::remember_look) brings one, the true sample has
    /// its weight.
    pub fn await_looks(&mut self, rates: impl IntoIterator<Item = f32>) {
        for rate in rates {
            self.take_slot(rate);
            self.awaited += 1;
        }
        self.samples.resize(self.weights.len() * self.solver.product.len(), Pack::default());
        self.weigh();
    }

    /// Puts the sample of the next look that is awaited into its place, without training.
    ///
    /// # Panics
    /// Where no look is awaited, or the sample lacks channels of this filter.
    pub fn remember_look(&mut self, sample: &Sample) {
        let slot = self.settings.looks - self.awaited;
        self.fill(slot, sample);
        self.awaited -= 1;
        self.weigh();
    }

    /// The place of a new sample of weight `learning_rate` (the first: 1), which the others give room to.
    fn take_slot(&mut self, learning_rate: f32) -> usize {
        if self.weights.is_empty() {
            self.weights.push(1.0);
            return 0;
        }
        self.weights.iter_mut().for_each(|w| *w *= 1.0 - learning_rate);
        let slot = if self.weights.len() < self.settings.memory {
            self.weights.push(learning_rate);
            self.weights.len() - 1
        } else {
            let lightest = (self.settings.looks..self.weights.len())
                .min_by(|&a, &b| self.weights[a].total_cmp(&self.weights[b]))
                .expect("a memory has room for more than the first frame");
            self.weights[lightest] = learning_rate;
            lightest
        };
        self.weights[0] = self.weights[0].max(self.settings.first_weight);
        let sum: f32 = self.weights.iter().sum();
        self.weights.iter_mut().for_each(|w| *w /= sum);
        slot
    }

    /// Writes a sample to its place, at most behind the last.
    fn fill(&mut self, slot: usize, sample: &Sample) {
        let size = self.solver.product.len();
        let packed = packs(self.own(sample), self.solver.sums.len());
        if slot * size == self.samples.len() {
            self.samples.extend(packed);
        } else {
            self.samples[slot * size..(slot + 1) * size].iter_mut().zip(packed).for_each(|(old, new)| *old = new);
        }
    }

    /// Gives what is awaited to the true sample.
    fn weigh(&mut self) {
        self.present.clear();
        self.present.extend_from_slice(&self.weights);
        let looks = self.settings.looks;
        for awaited in looks - self.awaited..looks {
            self.present[0] += std::mem::take(&mut self.present[awaited]);
        }
    }

    /// Adds a sample and improves the filter by `steps` of conjugate gradients.
    ///
    /// # Panics
    /// As [`remember`](Self::remember) and [`train`](Self::train).
    pub fn learn(&mut self, fft: &mut Fft2, sample: &Sample, learning_rate: f32, steps: usize) {
        self.remember(sample, learning_rate);
        self.train(fft, steps);
    }

    /// Improves the filter on the memory by `steps` of conjugate gradients.
    ///
    /// # Panics
    /// Where no sample has been remembered, or `fft` is not of the filter's shape.
    pub fn train(&mut self, fft: &mut Fft2, steps: usize) {
        let lambda = self.settings.regularisation * self.energy(fft);
        self.right_hand_side(fft);
        // residual = b - A f, direction = residual
        let mut coefficients = std::mem::take(&mut self.coefficients);
        self.apply(fft, &coefficients, lambda);
        for (r, a) in self.solver.residual.iter_mut().zip(&self.solver.image) {
            *r -= a;
        }
        self.solver.direction.copy_from_slice(&self.solver.residual);
        let mut rho = dot(&self.solver.residual, &self.solver.residual);
        for _ in 0..steps {
            if rho <= f64::from(f32::MIN_POSITIVE) {
                break;
            }
            #[cfg(test)]
            {
                self.steps += 1;
            }
            let direction = std::mem::take(&mut self.solver.direction);
            self.apply(fft, &direction, lambda);
            self.solver.direction = direction;
            let Solver { residual, direction, image, .. } = &mut self.solver;
            let alpha = (rho / dot(direction, image)) as f32;
            coefficients.iter_mut().zip(direction.iter()).for_each(|(f, d)| *f += alpha * d);
            residual.iter_mut().zip(image.iter()).for_each(|(r, a)| *r -= alpha * a);
            let next = dot(residual, residual);
            let beta = (next / rho) as f32;
            direction.iter_mut().zip(residual.iter()).for_each(|(d, r)| *d = r + beta * *d);
            rho = next;
        }
        let mut filter = std::mem::take(&mut self.filter);
        self.transform(fft, &coefficients, &mut filter);
        self.filter = filter;
        self.coefficients = coefficients;
    }

    /// The response map to a sample: 1 at the peak for what the filter was trained to answer.
    ///
    /// # Panics
    /// Where the sample lacks channels of this filter, or `fft`, the sample and the map are not of the filter's shape.
    pub fn respond(&mut self, fft: &mut Fft2, sample: &Sample, response: &mut [f32]) {
        correlate(&self.filter, self.own(sample), &mut self.solver.sums);
        fft.inverse(&self.solver.sums, response);
    }

    /// The scale of the normal equations: the energy of the first sample's spectra, over the bins that are kept (half
    /// of them, for maps are real), divided by channels and cells. That is about half of what a channel's cells hold
    /// together.
    fn energy(&self, fft: &Fft2) -> f32 {
        let first = &self.samples[..self.solver.product.len()];
        let sum: f32 = first.iter().flat_map(|pack| pack.re.iter().chain(&pack.im)).map(|v| v * v).sum();
        sum / (self.channels.len() * fft.cells()) as f32
    }

    /// b = sum_k a_k x_k * y on the support, into the residual.
    fn right_hand_side(&mut self, fft: &mut Fft2) {
        let Solver { spectra, map, residual, product, .. } = &mut self.solver;
        product.fill(Pack::default());
        for (sample, &weight) in self.samples.chunks_exact(product.len()).zip(&self.present).filter(|(_, w)| **w > 0.0)
        {
            accumulate(product, sample, &self.label, weight);
        }
        unpack(product, fft.bins(), spectra);
        gather(fft, spectra, map, &self.support, residual);
    }

    /// image = A f with A = sum_k a_k X_k^T X_k + lambda, confined to the support.
    fn apply(&mut self, fft: &mut Fft2, coefficients: &[f32], lambda: f32) {
        let mut filter = std::mem::take(&mut self.filter);
        self.transform(fft, coefficients, &mut filter);
        let Solver { spectra, map, image, packed_filter, product, .. } = &mut self.solver;
        packed_filter.iter_mut().zip(packs(&filter, fft.bins())).for_each(|(old, new)| *old = new);
        normal_product(&self.samples, &self.present, packed_filter, self.label.len(), product);
        unpack(product, fft.bins(), spectra);
        gather(fft, spectra, map, &self.support, image);
        image.iter_mut().zip(coefficients).for_each(|(i, f)| *i += lambda * f);
        self.filter = filter;
    }

    /// Spectra of the filter whose coefficients on the support are given.
    fn transform(&mut self, fft: &mut Fft2, coefficients: &[f32], filter: &mut [Complex32]) {
        let map = &mut self.solver.map;
        let channels = coefficients.chunks_exact(self.support.len());
        for (values, spectrum) in channels.zip(filter.chunks_exact_mut(fft.bins())) {
            map.fill(0.0);
            for (&cell, &value) in self.support.iter().zip(values) {
                map[cell as usize] = value;
            }
            fft.forward(map, spectrum);
        }
    }
}

/// sums = sum over channels of conj(filter) x sample.
#[multiversion(targets("x86_64+avx2+fma"))]
fn correlate(filter: &[Complex32], sample: &[Complex32], sums: &mut [Complex32]) {
    sums.fill(Complex32::default());
    for (f, x) in filter.chunks_exact(sums.len()).zip(sample.chunks_exact(sums.len())) {
        for ((s, f), x) in sums.iter_mut().zip(f).zip(x) {
            s.re += f.re * x.re + f.im * x.im;
            s.im += f.re * x.im - f.im * x.re;
        }
    }
}

/// Packs that are worked on at a time: those of all channels of a sample, of the filter and of the product fit the
/// first-level cache together, so that the samples are read from memory once.
const BLOCK: usize = 4;

/// product = sum_k w_k x_k conj(sum_d conj(f_d) x_kd): the normal equations applied to a filter, of `length` packs a
/// channel. Everything is done bin by bin, so they are taken in blocks.
#[multiversion(targets("x86_64+avx2+fma"))]
fn normal_product(samples: &[Pack], weights: &[f32], filter: &[Pack], length: usize, product: &mut [Pack]) {
    product.fill(Pack::default());
    for start in (0..length).step_by(BLOCK) {
        let block = start..length.min(start + BLOCK);
        for (sample, &weight) in samples.chunks_exact(filter.len()).zip(weights).filter(|(_, w)| **w > 0.0) {
            let mut sums = [Pack::default(); BLOCK];
            for (f, x) in filter.chunks_exact(length).zip(sample.chunks_exact(length)) {
                for ((s, f), x) in sums.iter_mut().zip(&f[block.clone()]).zip(&x[block.clone()]) {
                    s.add_product(x, f);
                }
            }
            let sums = sums.map(|sum| sum.times(weight));
            for (p, x) in product.chunks_exact_mut(length).zip(sample.chunks_exact(length)) {
                for ((p, x), s) in p[block.clone()].iter_mut().zip(&x[block.clone()]).zip(&sums) {
                    p.add_product(x, s);
                }
            }
        }
    }
}

/// product += weight x sample x conj(response), channel by channel.
#[multiversion(targets("x86_64+avx2+fma"))]
fn accumulate(product: &mut [Pack], sample: &[Pack], response: &[Pack], weight: f32) {
    for (out, x) in product.chunks_exact_mut(response.len()).zip(sample.chunks_exact(response.len())) {
        for ((o, x), r) in out.iter_mut().zip(x).zip(response) {
            o.add_product(&x.times(weight), r);
        }
    }
}

/// The values on the support of the maps whose spectra are given.
fn gather(fft: &mut Fft2, spectra: &[Complex32], map: &mut [f32], support: &[u32], out: &mut [f32]) {
    for (spectrum, values) in spectra.chunks_exact(fft.bins()).zip(out.chunks_exact_mut(support.len())) {
        fft.inverse(spectrum, map);
        values.iter_mut().zip(support).for_each(|(v, &cell)| *v = map[cell as usize]);
    }
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn dot(a: &[f32], b: &[f32]) -> f64 {
    // Sums of a thousand products in f32, the whole in f64: as exact as needed and still vectorised.
    a.chunks(1024)
        .zip(b.chunks(1024))
        .map(|(a, b)| {
            let mut lanes = [0.0f32; 8];
            for (a, b) in a.chunks(8).zip(b.chunks(8)) {
                a.iter().zip(b).zip(&mut lanes).for_each(|((a, b), l)| *l += a * b);
            }
            f64::from(lanes.iter().sum::<f32>())
        })
        .sum()
}

#[cfg(test)]
mod tests;
