//! Whether a tracker's confidence is what it says: of the boxes given at 0.8, are 8 in 10 right?
//!
//! A box is right where it overlaps the true one by more than 0.5; the first, which was given, does not count. The
//! expected calibration error is the mean, over the boxes, of the difference between the share of right boxes in a bin
//! and the bin's mean confidence (Guo, Pleiss, Sun and Weinberger, *On calibration of modern neural networks*, ICML
//! 2017, eq 3).

use std::ops::AddAssign;

use serde::Serialize;

use super::answer::Answer;
use crate::geometry::Rect;

/// Overlap above which a box is right.
pub const RIGHT_OVERLAP: f64 = 0.5;
/// Bins of the same width from 0 to 1.
pub const BINS: usize = 10;

/// Boxes of about the same confidence.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Bin {
    /// Boxes.
    pub boxes: usize,
    /// Those that are right.
    pub right: usize,
    /// The sum of their confidences.
    pub confidence: f64,
}

impl Bin {
    /// The share of right boxes; `None` of none.
    pub fn share(&self) -> Option<f64> {
        (self.boxes > 0).then(|| self.right as f64 / self.boxes as f64)
    }

    /// The mean confidence; `None` of none.
    pub fn mean(&self) -> Option<f64> {
        (self.boxes > 0).then(|| self.confidence / self.boxes as f64)
    }
}

/// The boxes of one or more sequences by their confidence.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Calibration {
    /// Boxes of a confidence from 0, 0.1, ..., 0.9; the last bin holds those of 1 as well.
    pub bins: [Bin; BINS],
}

impl AddAssign for Calibration {
    fn add_assign(&mut self, other: Self) {
        for (bin, other) in self.bins.iter_mut().zip(other.bins) {
            bin.boxes += other.boxes;
            bin.right += other.right;
            bin.confidence += other.confidence;
        }
    }
}

impl Calibration {
    /// Sorts answers into bins, best guesses of a lost target included; `None` where one has no confidence, or one
    /// outside of 0 to 1, which is no share.
    pub fn new(answers: &[Answer], truth: &[Option<Rect>]) -> Option<Self> {
        let mut found = Self::default();
        for (answer, truth) in answers.iter().zip(truth).skip(1) {
            let confidence = answer.confidence.filter(|c| (0.0..=1.0).contains(c))?;
            let bin = &mut found.bins[((confidence * BINS as f64) as usize).min(BINS - 1)];
            bin.boxes += 1;
            bin.right += usize::from(answer.overlap(*truth) > RIGHT_OVERLAP);
            bin.confidence += confidence;
        }
        Some(found)
    }

    /// The expected calibration error, 0 to 1; 0 without boxes.
    pub fn error(&self) -> f64 {
        let boxes: usize = self.bins.iter().map(|b| b.boxes).sum();
        let gap = |b: &Bin| (b.right as f64 - b.confidence).abs();
        self.bins.iter().map(gap).sum::<f64>() / boxes.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracker::State;

    const BOX: Rect = Rect::new(100.0, 50.0, 10.0, 20.0);

    fn answer(shift: f64, confidence: Option<f64>) -> Answer {
        Answer { rect: BOX.shifted(shift, 0.0), confidence, state: State::Tracking, reacquired: false }
    }

    /// By hand: the first does not count; two at 0.82 and 0.88, one right; one at 1, right; one at 0.1, absent.
    #[test]
    fn figures_agree_with_those_computed_by_hand() {
        let answers = [(9.0, 0.0), (1.0, 0.82), (5.0, 0.88), (0.0, 1.0), (0.0, 0.1)].map(|(s, c)| answer(s, Some(c)));
        let found = Calibration::new(&answers, &[Some(BOX), Some(BOX), Some(BOX), Some(BOX), None]).unwrap();
        assert_eq!((found.bins[8].boxes, found.bins[8].share()), (2, Some(0.5)));
        assert!((found.bins[8].mean().unwrap() - 0.85).abs() < 1e-12);
        assert_eq!((found.bins[9].share(), found.bins[9].mean()), (Some(1.0), Some(1.0)));
        assert_eq!((found.bins[1].share(), found.bins[0].share()), (Some(0.0), None));
        // (2 * |0.5 - 0.85| + 0 + 1 * |0 - 0.1|) / 4.
        assert!((found.error() - 0.2).abs() < 1e-12);
        let mut twice = found;
        twice += found;
        assert_eq!((twice.bins[8].boxes, twice.bins[8].right), (4, 2));
        assert!((twice.error() - found.error()).abs() < 1e-12);
    }

    #[test]
    fn scores_that_are_no_shares_have_no_calibration() {
        for confidence in [None, Some(1.5), Some(-0.1), Some(f64::NAN)] {
            assert_eq!(Calibration::new(&[answer(0.0, Some(1.0)), answer(0.0, confidence)], &[Some(BOX); 2]), None);
        }
        assert_eq!(Calibration::default().error(), 0.0);
    }
}
