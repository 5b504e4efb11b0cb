//! The masked filter against dense matrices, direct sums and its own definition.

use super::*;
use crate::dcf::response::highest;
use crate::dcf::window::{label, mask};

const ROWS: usize = 6;
const COLS: usize = 8;
const CHANNELS: usize = 2;

fn maps(seed: usize) -> Vec<f32> {
    (0..CHANNELS * ROWS * COLS).map(|i| ((i * i * 13 + i * (7 + seed) + seed * 31) % 53) as f32 / 53.0 - 0.5).collect()
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
