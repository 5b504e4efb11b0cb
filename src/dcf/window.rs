//! Fixed maps over the search window: what fades its border, what the filter is to answer, where it may be.

/// The Hann window over `rows x cols` cells, row-major, each with the value at its centre: 0 on the window's border, 1
/// in its middle.
pub fn hann(rows: usize, cols: usize) -> Vec<f32> {
    let axis = |n: usize| -> Vec<f64> {
        (0..n).map(|i| 0.5 - 0.5 * (std::f64::consts::TAU * (i as f64 + 0.5) / n as f64).cos()).collect()
    };
    let (y, x) = (axis(rows), axis(cols));
    y.iter().flat_map(|wy| x.iter().map(move |wx| (wx * wy) as f32)).collect()
}

/// The Gaussian label (LCMHT eq 1) with its peak of 1 at cell (0, 0), wrapped around the borders: there the
/// response to an unmoved target has its peak. `sigma` is in cells.
pub fn label(rows: usize, cols: usize, sigma: f64) -> Vec<f32> {
    let axis =
        |n: usize| -> Vec<f64> { (0..n).map(|i| (-0.5 * (wrapped(i, n) as f64 / sigma).powi(2)).exp()).collect() };
    let (y, x) = (axis(rows), axis(cols));
    y.iter().flat_map(|gy| x.iter().map(move |gx| (gx * gy) as f32)).collect()
}

/// 1 for cells whose centre lies within a box of `width x height` cells around the middle of the window, else 0.
/// At least the four cells around the middle are in.
pub fn mask(rows: usize, cols: usize, width: f64, height: f64) -> Vec<f32> {
    let axis = |n: usize, extent: f64| -> Vec<bool> {
        let reach = (extent / 2.0).max(0.5);
        (0..n).map(|i| (i as f64 + 0.5 - n as f64 / 2.0).abs() <= reach).collect()
    };
    let (y, x) = (axis(rows, height), axis(cols, width));
    y.iter().flat_map(|&my| x.iter().map(move |&mx| f32::from(u8::from(mx && my)))).collect()
}

/// The signed displacement that index `i` of a wrapped axis of length `n` stands for, in `-n/2..n/2`.
pub fn wrapped(i: usize, n: usize) -> i64 {
    if 2 * i >= n { i as i64 - n as i64 } else { i as i64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hann_window_is_symmetric_and_peaks_in_the_middle() {
        let w = hann(4, 6);
        for y in 0..4 {
            for x in 0..6 {
                assert!((w[y * 6 + x] - w[(3 - y) * 6 + 5 - x]).abs() < 1e-6);
            }
        }
        let expected = 0.5 - 0.5 * (std::f64::consts::TAU * 1.5 / 4.0).cos();
        assert!(
            (f64::from(w[6 + 2]) - expected * (0.5 - 0.5 * (std::f64::consts::TAU * 2.5 / 6.0).cos())).abs() < 1e-6
        );
    }

    #[test]
    fn the_label_peaks_at_the_origin_and_wraps() {
        let y = label(5, 8, 1.5);
        assert_eq!(y[0], 1.0);
        assert_eq!(y[1], y[7]);
        assert_eq!(y[8], y[4 * 8]);
        assert!((f64::from(y[2]) - (-0.5f64 * (2.0f64 / 1.5).powi(2)).exp()).abs() < 1e-6);
    }

    #[test]
    fn the_mask_covers_the_target() {
        let m = mask(6, 8, 4.0, 2.0);
        let on: Vec<usize> = (0..48).filter(|&i| m[i] == 1.0).collect();
        assert_eq!(on, [18, 19, 20, 21, 26, 27, 28, 29]);
        assert_eq!(mask(6, 8, 0.1, 0.1).iter().sum::<f32>(), 4.0);
    }
}
