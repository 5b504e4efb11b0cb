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
mod tests {
    use super::*;
    use crate::dcf::response::highest;
    use crate::dcf::window::{label, mask};

    const ROWS: usize = 6;
    const COLS: usize = 8;
    const CHANNELS: usize = 2;

    fn maps(seed: usize) -> Vec<f32> {
        (0..CHANNELS * ROWS * COLS)
            .map(|i| ((i * i * 13 + i * (7 + seed) + seed * 31) % 53) as f32 / 53.0 - 0.5)
            .collect()
    }

    fn sample(fft: &mut Fft2, maps: &[f32]) -> Sample {
        let mut spectra = vec![Complex32::default(); CHANNELS * fft.bins()];
        for (map, spectrum) in maps.chunks_exact(ROWS * COLS).zip(spectra.chunks_exact_mut(fft.bins())) {
            fft.forward(map, spectrum);
        }
        Sample::new(std::iter::once(0..CHANNELS).collect(), spectra)
    }

    const SETTINGS: MaskedSettings = MaskedSettings { looks: 1, memory: 3, first_weight: 0.2, regularisation: 0.05 };
    const LEARNING_RATE: f32 = 0.3;

    /// The energy of the spectra of some maps, by the sums that define them: over the bins up to the middle column,
    /// divided by channels and cells.
    fn half_spectrum_energy(maps: &[f32]) -> f64 {
        let bin = |map: &[f32], ky: usize, kx: usize| {
            let term = |(i, &v): (usize, &f32)| {
                let turns = (ky * (i / COLS)) as f64 / ROWS as f64 + (kx * (i % COLS)) as f64 / COLS as f64;
                let (sin, cos) = (std::f64::consts::TAU * turns).sin_cos();
                [f64::from(v) * cos, -f64::from(v) * sin]
            };
            let [re, im] = map.iter().enumerate().map(term).fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
            re * re + im * im
        };
        let bins = (0..ROWS).flat_map(|ky| (0..=COLS / 2).map(move |kx| (ky, kx)));
        let of = |map| bins.clone().map(|(ky, kx)| bin(map, ky, kx)).sum::<f64>();
        maps.chunks_exact(ROWS * COLS).map(of).sum::<f64>() / (CHANNELS * ROWS * COLS) as f64
    }

    /// The normal equations written out as a dense matrix in the spatial domain and solved directly.
    #[test]
    fn training_agrees_with_the_dense_least_squares_solution() {
        let mut fft = Fft2::new(ROWS, COLS);
        let (y, m) = (label(ROWS, COLS, 0.8), mask(ROWS, COLS, 4.0, 2.0));
        let mut filter = MaskedFilter::new(SETTINGS, &mut fft, 0..CHANNELS, &y, &m);
        let all: Vec<Vec<f32>> = (0..3).map(maps).collect();
        for maps in &all {
            let s = sample(&mut fft, maps);
            filter.learn(&mut fft, &s, LEARNING_RATE, 200);
        }
        let weights = [0.7 * 0.7, 0.3 * 0.7, 0.3];
        let support: Vec<usize> = (0..ROWS * COLS).filter(|&i| m[i] > 0.0).collect();
        let n = CHANNELS * support.len();
        let lambda = f64::from(SETTINGS.regularisation) * half_spectrum_energy(&all[0]);
        let mut a = nalgebra::DMatrix::<f64>::identity(n, n) * lambda;
        let mut b = nalgebra::DVector::<f64>::zeros(n);
        for (maps, weight) in all.iter().zip(weights) {
            // Row of the design matrix for each displacement: x[n + m] for the unknown (channel, m).
            for (t, &wanted) in y.iter().enumerate() {
                let row: Vec<f64> = (0..n)
                    .map(|u| {
                        let (channel, cell) = (u / support.len(), support[u % support.len()]);
                        let r = (t / COLS + cell / COLS) % ROWS;
                        let c = (t % COLS + cell % COLS) % COLS;
                        f64::from(maps[channel * ROWS * COLS + r * COLS + c])
                    })
                    .collect();
                for i in 0..n {
                    b[i] += weight * row[i] * f64::from(wanted);
                    for j in 0..n {
                        a[(i, j)] += weight * row[i] * row[j];
                    }
                }
            }
        }
        let exact = a.lu().solve(&b).unwrap();
        for (got, want) in filter.coefficients.iter().zip(exact.iter()) {
            assert!((f64::from(*got) - want).abs() < 1e-4, "{got} {want}");
        }
    }

    #[test]
    fn the_response_follows_a_shifted_target() {
        let mut fft = Fft2::new(ROWS, COLS);
        let (y, m) = (label(ROWS, COLS, 0.8), mask(ROWS, COLS, 4.0, 4.0));
        let mut filter = MaskedFilter::new(SETTINGS, &mut fft, 0..CHANNELS, &y, &m);
        let mut s = sample(&mut fft, &maps(1));
        filter.learn(&mut fft, &s, 1.0, 50);
        s.shift(&fft, [2.0, -1.0]);
        let mut response = vec![0.0; ROWS * COLS];
        filter.respond(&mut fft, &s, &mut response);
        let peak = highest(&response, ROWS, COLS, false);
        assert_eq!(peak.displacement, [2.0, -1.0]);
        assert!(peak.value > 0.3, "{}", peak.value);
    }

    #[test]
    fn a_filter_on_some_channels_knows_nothing_of_the_others() {
        let mut fft = Fft2::new(ROWS, COLS);
        let (y, m) = (label(ROWS, COLS, 0.8), mask(ROWS, COLS, 4.0, 4.0));
        let whole = sample(&mut fft, &maps(1));
        let second = Sample::new(std::iter::once(0..1).collect(), whole.spectra[fft.bins()..].to_vec());
        let response = |fft: &mut Fft2, channels, sample: &Sample| {
            let mut filter = MaskedFilter::new(SETTINGS, fft, channels, &y, &m);
            filter.learn(fft, sample, 1.0, 20);
            let mut response = vec![0.0; ROWS * COLS];
            filter.respond(fft, sample, &mut response);
            response
        };
        assert_eq!(response(&mut fft, 1..2, &whole), response(&mut fft, 0..1, &second));
    }

    #[test]
    fn a_look_that_comes_late_is_learned_as_if_it_had_come_at_once() {
        let mut fft = Fft2::new(ROWS, COLS);
        let (y, m) = (label(ROWS, COLS, 0.8), mask(ROWS, COLS, 4.0, 4.0));
        let settings = MaskedSettings { looks: 3, memory: 4, ..SETTINGS };
        let all: Vec<Sample> = (0..6).map(|seed| sample(&mut fft, &maps(seed))).collect();
        let filter = |fft: &mut Fft2| MaskedFilter::new(settings, fft, 0..CHANNELS, &y, &m);
        let rates = [0.25, 0.4];
        let mut at_once = filter(&mut fft);
        at_once.remember(&all[0], 1.0);
        (0..2).for_each(|i| at_once.remember(&all[1 + i], rates[i]));
        let mut late = filter(&mut fft);
        late.remember(&all[0], 1.0);
        late.await_looks(rates);
        // Meanwhile it is a filter of the samples there are.
        assert_eq!(late.present, [1.0, 0.0, 0.0]);
        let mut alone = filter(&mut fft);
        alone.learn(&mut fft, &all[0], 1.0, 9);
        late.train(&mut fft, 9);
        assert_eq!(late.coefficients, alone.coefficients);
        // Others come and go, one before the first look, one between the looks, one after them.
        for (i, other) in all[3..].iter().enumerate() {
            at_once.remember(other, LEARNING_RATE);
            late.remember(other, LEARNING_RATE);
            assert!((late.present.iter().sum::<f32>() - 1.0).abs() < 1e-6, "{:?}", late.present);
            if i < 2 {
                late.remember_look(&all[1 + i]);
            }
        }
        assert_eq!((&late.samples, &late.present), (&at_once.samples, &at_once.weights));
        late.coefficients.fill(0.0);
        at_once.train(&mut fft, 9);
        late.train(&mut fft, 9);
        assert_eq!(late.coefficients, at_once.coefficients);
    }

    #[test]
    fn a_full_memory_drops_the_lightest_sample_and_keeps_those_of_the_first_frame() {
        let mut fft = Fft2::new(ROWS, COLS);
        let (y, m) = (label(ROWS, COLS, 0.8), mask(ROWS, COLS, 4.0, 4.0));
        for looks in [1, 2] {
            let mut filter = MaskedFilter::new(MaskedSettings { looks, ..SETTINGS }, &mut fft, 0..CHANNELS, &y, &m);
            for seed in 0..9 {
                let s = sample(&mut fft, &maps(seed));
                filter.remember(&s, 0.3);
                assert!((filter.weights.iter().sum::<f32>() - 1.0).abs() < 1e-6);
            }
            assert_eq!(filter.remembered(), 3);
            for look in 0..looks {
                let spectra = sample(&mut fft, &maps(look)).spectra;
                let packed: Vec<Pack> = packs(&spectra, fft.bins()).collect();
                assert_eq!(filter.samples[look * packed.len()..][..packed.len()], packed[..]);
            }
            assert!(filter.weights[0] > 0.15);
        }
    }
}
