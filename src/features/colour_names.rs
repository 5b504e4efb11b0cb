//! Colour names: the probability of each of eleven basic colour terms given a pixel (van de Weijer, Schmid,
//! Verbeek and Larlus, *Learning color names for real-world applications*, TIP 2009).
//!
//! The table has an entry for each of 32 x 32 x 32 colours. It is shipped as a grey PNG, `assets/colour_names.png`
//! (source and licence in `NOTICE`): row `32 name + b / 8`, column `r / 8 + 32 (g / 8)`, probability times 255.

use std::sync::LazyLock;

use super::{CELL, FeatureMap};
use crate::crop::Patch;

/// The names, in the order of the channels.
pub const NAMES: [&str; 11] =
    ["black", "blue", "brown", "grey", "green", "orange", "pink", "purple", "red", "white", "yellow"];

/// Channels of the map.
pub const CHANNELS: usize = NAMES.len();

/// Levels of each primary in the table.
const LEVELS: usize = 32;
/// Entries are padded to a power of two: one load, one add.
const PADDED: usize = 16;

/// Probabilities times 255, by `r / 8 + 32 (g / 8) + 1024 (b / 8)`.
static TABLE: LazyLock<Vec<[u8; PADDED]>> = LazyLock::new(|| {
    let png = include_bytes!("../../assets/colour_names.png");
    let image = image::load_from_memory_with_format(png, image::ImageFormat::Png)
        .expect("the embedded table is a PNG")
        .into_luma8();
    let mut table = vec![[0; PADDED]; LEVELS.pow(3)];
    for (x, y, probability) in image.enumerate_pixels() {
        let (name, blue) = (y as usize / LEVELS, y as usize % LEVELS);
        table[x as usize + LEVELS * LEVELS * blue][name] = probability.0[0];
    }
    table
});

/// The probabilities of the eleven names for a colour.
pub fn probabilities(rgb: [u8; 3]) -> [f32; CHANNELS] {
    let entry = &TABLE[index(rgb)];
    std::array::from_fn(|i| f32::from(entry[i]) / 255.0)
}

#[inline]
fn index([r, g, b]: [u8; 3]) -> usize {
    usize::from(r >> 3) | usize::from(g >> 3) << 5 | usize::from(b >> 3) << 10
}

/// Fills `map` with the mean probabilities over each cell of [`CELL`] pixels, channels in the order of [`NAMES`].
pub fn compute(patch: &Patch, map: &mut FeatureMap) {
    let (rows, cols) = (patch.height / CELL, patch.width / CELL);
    map.resize(rows, cols, CHANNELS);
    let table = TABLE.as_slice();
    let scale = 1.0 / (255.0 * (CELL * CELL) as f32);
    let cells = rows * cols;
    for row in 0..rows {
        for col in 0..cols {
            let mut sum = [0u16; PADDED];
            for y in row * CELL..(row + 1) * CELL {
                for x in col * CELL..(col + 1) * CELL {
                    let entry = &table[index(patch.rgb(x, y))];
                    sum.iter_mut().zip(entry).for_each(|(s, &e)| *s += u16::from(e));
                }
            }
            for (channel, s) in sum[..CHANNELS].iter().enumerate() {
                map.data[channel * cells + row * cols + col] = f32::from(*s) * scale;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crop::Cropper;
    use crate::frame::{Encoding, Frame};

    fn name(rgb: [u8; 3]) -> &'static str {
        let p = probabilities(rgb);
        NAMES[(0..CHANNELS).max_by(|&a, &b| p[a].total_cmp(&p[b])).unwrap()]
    }

    #[test]
    fn pure_colours_bear_their_names() {
        for (rgb, want) in [
            ([0, 0, 0], "black"),
            ([0, 0, 255], "blue"),
            ([120, 70, 30], "brown"),
            ([128, 128, 128], "grey"),
            ([0, 255, 0], "green"),
            ([255, 140, 0], "orange"),
            ([255, 150, 200], "pink"),
            ([128, 0, 160], "purple"),
            ([255, 0, 0], "red"),
            ([255, 255, 255], "white"),
            ([255, 255, 0], "yellow"),
        ] {
            assert_eq!(name(rgb), want, "{rgb:?}");
        }
    }

    #[test]
    fn entries_are_probabilities() {
        for r in (0..=255).step_by(8) {
            for g in (0..=255).step_by(8) {
                for b in (0..=255).step_by(8) {
                    let sum: f32 = probabilities([r, g, b]).iter().sum();
                    assert!((sum - 1.0).abs() < 6.0 / 255.0, "{r} {g} {b}: {sum}");
                }
            }
        }
        let blue = probabilities([0, 0, 255])[1];
        assert!(blue > 0.9, "{blue}");
    }

    #[test]
    fn a_cell_holds_the_mean_over_its_pixels() {
        let data: Vec<u8> = (0..8 * 8 * 3).map(|i| (i * 37 % 256) as u8).collect();
        let frame = Frame::new(&data, 8, 8, 24, Encoding::Bgr8, None).unwrap();
        let mut patch = Patch::default();
        Cropper::default().crop(&frame, &frame.bounds(), 8, 8, &mut patch);
        let mut map = FeatureMap::default();
        compute(&patch, &mut map);
        for channel in 0..CHANNELS {
            for (cell, (x0, y0)) in [(0, 0), (4, 0), (0, 4), (4, 4)].into_iter().enumerate() {
                let mut sum = 0.0;
                for y in y0..y0 + 4 {
                    for x in x0..x0 + 4 {
                        sum += probabilities(frame.rgb(x, y))[channel];
                    }
                }
                assert!((map.plane(channel)[cell] - sum / 16.0).abs() < 1e-5);
            }
        }
    }
}
