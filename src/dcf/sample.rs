//! The spectra of all feature channels of one search window: what filters are trained on and applied to.

use std::ops::Range;

use rustfft::num_complex::Complex32;

use super::fft::Fft2;

/// Spectra of the windowed feature channels, `channels x bins`, layer after layer.
#[derive(Clone, Debug, Default)]
pub struct Sample {
    /// The channels that make up each layer.
    pub layers: Vec<Range<usize>>,
    /// The spectra, channel after channel.
    pub spectra: Vec<Complex32>,
    /// The phase ramp of a shift, kept for its memory.
    ramp: Vec<Complex32>,
}

impl Sample {
    /// A sample of these layers and spectra.
    pub fn new(layers: Vec<Range<usize>>, spectra: Vec<Complex32>) -> Self {
        Self { layers, spectra, ramp: Vec::new() }
    }

    /// Moves what the sample shows by `[x, y]` cells, cyclically: each spectrum is multiplied by a phase ramp.
    pub fn shift(&mut self, fft: &Fft2, by: [f64; 2]) {
        let (rows, cols) = (fft.rows() as f64, fft.cols() as f64);
        self.ramp.clear();
        self.ramp.extend((0..fft.bins()).map(|bin| {
            let (kx, ky) = fft.wave_numbers(bin);
            let turns = f64::from(kx) * by[0] / cols + f64::from(ky) * by[1] / rows;
            Complex32::cis((-std::f64::consts::TAU * turns) as f32)
        }));
        for spectrum in self.spectra.chunks_exact_mut(fft.bins()) {
            spectrum.iter_mut().zip(&self.ramp).for_each(|(v, r)| *v *= r);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shift_by_whole_cells_rolls_the_map() {
        let (rows, cols) = (6, 8);
        let mut fft = Fft2::new(rows, cols);
        let map: Vec<f32> = (0..48).map(|i| ((i * 29) % 17) as f32).collect();
        let mut sample = Sample::new(std::iter::once(0..1).collect(), vec![Complex32::default(); fft.bins()]);
        fft.forward(&map, &mut sample.spectra);
        sample.shift(&fft, [2.0, -1.0]);
        let mut moved = vec![0.0; 48];
        fft.inverse(&sample.spectra, &mut moved);
        for r in 0..rows {
            for c in 0..cols {
                let source = map[(r + 1) % rows * cols + (c + cols - 2) % cols];
                assert!((moved[r * cols + c] - source).abs() < 1e-4);
            }
        }
    }
}
