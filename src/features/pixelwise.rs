//! Features of single pixels (ETEPF, *Implementation details*; Avidan, *Ensemble tracking*, PAMI 2007, section 2): the
//! histogram of oriented gradients of the neighbourhood, and red, green and blue.
//!
//! The neighbourhood is a square of `2 radius + 1` pixels. Eight unsigned orientations; each pixel of it votes with the
//! magnitude of its gradient for the nearest one, and the histogram is divided by the sum of all votes plus a floor, so
//! that flat places have small entries. Rows come one at a time, so that a picture of any size needs a few rows of
//! memory; sums over the neighbourhood run along with them, in integers, so that nothing is lost on the way.

use std::sync::LazyLock;

use multiversion::multiversion;

use crate::crop::Patch;

/// Orientations over half a turn.
pub const ORIENTATIONS: usize = 8;
/// Features of a pixel: the orientations, then red, green and blue.
pub const FEATURES: usize = ORIENTATIONS + 3;

/// Votes that are added to the sum before dividing, in intensities a pixel: noise does not look like texture.
const FLOOR: f32 = 4.0;
/// Differences of 8-bit intensities lie in -255..=255.
const DIFFERENCES: usize = 511;

/// The orientation and the magnitude of each gradient `(dx, dy)`, packed: the magnitude, rounded, times 8 plus the bin.
static VOTES: LazyLock<Vec<u16>> = LazyLock::new(|| {
    let mut votes = Vec::with_capacity(DIFFERENCES * DIFFERENCES);
    for dy in -255i16..=255 {
        for dx in -255i16..=255 {
            let (dx, dy) = (f64::from(dx), f64::from(dy));
            votes.push(dx.hypot(dy).round() as u16 * ORIENTATIONS as u16 + orientation(dx, dy) as u16);
        }
    }
    votes
});

/// The nearest of the orientations; bin `k` is centred at `k` eighths of half a turn.
fn orientation(dx: f64, dy: f64) -> usize {
    let turn = dy.atan2(dx) / std::f64::consts::PI * ORIENTATIONS as f64;
    turn.round().rem_euclid(ORIENTATIONS as f64) as usize
}

/// Computes the features, with scratch that is reused from patch to patch.
#[derive(Clone, Debug, Default)]
pub struct Pixelwise {
    /// Packed votes of the rows in the neighbourhood, a ring of `2 radius + 1` rows.
    votes: Vec<u16>,
    /// For each orientation, the sum of the votes of each column within those rows, with a margin of `radius` columns
    /// on both sides: `orientations x (width + 2 radius)`.
    columns: Vec<u32>,
    sums: Vec<u32>,
    total: Vec<u32>,
    /// The features of one row: `features x width`.
    planes: Vec<f32>,
}

impl Pixelwise {
    /// Calls `each` for every row of the patch from the top with its number and its features, plane after plane:
    /// `FEATURES x width`. At the border, the outermost pixels go on.
    pub fn rows(&mut self, patch: &Patch, radius: usize, mut each: impl FnMut(usize, &[f32])) {
        let (width, height) = (patch.width, patch.height);
        let side = 2 * radius + 1;
        let padded = width + 2 * radius;
        self.votes.clear();
        self.votes.resize(side * width, 0);
        self.columns.clear();
        self.columns.resize(ORIENTATIONS * padded, 0);
        self.sums.resize(width, 0);
        self.total.resize(width, 0);
        self.planes.resize(FEATURES * width, 0.0);
        for y in 0..height {
            if y == 0 {
                // The rows above the first repeat it.
                (0..side).for_each(|j| self.enter(patch, j, j.saturating_sub(radius).min(height - 1), radius));
            } else {
                let slot = (y - 1) % side;
                self.leave(slot, width, radius);
                self.enter(patch, slot, (y + radius).min(height - 1), radius);
            }
            self.orientations(width, radius);
            self.colours(patch, y);
            each(y, &self.planes);
        }
    }

    /// Adds the votes of row `y` to the columns and keeps them in a slot of the ring.
    fn enter(&mut self, patch: &Patch, slot: usize, y: usize, radius: usize) {
        let width = patch.width;
        let padded = width + 2 * radius;
        let votes = &mut self.votes[slot * width..(slot + 1) * width];
        gradients(patch, y, votes);
        for (x, vote) in votes.iter().enumerate() {
            let (bin, magnitude) = unpack(*vote);
            self.columns[bin * padded + radius + x] += magnitude;
        }
    }

    /// Takes the votes in a slot of the ring out of the columns.
    fn leave(&mut self, slot: usize, width: usize, radius: usize) {
        let padded = width + 2 * radius;
        for (x, vote) in self.votes[slot * width..(slot + 1) * width].iter().enumerate() {
            let (bin, magnitude) = unpack(*vote);
            self.columns[bin * padded + radius + x] -= magnitude;
        }
    }

    /// The histogram of each pixel of the row, from the columns around it.
    fn orientations(&mut self, width: usize, radius: usize) {
        let padded = width + 2 * radius;
        self.total.fill(0);
        for (columns, plane) in self.columns.chunks_exact_mut(padded).zip(self.planes.chunks_exact_mut(width)) {
            let (first, last) = (columns[radius], columns[radius + width - 1]);
            columns[..radius].fill(first);
            columns[radius + width..].fill(last);
            add_up(columns, 2 * radius + 1, &mut self.sums, &mut self.total, plane);
        }
        let pixels = ((2 * radius + 1) * (2 * radius + 1)) as f32;
        divide(&mut self.planes[..ORIENTATIONS * width], &self.total, FLOOR * pixels);
    }

    /// Red, green and blue of row `y`, 0 to 1; grey thrice where there is no colour.
    fn colours(&mut self, patch: &Patch, y: usize) {
        let width = patch.width;
        let planes = patch.planes();
        for (channel, out) in self.planes[ORIENTATIONS * width..].chunks_exact_mut(width).enumerate() {
            let row = &planes[channel.min(planes.len() - 1)][y * width..(y + 1) * width];
            out.iter_mut().zip(row).for_each(|(v, p)| *v = f32::from(*p) / 255.0);
        }
    }
}

/// The bin and the magnitude of a packed vote.
fn unpack(vote: u16) -> (usize, u32) {
    (usize::from(vote) % ORIENTATIONS, u32::from(vote) / ORIENTATIONS as u32)
}

/// The packed votes of row `y`: central differences (one-sided at the border) of green, the plane that carries most of
/// the luminance.
fn gradients(patch: &Patch, y: usize, votes: &mut [u16]) {
    let (width, height) = (patch.width, patch.height);
    let planes = patch.planes();
    let plane = &planes[planes.len() / 2];
    let row = |y: usize| &plane[y * width..(y + 1) * width];
    let (here, up, down) = (row(y), row(y.saturating_sub(1)), row((y + 1).min(height - 1)));
    let table = &*VOTES;
    let vote = |left: u8, right: u8, up: u8, down: u8| {
        let (dx, dy) = (i32::from(right) - i32::from(left), i32::from(down) - i32::from(up));
        table[((dy + 255) * DIFFERENCES as i32 + dx + 255) as usize]
    };
    for x in [0, width - 1] {
        votes[x] = vote(here[x.saturating_sub(1)], here[(x + 1).min(width - 1)], up[x], down[x]);
    }
    for (x, out) in votes.iter_mut().enumerate().take(width - 1).skip(1) {
        *out = vote(here[x - 1], here[x + 1], up[x], down[x]);
    }
}

/// Sums of `side` neighbouring columns, as numbers with and without a fraction; adds them to `total`.
#[multiversion(targets("x86_64+avx2"))]
fn add_up(columns: &[u32], side: usize, sums: &mut [u32], total: &mut [u32], plane: &mut [f32]) {
    sums.copy_from_slice(&columns[..sums.len()]);
    for shift in 1..side {
        sums.iter_mut().zip(&columns[shift..]).for_each(|(s, c)| *s += c);
    }
    total.iter_mut().zip(&*sums).for_each(|(t, s)| *t += s);
    plane.iter_mut().zip(&*sums).for_each(|(p, s)| *p = *s as f32);
}

/// Divides every plane by the total plus a floor.
#[multiversion(targets("x86_64+avx2"))]
fn divide(planes: &mut [f32], total: &[u32], floor: f32) {
    for plane in planes.chunks_exact_mut(total.len()) {
        plane.iter_mut().zip(total).for_each(|(p, t)| *p /= *t as f32 + floor);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crop::Cropper;
    use crate::frame::{Encoding, Frame};

    fn patch(width: usize, height: usize, encoding: Encoding) -> Patch {
        let step = width * encoding.bytes();
        let data: Vec<u8> = (0..step * height).map(|i| ((i * i * 31 + i * 17 + 5) % 251) as u8).collect();
        let frame = Frame::new(&data, width as u32, height as u32, step, encoding, None).unwrap();
        let mut patch = Patch::default();
        Cropper::default().crop(&frame, &frame.bounds(), width, height, &mut patch);
        patch
    }

    /// The features of one pixel by their definition: nested loops over its neighbourhood.
    fn reference(patch: &Patch, radius: i64, x: i64, y: i64) -> [f32; FEATURES] {
        let at = |x: i64, max: usize| x.clamp(0, max as i64 - 1) as usize;
        let green = |x: i64, y: i64| f64::from(patch.rgb(at(x, patch.width), at(y, patch.height))[1]);
        let mut bins = [0.0; ORIENTATIONS];
        for v in y - radius..=y + radius {
            for u in x - radius..=x + radius {
                let (u, v) = (at(u, patch.width) as i64, at(v, patch.height) as i64);
                let (dx, dy) = (green(u + 1, v) - green(u - 1, v), green(u, v + 1) - green(u, v - 1));
                let mut angle = dy.atan2(dx);
                if angle < 0.0 {
                    angle += std::f64::consts::PI;
                }
                let bin = (angle * 8.0 / std::f64::consts::PI).round() as usize % 8;
                bins[bin] += dx.hypot(dy).round();
            }
        }
        let norm = bins.iter().sum::<f64>() + f64::from(FLOOR) * ((2 * radius + 1) * (2 * radius + 1)) as f64;
        let rgb = patch.rgb(x as usize, y as usize);
        std::array::from_fn(|i| if i < 8 { (bins[i] / norm) as f32 } else { f32::from(rgb[i - 8]) / 255.0 })
    }

    #[test]
    fn rows_agree_with_nested_loops_over_each_neighbourhood() {
        for (width, height, radius, encoding) in [
            (23, 17, 2, Encoding::Rgb8),
            (9, 30, 1, Encoding::Mono8),
            (12, 5, 4, Encoding::Bgr8),
            (1, 3, 2, Encoding::Mono8),
            (6, 1, 0, Encoding::Rgb8),
        ] {
            let patch = patch(width, height, encoding);
            let mut seen = 0;
            Pixelwise::default().rows(&patch, radius, |y, planes| {
                assert_eq!((y, planes.len()), (seen, FEATURES * width));
                seen += 1;
                for x in 0..width {
                    let want = reference(&patch, radius as i64, x as i64, y as i64);
                    for (feature, want) in want.into_iter().enumerate() {
                        let got = planes[feature * width + x];
                        assert!((got - want).abs() < 1e-6, "{x} {y} {feature}: {got} {want}");
                    }
                }
            });
            assert_eq!(seen, height);
        }
    }

    #[test]
    fn a_vertical_edge_falls_into_the_first_orientation_and_flat_places_into_none() {
        let data: Vec<u8> = (0..20 * 20).map(|i| if i % 20 < 10 { 20 } else { 220 }).collect();
        let frame = Frame::new(&data, 20, 20, 20, Encoding::Mono8, None).unwrap();
        let mut patch = Patch::default();
        Cropper::default().crop(&frame, &frame.bounds(), 20, 20, &mut patch);
        Pixelwise::default().rows(&patch, 2, |_, planes| {
            assert!(planes[10] > 0.9 && (1..ORIENTATIONS).all(|o| planes[o * 20 + 10] == 0.0));
            assert!((0..ORIENTATIONS).all(|o| planes[o * 20 + 3] == 0.0));
        });
    }
}
