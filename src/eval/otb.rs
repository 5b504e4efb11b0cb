//! One-pass evaluation by the rules of the object tracking benchmark (Wu, Lim and Yang, *Online object tracking: a
//! benchmark*, CVPR 2013).

use crate::geometry::{Rect, distance};

/// Distance of centres, in pixels, at which precision is quoted.
pub const PRECISION_PIXELS: f64 = 20.0;
/// Overlap thresholds of the success curve: 0, 0.05, ..., 1.
pub const OVERLAP_THRESHOLDS: usize = 21;
/// Overlap above which the target counts as held.
pub const HELD_OVERLAP: f64 = 0.1;

/// Figures over the rows that have ground truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// Rows with ground truth.
    pub frames: usize,
    /// Share of rows whose centres are at most 20 px apart.
    pub precision: f64,
    /// Area under the success curve: the mean, over the thresholds, of the share of rows with a larger overlap.
    pub auc: f64,
    /// Share of rows with an overlap above 0.1.
    pub held: f64,
}

/// Scores boxes row by row; rows without ground truth are skipped. `None` where no row has any.
pub fn score(boxes: &[Rect], truth: &[Option<Rect>]) -> Option<Score> {
    let rows: Vec<(f64, f64)> =
        boxes.iter().zip(truth).filter_map(|(b, t)| t.map(|t| (distance(b.centre(), t.centre()), b.iou(&t)))).collect();
    if rows.is_empty() {
        return None;
    }
    let share = |count: usize| count as f64 / rows.len() as f64;
    let success = |threshold: f64| share(rows.iter().filter(|r| r.1 > threshold).count());
    let steps = OVERLAP_THRESHOLDS - 1;
    Some(Score {
        frames: rows.len(),
        precision: share(rows.iter().filter(|r| r.0 <= PRECISION_PIXELS).count()),
        auc: (0..=steps).map(|i| success(i as f64 / steps as f64)).sum::<f64>() / OVERLAP_THRESHOLDS as f64,
        held: success(HELD_OVERLAP),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four rows by hand: exact, half shifted (overlap 1/3, 5 px), 30 px off, absent.
    #[test]
    fn figures_agree_with_those_computed_by_hand() {
        let t = Rect::new(100.0, 50.0, 10.0, 20.0);
        let truth = [Some(t), Some(t), Some(t), None];
        let boxes = [t, t.shifted(5.0, 0.0), t.shifted(30.0, 0.0), t];
        let score = score(&boxes, &truth).unwrap();
        assert_eq!(score.frames, 3);
        assert_eq!(score.precision, 2.0 / 3.0);
        assert_eq!(score.held, 2.0 / 3.0);
        // Overlap 1 exceeds the 20 thresholds below 1; 1/3 exceeds 0, 0.05, ..., 0.3: seven.
        assert!((score.auc - (20.0 + 7.0) / (3.0 * 21.0)).abs() < 1e-12);
    }

    #[test]
    fn no_ground_truth_gives_no_score() {
        assert_eq!(score(&[Rect::default()], &[None]), None);
    }
}
