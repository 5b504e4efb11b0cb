//! Bilinear resampling of the planes of a feature map to a grid of another size.
//!
//! Both grids cover the same window, and values stand at the centres of cells: output cell i of n lies at
//! `(i + 0.5) m / n - 0.5` of m input cells. Beyond the outermost centres the border value goes on.

use super::FeatureMap;

/// The weights of a resampling, planned once.
#[derive(Clone, Debug, PartialEq)]
pub struct Resize {
    rows: Vec<Tap>,
    cols: Vec<Tap>,
    /// One input plane, `input rows x output columns`.
    wide: Vec<f32>,
}

/// Two neighbouring input cells, and the weight of the second.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Tap {
    first: usize,
    second: usize,
    weight: f32,
}

fn axis(from: usize, to: usize) -> Vec<Tap> {
    let last = (from - 1) as f64;
    let tap = |i: usize| {
        let at = ((i as f64 + 0.5) * from as f64 / to as f64 - 0.5).clamp(0.0, last);
        Tap { first: at as usize, second: (at as usize + 1).min(from - 1), weight: at.fract() as f32 }
    };
    (0..to).map(tap).collect()
}

impl Resize {
    /// From planes of `from` to planes of `to`, both `[rows, columns]` and not 0.
    pub fn new(from: [usize; 2], to: [usize; 2]) -> Self {
        Self { rows: axis(from[0], to[0]), cols: axis(from[1], to[1]), wide: vec![0.0; from[0] * to[1]] }
    }

    /// Resamples every plane of `map` into `out`, plane after plane.
    pub fn apply(&mut self, map: &FeatureMap, out: &mut [f32]) {
        let cols = self.cols.len();
        for (channel, out) in out.chunks_exact_mut(self.rows.len() * cols).enumerate() {
            for (wide, row) in self.wide.chunks_exact_mut(cols).zip(map.plane(channel).chunks_exact(map.cols)) {
                for (value, tap) in wide.iter_mut().zip(&self.cols) {
                    *value = row[tap.first] + tap.weight * (row[tap.second] - row[tap.first]);
                }
            }
            for (out, tap) in out.chunks_exact_mut(cols).zip(&self.rows) {
                let (first, second) = (&self.wide[tap.first * cols..], &self.wide[tap.second * cols..]);
                for ((value, a), b) in out.iter_mut().zip(first).zip(second) {
                    *value = a + tap.weight * (b - a);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    use super::*;

    fn map(rows: usize, cols: usize, at: impl Fn(usize, f64, f64) -> f64) -> FeatureMap {
        let mut map = FeatureMap::default();
        map.resize(rows, cols, 2);
        for (i, value) in map.data.iter_mut().enumerate() {
            let (channel, row, col) = (i / (rows * cols), i / cols % rows, i % cols);
            *value = at(channel, (row as f64 + 0.5) / rows as f64, (col as f64 + 0.5) / cols as f64) as f32;
        }
        map
    }

    /// A function that is linear in both directions is met exactly wherever the grid's centres enclose the place.
    #[test]
    fn cell_centres_stay_where_they_are_in_the_window() {
        let plane = |channel: usize, y: f64, x: f64| 1.0 + channel as f64 + 2.0 * y - 3.0 * x + 4.0 * x * y;
        for (from, to) in [([5, 7], [12, 12]), ([16, 16], [48, 48]), ([14, 9], [10, 9])] {
            let source = map(from[0], from[1], plane);
            let mut out = vec![0.0; 2 * to[0] * to[1]];
            Resize::new(from, to).apply(&source, &mut out);
            for (i, got) in out.iter().enumerate() {
                let (channel, row, col) = (i / (to[0] * to[1]), i / to[1] % to[0], i % to[1]);
                let inside = |i: usize, from: usize, to: usize| {
                    let half = 0.5 / from as f64;
                    ((i as f64 + 0.5) / to as f64).clamp(half, 1.0 - half)
                };
                let want = plane(channel, inside(row, from[0], to[0]), inside(col, from[1], to[1]));
                assert!((f64::from(*got) - want).abs() < 1e-5, "{from:?} {to:?} {row} {col}: {got} {want}");
            }
        }
    }

    #[test]
    fn a_grid_of_the_same_size_is_copied() {
        let source = map(6, 4, |channel, y, x| (channel as f64 + 1.0) * (37.0 * y).sin() * (91.0 * x).cos());
        let mut out = vec![0.0; source.data.len()];
        Resize::new([6, 4], [6, 4]).apply(&source, &mut out);
        assert_eq!(out, source.data);
    }

    /// The value at a place of a plane, in cells, by the definition.
    fn bilinear(map: &FeatureMap, channel: usize, y: f64, x: f64) -> f64 {
        let side = |at: f64, count: usize| {
            let at = at.clamp(0.0, count as f64 - 1.0);
            [(at.floor(), 1.0 - at.fract()), (at.ceil(), at.fract())]
        };
        let value = |y: f64, x: f64| f64::from(map.plane(channel)[y as usize * map.cols + x as usize]);
        let (rows, cols) = (side(y, map.rows), side(x, map.cols));
        rows.iter().flat_map(|(y, wy)| cols.map(|(x, wx)| wy * wx * value(*y, x))).sum()
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            rng_seed: RngSeed::Fixed(1), failure_persistence: None, ..ProptestConfig::with_cases(128)
        })]

        #[test]
        fn grids_of_any_sizes_agree_with_the_definition(
            from in prop::array::uniform2(1usize..20),
            to in prop::array::uniform2(1usize..40),
            values in prop::collection::vec(-1.0f32..1.0, 2 * 20 * 20),
        ) {
            let mut source = FeatureMap::default();
            source.resize(from[0], from[1], 2);
            let count = source.data.len();
            source.data.copy_from_slice(&values[..count]);
            let mut out = vec![0.0; 2 * to[0] * to[1]];
            Resize::new(from, to).apply(&source, &mut out);
            for (i, got) in out.iter().enumerate() {
                let (channel, row, col) = (i / (to[0] * to[1]), i / to[1] % to[0], i % to[1]);
                let at = |i: usize, axis: usize| (i as f64 + 0.5) * from[axis] as f64 / to[axis] as f64 - 0.5;
                let want = bilinear(&source, channel, at(row, 0), at(col, 1));
                prop_assert!((f64::from(*got) - want).abs() < 1e-5, "{row} {col}: {got} {want}");
            }
        }
    }
}
