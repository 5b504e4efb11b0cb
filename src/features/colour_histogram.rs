//! Colour histograms of boxes in HSV (Perez, Hue, Vermaak and Gangnet, *Color-based probabilistic tracking*, ECCV 2002,
//! section 3.2), and how alike two of them are (ETEPF eq 7).
//!
//! Pixels that have a colour are counted by hue and saturation, 10 x 10 bins; those too dark or too pale to have one by
//! their value, 10 bins.

use std::ops::Range;

use crate::crop::Patch;

/// Bins of hue, of saturation, and of the value of what has no colour.
const HUES: usize = 10;
const SATURATIONS: usize = 10;
const VALUES: usize = 10;
/// All bins.
pub const BINS: usize = HUES * SATURATIONS + VALUES;

/// Saturation and value that a pixel must exceed for its hue to mean anything.
const LEAST_SATURATION: f32 = 0.1;
const LEAST_VALUE: f32 = 0.2;

/// The bin of a colour.
pub fn bin(rgb: [u8; 3]) -> u8 {
    let [r, g, b] = rgb.map(|v| f32::from(v) / 255.0);
    let value = r.max(g).max(b);
    let chroma = value - r.min(g).min(b);
    let part = |v: f32, bins: usize| ((v * bins as f32) as usize).min(bins - 1);
    if value <= LEAST_VALUE || chroma <= LEAST_SATURATION * value {
        return (HUES * SATURATIONS + part(value, VALUES)) as u8;
    }
    let sixths = if value == r {
        (g - b) / chroma
    } else if value == g {
        2.0 + (b - r) / chroma
    } else {
        4.0 + (r - g) / chroma
    };
    let hue = sixths.rem_euclid(6.0) / 6.0;
    (part(hue, HUES) * SATURATIONS + part(chroma / value, SATURATIONS)) as u8
}

/// Fills `out` with the bin of each pixel of the patch, row-major.
pub fn bins(patch: &Patch, out: &mut Vec<u8>) {
    out.clear();
    match patch.planes() {
        [r, g, b] => out.extend(r.iter().zip(g).zip(b).map(|((r, g), b)| bin([*r, *g, *b]))),
        planes => out.extend(planes.iter().flatten().map(|v| bin([*v; 3]))),
    }
}

/// The square roots of the shares of all bins, which is what likeness is computed from. All are 0 where there is no
/// pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Histogram([f32; BINS]);

impl Histogram {
    /// The histogram of the pixels in these columns and rows of a map of bins, `width` wide.
    pub fn of(bins: &[u8], width: usize, [columns, rows]: [Range<usize>; 2]) -> Self {
        let mut counts = [0u32; BINS];
        for row in rows.clone() {
            for bin in &bins[row * width + columns.start..row * width + columns.end] {
                counts[usize::from(*bin)] += 1;
            }
        }
        let pixels = (columns.len() * rows.len()).max(1) as f32;
        Self(counts.map(|n| (n as f32 / pixels).sqrt()))
    }

    /// A histogram whose shares are between those of two: `share` of the way from this one to the other.
    pub fn mix(&self, other: &Self, share: f64) -> Self {
        let share = share as f32;
        let between = |i: usize| ((1.0 - share) * self.0[i] * self.0[i] + share * other.0[i] * other.0[i]).sqrt();
        Self(std::array::from_fn(between))
    }

    /// The Bhattacharyya coefficient `rho`: 0 where no bin is shared, 1 for equal histograms. The distance of eq 7 is
    /// `sqrt(1 - rho)`.
    pub fn likeness(&self, other: &Self) -> f64 {
        let sum: f32 = self.0.iter().zip(&other.0).map(|(a, b)| a * b).sum();
        f64::from(sum).clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_fall_into_the_bins_of_their_hue_and_saturation() {
        // Full saturation is the last of ten bins of each hue: red 0 degrees, yellow 60, green 120, blue 240.
        for (rgb, hue) in [([255, 0, 0], 0), ([255, 255, 0], 1), ([0, 255, 0], 3), ([0, 0, 255], 6), ([255, 0, 1], 9)] {
            assert_eq!(bin(rgb), hue * 10 + 9, "{rgb:?}");
        }
        assert_eq!(bin([200, 150, 150]), 2, "a saturation of a quarter");
        assert_eq!([bin([0; 3]), bin([128; 3]), bin([255; 3])], [100, 105, 109]);
        assert_eq!(bin([40, 0, 0]), 101, "too dark to be red");
        assert_eq!(bin([200, 190, 190]), 107, "too pale to be red");
    }

    #[test]
    fn shares_are_mixed_in_proportion() {
        let of = |map: &[u8]| Histogram::of(map, 4, [0..4, 0..1]);
        let (a, b) = (of(&[1, 1, 1, 2]), of(&[2, 2, 3, 3]));
        let shares = a.mix(&b, 0.25).0.map(|root| root * root);
        for (bin, want) in [(1, 0.75 * 0.75), (2, 0.75 * 0.25 + 0.25 * 0.5), (3, 0.25 * 0.5), (4, 0.0)] {
            assert!((shares[bin] - want).abs() < 1e-6, "{bin}: {}", shares[bin]);
        }
    }

    #[test]
    fn likeness_is_the_sum_over_the_bins() {
        // 8 x 4 pixels of three bins.
        let map: Vec<u8> = (0..32).map(|i| [3, 50, 109][i * (i + 3) / 2 % 5 % 3]).collect();
        let (a, b) = (Histogram::of(&map, 8, [0..4, 0..4]), Histogram::of(&map, 8, [3..8, 1..4]));
        let share = |columns: Range<usize>, rows: Range<usize>, bin: u8| {
            let pixels: Vec<u8> =
                rows.flat_map(|y| columns.clone().map(move |x| (x, y))).map(|(x, y)| map[y * 8 + x]).collect();
            pixels.iter().filter(|b| **b == bin).count() as f64 / pixels.len() as f64
        };
        let want: f64 = [3, 50, 109].iter().map(|&i| (share(0..4, 0..4, i) * share(3..8, 1..4, i)).sqrt()).sum();
        assert!((a.likeness(&b) - want).abs() < 1e-6 && want < 0.999);
        assert!((a.likeness(&a) - 1.0).abs() < 1e-6);
        let nothing = Histogram::of(&map, 8, [2..2, 0..4]);
        assert_eq!(nothing.likeness(&a), 0.0);
    }
}
