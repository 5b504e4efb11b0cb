//! How far the path of a box is from the true one, axis by axis, and when it comes back to it.

use crate::geometry::Rect;

use super::losses::RECOVERED_OVERLAP;

/// A target is held again when so many boxes in a row overlap the true ones by more than [`RECOVERED_OVERLAP`].
pub const HELD_FRAMES: usize = 10;

/// The root mean square errors of the centre across and down, in pixels, over the frames with a true box; `None` where
/// there is none.
pub fn rmse(boxes: &[Rect], truth: &[Option<Rect>]) -> Option<[f64; 2]> {
    let (mut squares, mut count) = ([0.0; 2], 0);
    for (found, wanted) in boxes.iter().zip(truth).filter_map(|(b, t)| t.map(|t| (b.centre(), t.centre()))) {
        (0..2).for_each(|axis| squares[axis] += (found[axis] - wanted[axis]).powi(2));
        count += 1;
    }
    (count > 0).then(|| squares.map(|s| (s / f64::from(count)).sqrt()))
}

/// The first frame from `from` on at which the target is held again: the first of [`HELD_FRAMES`] right ones in a row.
pub fn held_from(boxes: &[Rect], truth: &[Option<Rect>], from: usize) -> Option<usize> {
    let right = |i: usize| truth[i].is_some_and(|t| t.iou(&boxes[i]) > RECOVERED_OVERLAP);
    let count = boxes.len().min(truth.len());
    (from..(count + 1).saturating_sub(HELD_FRAMES)).find(|&first| (first..first + HELD_FRAMES).all(right))
}

/// The median of some numbers; NaN of none.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    match values.len() {
        0 => f64::NAN,
        n => 0.5 * (values[(n - 1) / 2] + values[n / 2]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_counted_axis_by_axis_over_the_frames_with_a_true_box() {
        let t = Rect::new(10.0, 10.0, 8.0, 4.0);
        let boxes = [t.shifted(3.0, 0.0), t.shifted(4.0, -2.0), t.shifted(100.0, 100.0)];
        let [u, v] = rmse(&boxes, &[Some(t), Some(t), None]).unwrap();
        assert!((u - 12.5f64.sqrt()).abs() < 1e-12 && (v - 2f64.sqrt()).abs() < 1e-12);
        assert_eq!(rmse(&boxes, &[None, None, None]), None);
    }

    #[test]
    fn a_target_is_held_from_the_first_of_ten_right_boxes_in_a_row() {
        let t = Rect::new(10.0, 10.0, 8.0, 4.0);
        let truth = vec![Some(t); 40];
        let boxes = |wrong: &[usize]| -> Vec<Rect> {
            (0..40).map(|i| if wrong.contains(&i) { t.shifted(50.0, 0.0) } else { t }).collect()
        };
        assert_eq!(held_from(&boxes(&[12, 19]), &truth, 10), Some(20));
        assert_eq!(held_from(&boxes(&[]), &truth, 30), Some(30));
        assert_eq!(held_from(&boxes(&[]), &truth, 31), None, "only nine are left");
        assert_eq!(held_from(&boxes(&[35]), &truth, 28), None);
    }

    #[test]
    fn the_median_is_the_middle_or_between_the_two_middle_ones() {
        assert_eq!(median(vec![3.0, 1.0, 9.0]), 3.0);
        assert_eq!(median(vec![4.0, 1.0, 9.0, 3.0]), 3.5);
        assert!(median(Vec::new()).is_nan());
    }
}
