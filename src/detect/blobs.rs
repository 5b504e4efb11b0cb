//! Blobs of a mask: noise is taken out by an opening and holes are filled by a closing with a disc (MAPTrack, section
//! 3.2.1); what hangs together is one blob, with its area, place and direction (section 3.2.2).
//!
//! Masks are row-major `height x width`, 0 or 1. Morphology works on rows of bits, 64 pixels at once. Blobs are put
//! together from runs, the stretches of ones in a row; pixels that touch at a corner hang together.

use crate::geometry::Rect;

/// Pixels of a word.
const WORD: usize = u64::BITS as usize;
/// The largest diameter of a disc, in pixels: bits move by less than a word.
pub const MAX_DIAMETER: usize = 2 * WORD - 1;

/// Pixels that hang together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blob {
    /// The box around it.
    pub rect: Rect,
    /// How many pixels it has.
    pub area: f64,
    /// Its centre of mass, `[x, y]`.
    pub centroid: [f64; 2],
    /// The angle from the x axis towards the y axis to the line along which it is longest, `(-pi/2, pi/2]`.
    pub orientation: f64,
    /// How many times as long as wide it is, by the ellipse of the same second moments: at least 1.
    pub elongation: f64,
}

/// Opens and closes masks, with scratch that is reused from mask to mask.
#[derive(Clone, Debug, Default)]
pub struct Morphology {
    diameter: usize,
    /// The pixels of the disc, `[dx, dy]`.
    disc: Vec<[i32; 2]>,
    bits: Bits,
    spread: Bits,
}

/// Rows of bits, with an empty word on both sides.
#[derive(Clone, Debug, Default)]
struct Bits {
    /// Words of a row, the empty ones included.
    stride: usize,
    /// The bits that the last word of a row has.
    tail: u64,
    words: Vec<u64>,
}

impl Morphology {
    /// Opens a mask and then closes it by a disc of `diameter` pixels: those whose centres lie within half of it from
    /// the disc's centre. Beyond the image, erosion sees ones and dilation zeros, so that borders take nothing away.
    ///
    /// # Panics
    /// If the diameter is above [`MAX_DIAMETER`] or the mask is not `width x height`.
    pub fn open_close(&mut self, mask: &mut [u8], width: usize, height: usize, diameter: usize) {
        assert!(diameter <= MAX_DIAMETER, "a disc of {diameter} pixels");
        assert_eq!(mask.len(), width * height);
        if diameter <= 1 || mask.is_empty() {
            return;
        }
        self.plan(diameter);
        self.bits.read(mask, width);
        self.spread.clone_shape(&self.bits);
        self.erode();
        self.dilate();
        self.dilate();
        self.erode();
        self.bits.write(mask, width);
    }

    fn plan(&mut self, diameter: usize) {
        if self.diameter == diameter {
            return;
        }
        self.diameter = diameter;
        self.disc.clear();
        let reach = diameter as i32 / 2;
        // The centre of a disc of even diameter is the corner of a pixel.
        let middle = if diameter.is_multiple_of(2) { 0.5 } else { 0.0 };
        let inside = |dx: i32, dy: i32| (f64::from(dx) - middle).hypot(f64::from(dy) - middle) <= diameter as f64 / 2.0;
        for dy in -reach..=reach {
            self.disc.extend((-reach..=reach).filter(|dx| inside(*dx, dy)).map(|dx| [dx, dy]));
        }
    }

    /// Ones where all of the disc around a pixel is ones: its complement spreads against the disc.
    fn erode(&mut self) {
        self.bits.complement();
        self.grow(-1);
        self.bits.complement();
    }

    /// Ones where the disc around any one reaches.
    fn dilate(&mut self) {
        self.grow(1);
    }

    fn grow(&mut self, sign: i32) {
        self.spread.words.fill(0);
        for [dx, dy] in &self.disc {
            self.spread.add_moved(&self.bits, sign * dx, sign * dy);
        }
        self.spread.trim();
        std::mem::swap(&mut self.spread, &mut self.bits);
    }
}

impl Bits {
    fn clone_shape(&mut self, other: &Self) {
        (self.stride, self.tail) = (other.stride, other.tail);
        self.words.resize(other.words.len(), 0);
    }

    fn read(&mut self, mask: &[u8], width: usize) {
        let words = width.div_ceil(WORD);
        self.stride = words + 2;
        self.tail = u64::MAX >> (words * WORD - width);
        self.words.clear();
        self.words.resize(mask.len() / width * self.stride, 0);
        for (row, line) in mask.chunks_exact(width).zip(self.words.chunks_exact_mut(self.stride)) {
            for (pixels, word) in row.chunks(WORD).zip(&mut line[1..]) {
                *word = pixels.iter().rev().fold(0, |word, pixel| word << 1 | u64::from(*pixel != 0));
            }
        }
    }

    fn write(&self, mask: &mut [u8], width: usize) {
        for (row, line) in mask.chunks_exact_mut(width).zip(self.words.chunks_exact(self.stride)) {
            for (pixels, word) in row.chunks_mut(WORD).zip(&line[1..]) {
                pixels.iter_mut().enumerate().for_each(|(i, pixel)| *pixel = (word >> i & 1) as u8);
            }
        }
    }

    fn complement(&mut self) {
        self.words.iter_mut().for_each(|word| *word = !*word);
        self.trim();
    }

    /// Clears what lies beyond the image.
    fn trim(&mut self) {
        for line in self.words.chunks_exact_mut(self.stride) {
            line[0] = 0;
            line[self.stride - 2] &= self.tail;
            line[self.stride - 1] = 0;
        }
    }

    /// Adds the ones of other bits, moved by `dx` to the right and `dy` down.
    fn add_moved(&mut self, other: &Self, dx: i32, dy: i32) {
        let rows = dy.unsigned_abs() as usize * self.stride;
        if rows >= self.words.len() {
            // All of them leave the picture.
            return;
        }
        let length = self.words.len() - rows;
        let (to, from) = if dy >= 0 { (rows, 0) } else { (0, rows) };
        let (to, from) = (&mut self.words[to..to + length], &other.words[from..from + length]);
        match dx {
            0 => to.iter_mut().zip(from).for_each(|(t, f)| *t |= f),
            1.. => {
                let pairs = from.array_windows::<2>();
                to[1..]
                    .iter_mut()
                    .zip(pairs)
                    .for_each(|(t, [left, here])| *t |= here << dx | left >> (WORD as i32 - dx));
            }
            _ => {
                let pairs = from.array_windows::<2>();
                to.iter_mut().zip(pairs).for_each(|(t, [here, right])| *t |= here >> -dx | right << (WORD as i32 + dx));
            }
        }
    }
}

/// A stretch of ones in a row: columns `first..end`.
#[derive(Clone, Copy, Debug)]
struct Run {
    row: usize,
    first: usize,
    end: usize,
    /// An earlier run that it hangs together with, or itself.
    parent: usize,
}

/// Integrals over the pixels of a blob, each of which fills its square, and the box around them.
#[derive(Clone, Copy, Debug)]
struct Sums {
    area: f64,
    first: [f64; 2],
    /// Of x x, x y, y y.
    second: [f64; 3],
    low: [f64; 2],
    high: [f64; 2],
}

impl Sums {
    const NONE: Self =
        Self { area: 0.0, first: [0.0; 2], second: [0.0; 3], low: [f64::INFINITY; 2], high: [f64::NEG_INFINITY; 2] };

    fn add(&mut self, run: &Run) {
        let [left, right, top] = [run.first, run.end, run.row].map(|v| v as f64);
        let bottom = top + 1.0;
        let power = |low: f64, high: f64, n: i32| (high.powi(n) - low.powi(n)) / f64::from(n);
        let [width, x, xx] = [1, 2, 3].map(|n| power(left, right, n));
        let [y, yy] = [2, 3].map(|n| power(top, bottom, n));
        self.area += width;
        self.first = [self.first[0] + x, self.first[1] + width * y];
        self.second = [self.second[0] + xx, self.second[1] + x * y, self.second[2] + width * yy];
        self.low = [self.low[0].min(left), self.low[1].min(top)];
        self.high = [self.high[0].max(right), self.high[1].max(bottom)];
    }

    fn blob(&self) -> Blob {
        let centroid @ [x, y] = self.first.map(|sum| sum / self.area);
        let [xx, xy, yy] = self.second.map(|sum| sum / self.area);
        let [xx, xy, yy] = [xx - x * x, xy - x * y, yy - y * y];
        // Eigenvalues of the second moments.
        let (mean, half) = (0.5 * (xx + yy), (0.5 * (xx - yy)).hypot(xy));
        Blob {
            rect: Rect::new(self.low[0], self.low[1], self.high[0] - self.low[0], self.high[1] - self.low[1]),
            area: self.area,
            centroid,
            orientation: 0.5 * (2.0 * xy).atan2(xx - yy),
            elongation: ((mean + half) / (mean - half)).sqrt(),
        }
    }
}

/// Puts blobs together, with scratch that is reused from mask to mask.
#[derive(Clone, Debug, Default)]
pub struct BlobFinder {
    runs: Vec<Run>,
    /// Of each run that is its own parent.
    sums: Vec<Sums>,
}

impl BlobFinder {
    /// Fills `blobs` with those of a mask, in the order of their first pixels.
    pub fn find(&mut self, mask: &[u8], width: usize, blobs: &mut Vec<Blob>) {
        self.runs.clear();
        let mut above = 0;
        for (row, line) in mask.chunks_exact(width.max(1)).enumerate() {
            let here = self.runs.len();
            self.cut(row, line);
            self.join(above, here);
            above = here;
        }
        self.sums.clear();
        self.sums.resize(self.runs.len(), Sums::NONE);
        for at in 0..self.runs.len() {
            let root = self.root(at);
            self.sums[root].add(&self.runs[at]);
        }
        blobs.clear();
        blobs.extend(self.sums.iter().filter(|s| s.area > 0.0).map(Sums::blob));
    }

    /// Appends the runs of a row.
    fn cut(&mut self, row: usize, line: &[u8]) {
        let mut from = 0;
        while let Some(gap) = line[from..].iter().position(|m| *m != 0) {
            let first = from + gap;
            let end = line[first..].iter().position(|m| *m == 0).map_or(line.len(), |length| first + length);
            self.runs.push(Run { row, first, end, parent: self.runs.len() });
            from = end;
        }
    }

    /// Joins the runs from `here` on to those of the row above, from `above` to `here`, that they touch.
    fn join(&mut self, above: usize, here: usize) {
        let mut first = above;
        for at in here..self.runs.len() {
            let run = self.runs[at];
            while first < here && self.runs[first].end < run.first {
                first += 1;
            }
            for up in first..here {
                if self.runs[up].row + 1 != run.row || self.runs[up].first > run.end {
                    break;
                }
                let (a, b) = (self.root(up), self.root(at));
                self.runs[a.max(b)].parent = a.min(b);
            }
        }
    }

    /// The first run of those that a run hangs together with, as far as known.
    fn root(&mut self, mut at: usize) -> usize {
        while self.runs[at].parent != at {
            // Halves the way for the next time.
            self.runs[at].parent = self.runs[self.runs[at].parent].parent;
            at = self.runs[at].parent;
        }
        at
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Discs and noise, in which no two pixels of a row are alike for long.
    fn mask(width: usize, height: usize, seed: u64) -> Vec<u8> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut mask: Vec<u8> = (0..width * height).map(|_| u8::from(rng.random_range(0..50) == 0)).collect();
        for _ in 0..12 {
            let [x, y, r] = [width, height, 9].map(|n| rng.random_range(0..n) as f64);
            for (i, m) in mask.iter_mut().enumerate() {
                let inside = ((i % width) as f64 - x).hypot((i / width) as f64 - y) < r;
                *m |= u8::from(inside && rng.random_range(0..30) != 0);
            }
        }
        mask
    }

    /// Erosion (`all`) or dilation by the definition: nested loops over the disc around each pixel.
    fn naive(mask: &[u8], width: usize, diameter: usize, erode: bool) -> Vec<u8> {
        let height = mask.len() / width;
        // Twice the distances, so that centres at corners stay whole; a dilation sees the disc turned around.
        let even = i64::from(diameter.is_multiple_of(2));
        let sign = if erode { 1 } else { -1 };
        let reach = diameter as i64;
        let at = |x: i64, y: i64| {
            let inside = (0..width as i64).contains(&x) && (0..height as i64).contains(&y);
            if inside { mask[y as usize * width + x as usize] != 0 } else { erode }
        };
        let pixel = |i: usize| {
            let (x, y) = ((i % width) as i64, (i / width) as i64);
            let mut seen = (-reach..=reach)
                .flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy)))
                .filter(|(dx, dy)| (2 * dx - even).pow(2) + (2 * dy - even).pow(2) <= reach * reach);
            let mut at = |(dx, dy): (i64, i64)| at(x + sign * dx, y + sign * dy);
            u8::from(if erode { seen.all(&mut at) } else { seen.any(&mut at) })
        };
        (0..mask.len()).map(pixel).collect()
    }

    #[test]
    fn opening_and_closing_agree_with_nested_loops() {
        let mut morphology = Morphology::default();
        for (width, height, diameter) in [(70, 31, 3), (64, 20, 4), (130, 40, 7), (9, 3, 5), (40, 30, 2), (33, 50, 1)]
            .into_iter()
            .chain([(1, 1, 3), (4, 4, 9), (60, 5, 3), (1000, 2, 6), (1, 70, 5)])
        {
            let mask = mask(width, height, diameter as u64);
            let mut want = mask.clone();
            for erode in [true, false, false, true] {
                want = naive(&want, width, diameter, erode);
            }
            let mut got = mask.clone();
            morphology.open_close(&mut got, width, height, diameter);
            assert!(got == want, "{width} x {height}, a disc of {diameter}");
            assert!(
                diameter == 1 || width < 20 || height < 20 || (got != mask && got.contains(&1)),
                "the mask must say something"
            );
        }
    }

    /// Pixels painted from one to the next until nothing changes, and sums over them.
    fn flooded(mask: &[u8], width: usize) -> Vec<(Rect, f64, [f64; 2])> {
        let height = mask.len() / width;
        let mut left = mask.to_vec();
        let mut blobs = Vec::new();
        while let Some(start) = left.iter().position(|m| *m != 0) {
            let (mut stack, mut pixels) = (vec![start], Vec::new());
            left[start] = 0;
            while let Some(at) = stack.pop() {
                let (x, y) = (at % width, at / width);
                pixels.push((x as f64, y as f64));
                for v in y.saturating_sub(1)..(y + 2).min(height) {
                    for u in x.saturating_sub(1)..(x + 2).min(width) {
                        if std::mem::take(&mut left[v * width + u]) != 0 {
                            stack.push(v * width + u);
                        }
                    }
                }
            }
            let n = pixels.len() as f64;
            let low = pixels.iter().fold([f64::MAX; 2], |l, p| [l[0].min(p.0), l[1].min(p.1)]);
            let high = pixels.iter().fold([0f64; 2], |h, p| [h[0].max(p.0 + 1.0), h[1].max(p.1 + 1.0)]);
            let mean = pixels.iter().fold([0.5; 2], |m, p| [m[0] + p.0 / n, m[1] + p.1 / n]);
            blobs.push((Rect::new(low[0], low[1], high[0] - low[0], high[1] - low[1]), n, mean));
        }
        blobs
    }

    #[test]
    fn blobs_agree_with_painting_from_pixel_to_pixel() {
        let (mut finder, mut blobs) = (BlobFinder::default(), Vec::new());
        for (width, height, seed) in [(70, 31, 1), (64, 64, 2), (5, 40, 3), (1, 9, 4), (200, 90, 5)] {
            let mask = mask(width, height, seed);
            finder.find(&mask, width, &mut blobs);
            let want = flooded(&mask, width);
            assert_eq!(blobs.len(), want.len());
            for (blob, (rect, area, centroid)) in blobs.iter().zip(want) {
                assert_eq!((blob.rect, blob.area), (rect, area));
                assert!((0..2).all(|i| (blob.centroid[i] - centroid[i]).abs() < 1e-9), "{blob:?} {centroid:?}");
            }
        }
        finder.find(&[0; 12], 4, &mut blobs);
        assert!(blobs.is_empty());
    }

    #[test]
    fn a_blob_knows_its_direction_and_how_long_it_is() {
        const SIDE: usize = 120;
        let (mut finder, mut blobs) = (BlobFinder::default(), Vec::new());
        for degrees in [0.0f64, 30.0, 90.0, -60.0, 45.0] {
            // An ellipse of half axes 40 and 10.
            let (sin, cos) = degrees.to_radians().sin_cos();
            let inside = |i: usize| {
                let (x, y) = ((i % SIDE) as f64 + 0.5 - 60.0, (i / SIDE) as f64 + 0.5 - 60.0);
                ((x * cos + y * sin) / 40.0).hypot((y * cos - x * sin) / 10.0) <= 1.0
            };
            let mask: Vec<u8> = (0..SIDE * SIDE).map(|i| u8::from(inside(i))).collect();
            finder.find(&mask, SIDE, &mut blobs);
            let [blob] = blobs[..] else { panic!("{blobs:?}") };
            let off = (blob.orientation.to_degrees() - degrees).rem_euclid(180.0);
            assert!(off.min(180.0 - off) < 0.5 && (blob.elongation - 4.0).abs() < 0.1, "{degrees}: {blob:?}");
            assert!((blob.area - 400.0 * std::f64::consts::PI).abs() < 10.0, "{blob:?}");
        }
        finder.find(&[1; 36], 6, &mut blobs);
        assert!((blobs[0].elongation - 1.0).abs() < 1e-9, "a square: {blobs:?}");
        finder.find(&[1; 7], 7, &mut blobs);
        assert!((blobs[0].elongation - 7.0).abs() < 1e-9 && blobs[0].orientation == 0.0, "a line: {blobs:?}");
    }
}
