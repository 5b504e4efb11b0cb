//! One-pass evaluation by the rules of the object tracking benchmark (Wu, Lim and Yang, *Online object tracking: a
//! benchmark*, CVPR 2013).

use serde::Serialize;

use crate::geometry::{Rect, distance};

/// Distance of centres, in pixels, at which precision is quoted.
pub const PRECISION_PIXELS: usize = 20;
/// The precision curve goes from 0 to so many pixels, by one.
pub const LARGEST_DISTANCE: usize = 50;
/// Overlap thresholds of the success curve: 0, 0.05, ..., 1.
pub const OVERLAP_THRESHOLDS: usize = 21;
/// Overlap above which the target counts as held.
pub const HELD_OVERLAP: f64 = 0.1;

/// How the shares of good rows change with what is asked of them.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Curves {
    /// Share of rows whose centres are at most 0, 1, ..., 50 px apart.
    pub precision: Vec<f64>,
    /// Share of rows with an overlap above 0, 0.05, ..., 1.
    pub success: Vec<f64>,
}

impl Curves {
    /// The mean of several, point by point; empty of none.
    pub fn mean<'a>(all: impl Iterator<Item = &'a Self> + Clone) -> Self {
        let mean = |of: fn(&Self) -> &Vec<f64>| {
            let count = all.clone().count() as f64;
            let points = all.clone().map(of).map(Vec::len).min().unwrap_or(0);
            (0..points).map(|i| all.clone().map(|c| of(c)[i]).sum::<f64>() / count).collect()
        };
        Self { precision: mean(|c| &c.precision), success: mean(|c| &c.success) }
    }
}

/// The overlap threshold of a point of the success curve.
pub fn overlap_threshold(point: usize) -> f64 {
    point as f64 / (OVERLAP_THRESHOLDS - 1) as f64
}

/// Figures over the rows that have ground truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Score {
    /// Rows with ground truth.
    pub frames: usize,
    /// Share of rows whose centres are at most 20 px apart.
    pub precision: f64,
    /// Area under the success curve: the mean, over the thresholds, of the share of rows with a larger overlap.
    pub auc: f64,
    /// Share of rows with an overlap above 0.1.
    pub held: f64,
    /// Both curves.
    pub curves: Curves,
}

/// Scores boxes row by row; rows without ground truth are skipped. `None` where no row has any.
pub fn score(boxes: &[Rect], truth: &[Option<Rect>]) -> Option<Score> {
    let rows: Vec<(f64, f64)> =
        boxes.iter().zip(truth).filter_map(|(b, t)| t.map(|t| (distance(b.centre(), t.centre()), b.iou(&t)))).collect();
    if rows.is_empty() {
        return None;
    }
    let share = |count: usize| count as f64 / rows.len() as f64;
    let near = |pixels: usize| share(rows.iter().filter(|r| r.0 <= pixels as f64).count());
    let success = |threshold: f64| share(rows.iter().filter(|r| r.1 > threshold).count());
    let curves = Curves {
        precision: (0..=LARGEST_DISTANCE).map(near).collect(),
        success: (0..OVERLAP_THRESHOLDS).map(|i| success(overlap_threshold(i))).collect(),
    };
    Some(Score {
        frames: rows.len(),
        precision: near(PRECISION_PIXELS),
        auc: curves.success.iter().sum::<f64>() / OVERLAP_THRESHOLDS as f64,
        held: success(HELD_OVERLAP),
        curves,
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
        let thirds = |count: usize| count as f64 / 3.0;
        let precision: Vec<f64> = [1; 5].into_iter().chain([2; 25]).chain([3; 21]).map(thirds).collect();
        assert_eq!(score.curves.precision, precision);
        let success: Vec<f64> = [2; 7].into_iter().chain([1; 13]).chain([0]).map(thirds).collect();
        assert_eq!(score.curves.success, success);
    }

    #[test]
    fn the_mean_of_curves_is_taken_point_by_point() {
        let curves = |a: f64| Curves { precision: vec![0.0, a], success: vec![a] };
        assert_eq!(Curves::mean([curves(1.0), curves(0.5)].iter()), curves(0.75));
        assert_eq!(Curves::mean([].iter()), Curves::default());
    }

    #[test]
    fn no_ground_truth_gives_no_score() {
        assert_eq!(score(&[Rect::default()], &[None]), None);
    }
}
