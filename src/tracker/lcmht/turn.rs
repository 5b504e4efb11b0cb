//! How far the picture is turned that a target is looked for in.
//!
//! A correlation filter knows the target as it is turned now, and loses one that turns faster than it learns. Where the
//! target answers poorly, it is looked for in pictures turned to either side as well; the picture in which it is
//! certain is where the next frames begin, so that its turning is followed round and round. The box stays upright, and
//! so does what detector and scale filter see.

/// How far the picture is turned at a time, in degrees.
const STEP: f64 = 20.0;
/// Response, measured as for the states, below which turned pictures are looked at.
pub(super) const POOR: f64 = 0.8;
/// How many times as well a target must answer in a turned picture.
pub(super) const GAIN: f64 = 1.25;
/// Ratio of the longer side of a target to the shorter one above which its picture stays as it is.
pub(super) const MOST_ASPECT: f64 = 1.5;
/// Frames, at most, from one time that turned pictures are looked at in vain to the next.
const LONGEST_REST: u32 = 8;

/// How well a target answers in the picture as it is turned now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fit {
    /// Well enough.
    Good,
    /// Poorly, but for certain.
    Poor,
    /// So poorly that it is not certain.
    Uncertain,
}

/// The turn of one target's picture.
pub(super) struct Turn {
    degrees: f64,
    /// The side that it was turned to last, 1 or -1.
    side: f64,
    /// Times in a row that neither side was better, and frames to rest before the next.
    in_vain: u32,
    rest: u32,
}

impl Turn {
    /// That of a target which was marked just now.
    pub(super) fn upright() -> Self {
        Self { degrees: 0.0, side: 1.0, in_vain: 0, rest: 0 }
    }

    /// How far the picture in which the target was last certain is turned, in degrees clockwise.
    pub(super) fn degrees(&self) -> f64 {
        self.degrees
    }

    /// How far the pictures are turned, in degrees clockwise, in which a target is to be looked for as well: that on
    /// the side to which it turned last comes first; none where it answers well. Each time in a row that neither is
    /// better, the next is a frame later; but one that is uncertain right after the first time turns fast, and was half
    /// a step between two pictures then.
    pub(super) fn others(&mut self, fit: Fit) -> Option<[f64; 2]> {
        if fit == Fit::Good {
            (self.in_vain, self.rest) = (0, 0);
            return None;
        }
        let fast = fit == Fit::Uncertain && self.in_vain == 1;
        if self.rest > 0 && !fast {
            self.rest -= 1;
            return None;
        }
        Some([self.side, -self.side].map(|side| self.degrees + side * STEP))
    }

    /// Which of the others was better, if any.
    pub(super) fn chose(&mut self, other: Option<f64>) {
        self.in_vain = if other.is_some() { 0 } else { (self.in_vain + 1).min(LONGEST_REST) };
        self.rest = self.in_vain;
        if let Some(degrees) = other {
            self.side = (degrees - self.degrees).signum();
        }
    }

    /// The target is certain in a picture turned so far.
    pub(super) fn settle(&mut self, degrees: f64) {
        self.degrees = degrees % 360.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_side_that_was_better_comes_first_and_turns_add_up() {
        let mut turn = Turn::upright();
        assert_eq!(turn.others(Fit::Poor), Some([STEP, -STEP]));
        turn.chose(Some(-STEP));
        turn.settle(-STEP);
        assert_eq!(turn.others(Fit::Poor), Some([-2.0 * STEP, 0.0]));
        turn.settle(-360.0 - STEP);
        assert_eq!(turn.degrees(), -STEP);
        // A picture in which the target was not certain in the end is not gone on with.
        turn.chose(Some(-2.0 * STEP));
        assert_eq!(turn.others(Fit::Poor), Some([-2.0 * STEP, 0.0]));
    }

    #[test]
    fn it_rests_longer_each_time_that_neither_side_is_better() {
        let mut turn = Turn::upright();
        let mut waits = Vec::new();
        for _ in 0..10 {
            waits.push((0..).find(|_| turn.others(Fit::Poor).is_some()).unwrap());
            turn.chose(None);
        }
        assert_eq!(waits, [0, 1, 2, 3, 4, 5, 6, 7, 8, 8]);
        assert!(turn.others(Fit::Poor).is_none() && turn.others(Fit::Good).is_none());
        assert!(turn.others(Fit::Poor).is_some(), "a good answer ends the rest");
    }

    #[test]
    fn one_that_is_uncertain_right_after_the_first_time_in_vain_is_looked_for_at_once() {
        let mut turn = Turn::upright();
        for waits in [0, 0, 2] {
            assert_eq!((0..).find(|_| turn.others(Fit::Uncertain).is_some()), Some(waits));
            turn.chose(None);
        }
    }
}
