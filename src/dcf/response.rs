//! Peaks of response maps. Maps are row-major `rows x cols` and wrapped: cell (0, 0) is no displacement.

use super::window::wrapped;

/// A local maximum of a response map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Displacement from the middle of the search window in cells, `[x, y]`, refined below a cell where asked for.
    pub displacement: [f64; 2],
    /// The response there.
    pub value: f32,
}

/// The highest cell (LCMHT eq 7). With `subcell`, the displacement is refined by the parabola through the peak and
/// its two neighbours on each axis.
pub fn highest(map: &[f32], rows: usize, cols: usize, subcell: bool) -> Peak {
    let best = (0..map.len()).fold(0, |best, i| if map[i] > map[best] { i } else { best });
    peak_at(map, rows, cols, best, subcell)
}

/// Appends the local maxima (over the 8 neighbours) above `floor` to `peaks`, highest first, at most `count`.
pub fn local_maxima(
    map: &[f32],
    rows: usize,
    cols: usize,
    floor: f32,
    count: usize,
    subcell: bool,
    peaks: &mut Vec<Peak>,
) {
    let start = peaks.len();
    for r in 0..rows {
        for c in 0..cols {
            let value = map[r * cols + c];
            let is_peak = value > floor
                && NEIGHBOURS.iter().all(|&(dr, dc)| {
                    let i = (r + dr + rows - 1) % rows * cols + (c + dc + cols - 1) % cols;
                    // Of equal neighbours the first in reading order is the peak.
                    value > map[i] || (value == map[i] && r * cols + c < i)
                });
            if is_peak {
                peaks.push(peak_at(map, rows, cols, r * cols + c, subcell));
            }
        }
    }
    peaks[start..].sort_by(|a, b| b.value.total_cmp(&a.value));
    peaks.truncate(start + count);
}

/// Offsets of the neighbours, one too large so that they stay unsigned.
const NEIGHBOURS: [(usize, usize); 8] = [(0, 0), (0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1), (2, 2)];

fn peak_at(map: &[f32], rows: usize, cols: usize, at: usize, subcell: bool) -> Peak {
    let (r, c) = (at / cols, at % cols);
    let mut displacement = [wrapped(c, cols) as f64, wrapped(r, rows) as f64];
    if subcell {
        let x = parabola(map[r * cols + (c + cols - 1) % cols], map[at], map[r * cols + (c + 1) % cols]);
        let y = parabola(map[(r + rows - 1) % rows * cols + c], map[at], map[(r + 1) % rows * cols + c]);
        displacement[0] += x;
        displacement[1] += y;
    }
    Peak { displacement, value: map[at] }
}

/// The vertex of the parabola through three equidistant values of which the middle one is the largest, in
/// `-0.5..=0.5` from it.
fn parabola(left: f32, middle: f32, right: f32) -> f64 {
    let (left, middle, right) = (f64::from(left), f64::from(middle), f64::from(right));
    let curvature = left - 2.0 * middle + right;
    if curvature < 0.0 { (0.5 * (left - right) / curvature).clamp(-0.5, 0.5) } else { 0.0 }
}

/// Rolls a wrapped map so that no displacement lies at cell (rows / 2, cols / 2), for display.
pub fn centred(map: &[f32], rows: usize, cols: usize, out: &mut Vec<f32>) {
    out.clear();
    for r in 0..rows {
        let from = (r + rows - rows / 2) % rows * cols;
        let row = &map[from..from + cols];
        let split = cols - cols / 2;
        out.extend_from_slice(&row[split..]);
        out.extend_from_slice(&row[..split]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_vertex_of_a_parabola_is_found_exactly() {
        let (rows, cols) = (8, 10);
        let f = |x: f64, y: f64| (5.0 - (x - 2.3).powi(2) - 0.5 * (y + 1.4).powi(2)) as f32;
        let map: Vec<f32> =
            (0..80).map(|i| f(wrapped(i % cols, cols) as f64, wrapped(i / cols, rows) as f64)).collect();
        let peak = highest(&map, rows, cols, true);
        assert!((peak.displacement[0] - 2.3).abs() < 1e-5);
        assert!((peak.displacement[1] + 1.4).abs() < 1e-5);
        assert_eq!(highest(&map, rows, cols, false).displacement, [2.0, -1.0]);
    }

    #[test]
    fn local_maxima_come_highest_first_and_only_once() {
        let mut map = vec![0.0; 36];
        (map[0], map[14], map[15], map[33]) = (0.5, 0.9, 0.9, 0.2);
        let mut peaks = Vec::new();
        local_maxima(&map, 6, 6, 0.1, 8, true, &mut peaks);
        let values: Vec<f32> = peaks.iter().map(|p| p.value).collect();
        assert_eq!(values, [0.9, 0.5, 0.2]);
        peaks.clear();
        local_maxima(&map, 6, 6, 0.1, 1, true, &mut peaks);
        assert_eq!(peaks.len(), 1);
    }

    #[test]
    fn a_centred_map_has_the_origin_in_the_middle() {
        for (rows, cols) in [(4, 6), (5, 7)] {
            let map: Vec<f32> = (0..rows * cols).map(|i| i as f32).collect();
            let mut out = Vec::new();
            centred(&map, rows, cols, &mut out);
            for (i, v) in out.iter().enumerate() {
                let (r, c) = (i / cols, i % cols);
                let source = (r + rows - rows / 2) % rows * cols + (c + cols - cols / 2) % cols;
                assert_eq!(*v, map[source]);
            }
            assert_eq!(out[rows / 2 * cols + cols / 2], 0.0);
        }
    }
}
