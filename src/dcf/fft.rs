//! The two-dimensional Fourier transform of real maps, planned once for a shape.
//!
//! A map is row-major `rows x cols`. Its half spectrum is stored transposed, `(cols / 2 + 1) x rows`: bin
//! `kx * rows + ky`. What is done to spectra is done bin by bin, so the order matters to nobody else.

use std::sync::Arc;

use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use rustfft::{Fft, FftPlanner, num_complex::Complex32};

/// The plans and the scratch of one shape.
pub struct Fft2 {
    rows: usize,
    cols: usize,
    row_forward: Arc<dyn RealToComplex<f32>>,
    row_inverse: Arc<dyn ComplexToReal<f32>>,
    column_forward: Arc<dyn Fft<f32>>,
    column_inverse: Arc<dyn Fft<f32>>,
    line: Vec<f32>,
    half: Vec<Complex32>,
    columns: Vec<Complex32>,
    scratch: Vec<Complex32>,
}

impl Fft2 {
    /// Plans transforms of `rows x cols` maps.
    ///
    /// # Panics
    /// Where a side is 0.
    pub fn new(rows: usize, cols: usize) -> Self {
        assert!(rows > 0 && cols > 0, "a map of {rows} x {cols} has no transform");
        let mut real = RealFftPlanner::new();
        let mut complex = FftPlanner::new();
        let (row_forward, row_inverse) = (real.plan_fft_forward(cols), real.plan_fft_inverse(cols));
        let (column_forward, column_inverse) = (complex.plan_fft_forward(rows), complex.plan_fft_inverse(rows));
        let scratch = [
            row_forward.get_scratch_len(),
            row_inverse.get_scratch_len(),
            column_forward.get_inplace_scratch_len(),
            column_inverse.get_inplace_scratch_len(),
        ];
        let half = cols / 2 + 1;
        Self {
            rows,
            cols,
            row_forward,
            row_inverse,
            column_forward,
            column_inverse,
            line: vec![0.0; cols],
            half: vec![Complex32::default(); half],
            columns: vec![Complex32::default(); half * rows],
            scratch: vec![Complex32::default(); scratch.into_iter().max().unwrap_or(0)],
        }
    }

    /// Rows of a map.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Columns of a map.
    pub fn cols(&self) -> usize {
        self.cols
    }

    /// Values of a map.
    pub fn cells(&self) -> usize {
        self.rows * self.cols
    }

    /// Values of a half spectrum.
    pub fn bins(&self) -> usize {
        (self.cols / 2 + 1) * self.rows
    }

    /// Transforms a map, without scaling.
    ///
    /// # Panics
    /// Where the map does not hold [`cells`](Self::cells) values, or the spectrum not [`bins`](Self::bins).
    pub fn forward(&mut self, map: &[f32], spectrum: &mut [Complex32]) {
        assert_eq!((map.len(), spectrum.len()), (self.cells(), self.bins()));
        for (y, row) in map.chunks_exact(self.cols).enumerate() {
            self.line.copy_from_slice(row);
            self.row_forward
                .process_with_scratch(&mut self.line, &mut self.half, &mut self.scratch)
                .expect("buffers are of the planned lengths");
            for (kx, v) in self.half.iter().enumerate() {
                spectrum[kx * self.rows + y] = *v;
            }
        }
        self.column_forward.process_with_scratch(spectrum, &mut self.scratch);
    }

    /// Transforms back and scales by one over the number of cells, so that it undoes [`forward`](Self::forward).
    ///
    /// # Panics
    /// Where the map does not hold [`cells`](Self::cells) values, or the spectrum not [`bins`](Self::bins).
    pub fn inverse(&mut self, spectrum: &[Complex32], map: &mut [f32]) {
        assert_eq!((map.len(), spectrum.len()), (self.cells(), self.bins()));
        self.columns.copy_from_slice(spectrum);
        self.column_inverse.process_with_scratch(&mut self.columns, &mut self.scratch);
        let scale = 1.0 / self.cells() as f32;
        for (y, row) in map.chunks_exact_mut(self.cols).enumerate() {
            for (kx, v) in self.half.iter_mut().enumerate() {
                *v = self.columns[kx * self.rows + y] * scale;
            }
            // A real signal has real coefficients at zero and Nyquist; rounding leaves a trace there.
            self.half[0].im = 0.0;
            if self.cols.is_multiple_of(2) {
                self.half[self.cols / 2].im = 0.0;
            }
            self.row_inverse
                .process_with_scratch(&mut self.half, row, &mut self.scratch)
                .expect("buffers are of the planned lengths");
        }
    }

    /// The wave numbers `(kx, ky)` of a bin in cycles a map, ky signed.
    pub fn wave_numbers(&self, bin: usize) -> (f32, f32) {
        let (kx, ky) = (bin / self.rows, bin % self.rows);
        let signed = if 2 * ky > self.rows { ky as f32 - self.rows as f32 } else { ky as f32 };
        (kx as f32, signed)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;
    use rustfft::num_complex::Complex64;

    use super::*;

    fn wave(cells: usize) -> Vec<f32> {
        (0..cells).map(|i| ((i * i * 31 + i * 7) % 97) as f32 / 97.0 - 0.5).collect()
    }

    /// A bin of the transform of a map by its definition.
    fn double_sum(map: &[f32], [rows, cols]: [usize; 2], kx: usize, ky: usize) -> Complex64 {
        let term = |(i, v): (usize, &f32)| {
            let (y, x) = ((i / cols) as f64, (i % cols) as f64);
            let turn = x * kx as f64 / cols as f64 + y * ky as f64 / rows as f64;
            f64::from(*v) * Complex64::cis(-std::f64::consts::TAU * turn)
        };
        map.iter().enumerate().map(term).sum()
    }

    fn agrees(map: &[f32], rows: usize, cols: usize) {
        let mut fft = Fft2::new(rows, cols);
        let mut spectrum = vec![Complex32::default(); fft.bins()];
        fft.forward(map, &mut spectrum);
        for (bin, got) in spectrum.iter().enumerate() {
            let want = double_sum(map, [rows, cols], bin / rows, bin % rows);
            let off = (f64::from(got.re) - want.re).hypot(f64::from(got.im) - want.im);
            assert!(off < 1e-4, "{rows} x {cols}, bin {bin}: {got} {want}");
        }
        let mut back = vec![0.0; map.len()];
        fft.inverse(&spectrum, &mut back);
        assert!(back.iter().zip(map).all(|(a, b)| (a - b).abs() < 1e-6), "{rows} x {cols}");
    }

    #[test]
    fn the_transform_agrees_with_the_double_sum() {
        for (rows, cols) in [(6, 8), (5, 7), (4, 9), (1, 2)] {
            agrees(&wave(rows * cols), rows, cols);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            rng_seed: RngSeed::Fixed(1), failure_persistence: None, ..ProptestConfig::with_cases(64)
        })]

        #[test]
        fn a_map_of_any_shape_agrees_with_the_double_sum(
            rows in 1usize..24, cols in 1usize..24, values in prop::collection::vec(-0.5f32..0.5, 24 * 24),
        ) {
            agrees(&values[..rows * cols], rows, cols);
        }
    }
}
