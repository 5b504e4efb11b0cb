//! Histogram of oriented gradients in Felzenszwalb's variant (Felzenszwalb, Girshick, McAllester and Ramanan,
//! *Object detection with discriminatively trained part-based models*, PAMI 2010, section 6).
//!
//! 18 contrast-sensitive orientations, 9 contrast-insensitive ones and 4 texture energies a cell: 31 channels.
//! The map has a row and a column for each cell of the patch: at the border, where a block of 2 x 2 cells reaches
//! beyond the patch, the outermost cells count twice.

use std::sync::LazyLock;

use multiversion::multiversion;

use super::{CELL, FeatureMap};
use crate::crop::Patch;

/// Channels of the map: 18 signed orientations, 9 unsigned ones, 4 texture energies.
pub const CHANNELS: usize = SIGNED + UNSIGNED + 4;

const UNSIGNED: usize = 9;
const SIGNED: usize = 2 * UNSIGNED;
/// Histogram entries above this are cut after normalisation, so that no single edge dominates.
const TRUNCATE: f32 = 0.2;
/// Keeps the norm of a flat block above zero.
const EPSILON: f32 = 1e-4;
/// Weight of a texture energy: 1 / sqrt(18).
const TEXTURE_WEIGHT: f32 = 0.235_702_26;

/// Differences of 8-bit intensities lie in -255..=255.
const DIFFERENCES: usize = 511;

/// The signed orientation bin of each gradient `(dx, dy)`: the one of 18 directions with the largest projection.
static BINS: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let mut bins = Vec::with_capacity(DIFFERENCES * DIFFERENCES);
    for dy in -255i32..=255 {
        for dx in -255i32..=255 {
            bins.push(bin(dx as f32, dy as f32));
        }
    }
    bins
});

fn bin(dx: f32, dy: f32) -> u8 {
    let (mut best, mut found) = (0.0, 0);
    for o in 0..UNSIGNED {
        let angle = o as f32 * std::f32::consts::PI / UNSIGNED as f32;
        let dot = angle.cos() * dx + angle.sin() * dy;
        if dot > best {
            (best, found) = (dot, o);
        } else if -dot > best {
            (best, found) = (-dot, o + UNSIGNED);
        }
    }
    found as u8
}

/// Computes HOG, with scratch that is reused from patch to patch.
#[derive(Debug, Default)]
pub struct Hog {
    /// Signed histograms: a cell after the other, with a margin of one cell on each side that gathers the votes
    /// beyond the patch.
    histograms: Vec<[f32; SIGNED]>,
    /// Squared norm of the unsigned histogram of each cell.
    energy: Vec<f32>,
    /// Inverse norm of each block of 2 x 2 cells.
    inverse: Vec<f32>,
    /// Gradient of one row of pixels: squared magnitude, magnitude and index of the orientation bin.
    squared: Vec<i32>,
    magnitude: Vec<f32>,
    direction: Vec<u32>,
}

impl Hog {
    /// Fills `map` with 31 channels on a grid of [`CELL`]-pixel cells. The sides of the patch are multiples of
    /// [`CELL`].
    pub fn compute(&mut self, patch: &Patch, map: &mut FeatureMap) {
        let (rows, cols) = (patch.height / CELL, patch.width / CELL);
        map.resize(rows, cols, CHANNELS);
        self.vote(patch, rows, cols);
        self.block_norms(rows, cols);
        self.normalise(rows, cols, map);
    }

    /// Each pixel votes with its gradient's magnitude for its orientation, shared linearly among the four
    /// nearest cells.
    fn vote(&mut self, patch: &Patch, rows: usize, cols: usize) {
        let stride = cols + 2;
        self.histograms.clear();
        self.histograms.resize(stride * (rows + 2), [0.0; SIGNED]);
        self.squared.resize(patch.width, 0);
        self.magnitude.resize(patch.width, 0.0);
        self.direction.resize(patch.width, 0);
        for y in 0..patch.height {
            self.gradient(patch, y);
            let (row, wy) = share(y);
            let (above, below) = self.histograms[row * stride..].split_at_mut(stride);
            for x in 0..patch.width {
                let bin = usize::from(BINS[self.direction[x] as usize]);
                let (col, wx) = share(x);
                let (upper, lower) = (self.magnitude[x] * (1.0 - wy), self.magnitude[x] * wy);
                above[col][bin] += upper * (1.0 - wx);
                above[col + 1][bin] += upper * wx;
                below[col][bin] += lower * (1.0 - wx);
                below[col + 1][bin] += lower * wx;
            }
        }
    }

    /// Gradients of row `y` by central differences (one-sided at the border), each from the plane in which it is
    /// strongest.
    fn gradient(&mut self, patch: &Patch, y: usize) {
        let (w, h) = (patch.width, patch.height);
        let (up, down) = (y.saturating_sub(1), (y + 1).min(h - 1));
        self.squared.fill(-1);
        for plane in patch.planes() {
            let row = |y: usize| &plane[y * w..(y + 1) * w];
            strongest(row(y), row(up), row(down), &mut self.squared, &mut self.direction);
        }
        self.magnitude.iter_mut().zip(&self.squared).for_each(|(m, s)| *m = (*s as f32).sqrt());
    }

    /// The inverse norms of the blocks, `(rows + 1) x (cols + 1)`: block (r, c) has cell (r, c) as its lower
    /// right.
    fn block_norms(&mut self, rows: usize, cols: usize) {
        let stride = cols + 2;
        self.energy.clear();
        for row in 0..rows {
            for col in 0..cols {
                let h = &self.histograms[(row + 1) * stride + col + 1];
                let energy = (0..UNSIGNED).map(|o| (h[o] + h[o + UNSIGNED]).powi(2)).sum();
                self.energy.push(energy);
            }
        }
        let energy = |r: usize, c: usize| self.energy[r * cols + c];
        self.inverse.clear();
        for r in 0..=rows {
            let (r0, r1) = (r.saturating_sub(1), r.min(rows - 1));
            for c in 0..=cols {
                let (c0, c1) = (c.saturating_sub(1), c.min(cols - 1));
                let sum = energy(r0, c0) + energy(r0, c1) + energy(r1, c0) + energy(r1, c1);
                self.inverse.push(1.0 / (sum + EPSILON).sqrt());
            }
        }
    }

    fn normalise(&self, rows: usize, cols: usize, map: &mut FeatureMap) {
        let stride = cols + 2;
        let cells = rows * cols;
        for row in 0..rows {
            for col in 0..cols {
                let h = &self.histograms[(row + 1) * stride + col + 1];
                let block = |r: usize, c: usize| self.inverse[r * (cols + 1) + c];
                let norms = [block(row, col), block(row, col + 1), block(row + 1, col), block(row + 1, col + 1)];
                let mut texture = [0.0; 4];
                let mut signed = [0.0; SIGNED];
                for (norm, texture) in norms.iter().zip(&mut texture) {
                    for (sum, entry) in signed.iter_mut().zip(h) {
                        let v = (entry * norm).min(TRUNCATE);
                        *sum += v;
                        *texture += v;
                    }
                }
                let at = row * cols + col;
                for (o, sum) in signed.iter().enumerate() {
                    map.data[o * cells + at] = 0.5 * sum;
                }
                for o in 0..UNSIGNED {
                    let sum = h[o] + h[o + UNSIGNED];
                    let v: f32 = norms.iter().map(|n| (sum * n).min(TRUNCATE)).sum();
                    map.data[(SIGNED + o) * cells + at] = 0.5 * v;
                }
                for (i, t) in texture.iter().enumerate() {
                    map.data[(SIGNED + UNSIGNED + i) * cells + at] = TEXTURE_WEIGHT * t;
                }
            }
        }
    }
}

/// Takes over the gradients of one plane's row, with the rows above and below, where they are stronger than those there
/// are.
#[multiversion(targets("x86_64+avx2"))]
fn strongest(row: &[u8], above: &[u8], below: &[u8], squared: &mut [i32], direction: &mut [u32]) {
    let w = row.len();
    let (above, below, squared, direction) = (&above[..w], &below[..w], &mut squared[..w], &mut direction[..w]);
    for x in 0..w {
        let (left, right) = (x.saturating_sub(1), (x + 1).min(w - 1));
        let dx = i32::from(row[right]) - i32::from(row[left]);
        let dy = i32::from(below[x]) - i32::from(above[x]);
        let strength = dx * dx + dy * dy;
        let index = ((dy + 255) * DIFFERENCES as i32 + dx + 255) as u32;
        let stronger = strength > squared[x];
        squared[x] = if stronger { strength } else { squared[x] };
        direction[x] = if stronger { index } else { direction[x] };
    }
}

/// The first of the two cells (counted with the margin) that share a pixel, and the weight of the second.
#[inline]
fn share(pixel: usize) -> (usize, f32) {
    let shifted = pixel + CELL / 2;
    let weight = ((shifted % CELL) as f32 + 0.5) / CELL as f32;
    (shifted / CELL, weight)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    use super::*;
    use crate::crop::Cropper;
    use crate::frame::{Encoding, Frame};

    fn noise(width: usize, height: usize, seed: u32) -> Patch {
        let mut state = seed;
        let data: Vec<u8> = (0..width * height * 3)
            .map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 24) as u8
            })
            .collect();
        let frame = Frame::new(&data, width as u32, height as u32, width * 3, Encoding::Rgb8, None).unwrap();
        let mut patch = Patch::default();
        Cropper::default().crop(&frame, &frame.bounds(), width, height, &mut patch);
        patch
    }

    /// The definition, written out with no regard for speed, in f64.
    fn reference(patch: &Patch, row: usize, col: usize) -> Vec<f64> {
        let (rows, cols) = ((patch.height / CELL) as i64, (patch.width / CELL) as i64);
        let pixel = |x: i64, y: i64, p: usize| {
            let x = x.clamp(0, patch.width as i64 - 1) as usize;
            let y = y.clamp(0, patch.height as i64 - 1) as usize;
            f64::from(patch.rgb(x, y)[p])
        };
        let histogram = |r: i64, c: i64| {
            let (r, c) = (r.clamp(0, rows - 1), c.clamp(0, cols - 1));
            let mut h = [0.0f64; SIGNED];
            for y in 0..patch.height as i64 {
                for x in 0..patch.width as i64 {
                    let distance = |p: i64, cell: i64| {
                        let d = (p as f64 + 0.5) - (cell as f64 + 0.5) * CELL as f64;
                        (1.0 - d.abs() / CELL as f64).max(0.0)
                    };
                    let weight = distance(x, c) * distance(y, r);
                    if weight == 0.0 {
                        continue;
                    }
                    let mut best = (-1.0, 0.0, 0.0);
                    for p in 0..3 {
                        let dx = pixel(x + 1, y, p) - pixel(x - 1, y, p);
                        let dy = pixel(x, y + 1, p) - pixel(x, y - 1, p);
                        if dx.hypot(dy) > best.0 {
                            best = (dx.hypot(dy), dx, dy);
                        }
                    }
                    h[usize::from(bin(best.1 as f32, best.2 as f32))] += weight * best.0;
                }
            }
            h
        };
        let (r, c) = (row as i64, col as i64);
        let unsigned = |h: &[f64; SIGNED], o: usize| h[o] + h[o + UNSIGNED];
        let norm = |r0: i64, c0: i64| {
            let mut sum = f64::from(EPSILON);
            for (r, c) in [(r0, c0), (r0, c0 + 1), (r0 + 1, c0), (r0 + 1, c0 + 1)] {
                let h = histogram(r, c);
                sum += (0..UNSIGNED).map(|o| unsigned(&h, o).powi(2)).sum::<f64>();
            }
            1.0 / sum.sqrt()
        };
        let norms = [norm(r - 1, c - 1), norm(r - 1, c), norm(r, c - 1), norm(r, c)];
        let h = histogram(r, c);
        let cut = |v: f64, n: f64| (v * n).min(f64::from(TRUNCATE));
        let mut out: Vec<f64> = (0..SIGNED).map(|o| 0.5 * norms.iter().map(|n| cut(h[o], *n)).sum::<f64>()).collect();
        out.extend((0..UNSIGNED).map(|o| 0.5 * norms.iter().map(|n| cut(unsigned(&h, o), *n)).sum::<f64>()));
        out.extend(norms.iter().map(|n| (0..SIGNED).map(|o| cut(h[o], *n)).sum::<f64>() / 18f64.sqrt()));
        out
    }

    fn agrees(rows: usize, cols: usize, seed: u32) {
        let patch = noise(cols * CELL, rows * CELL, seed);
        let mut map = FeatureMap::default();
        Hog::default().compute(&patch, &mut map);
        assert_eq!((map.rows, map.cols, map.channels), (rows, cols, CHANNELS));
        for row in 0..rows {
            for col in 0..cols {
                for (channel, want) in reference(&patch, row, col).into_iter().enumerate() {
                    let got = f64::from(map.plane(channel)[row * cols + col]);
                    assert!((got - want).abs() < 1e-4, "{row} {col} {channel}: {got} {want}");
                }
            }
        }
    }

    #[test]
    fn hog_agrees_with_its_definition() {
        agrees(5, 6, 1);
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            rng_seed: RngSeed::Fixed(1), failure_persistence: None, ..ProptestConfig::with_cases(16)
        })]

        #[test]
        fn a_patch_of_any_size_agrees_with_the_definition(rows in 1usize..7, cols in 1usize..7, seed: u32) {
            agrees(rows, cols, seed);
        }
    }

    #[test]
    fn a_vertical_edge_falls_into_the_horizontal_orientation() {
        let data: Vec<u8> = (0..16 * 16).map(|i| if i % 16 < 8 { 20 } else { 220 }).collect();
        let frame = Frame::new(&data, 16, 16, 16, Encoding::Mono8, None).unwrap();
        let mut patch = Patch::default();
        Cropper::default().crop(&frame, &frame.bounds(), 16, 16, &mut patch);
        let mut map = FeatureMap::default();
        Hog::default().compute(&patch, &mut map);
        let cell = |channel: usize| map.plane(channel)[4 + 1];
        assert_eq!(cell(0), 2.0 * TRUNCATE, "dark to bright along +x is bin 0 and saturates in all four blocks");
        assert_eq!(cell(SIGNED), 2.0 * TRUNCATE);
        assert!((1..SIGNED).all(|o| cell(o) == 0.0));
    }
}
