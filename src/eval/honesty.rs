//! How honestly a tracker says what it knows: the state that it reports while its box is on the target and off it.
//!
//! A box is off the target where it overlaps the true one by less than 0.1, or where there is none; the first, which
//! was given, does not count.

use std::ops::AddAssign;

use serde::Serialize;

use super::answer::Answer;
use super::otb::HELD_OVERLAP;
use crate::geometry::Rect;
use crate::output::State;

/// Frames by what was reported.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Frames {
    /// All of them.
    pub count: usize,
    /// Reported as tracking.
    pub tracking: usize,
    /// Reported as lost.
    pub lost: usize,
}

impl Frames {
    fn add(&mut self, state: State) {
        self.count += 1;
        self.tracking += usize::from(state == State::Tracking);
        self.lost += usize::from(state == State::Lost);
    }

    /// The share reported as tracking; `None` of no frames.
    pub fn share_tracking(&self) -> Option<f64> {
        (self.count > 0).then(|| self.tracking as f64 / self.count as f64)
    }

    /// The share reported as lost; `None` of no frames.
    pub fn share_lost(&self) -> Option<f64> {
        (self.count > 0).then(|| self.lost as f64 / self.count as f64)
    }
}

impl AddAssign for Frames {
    fn add_assign(&mut self, other: Self) {
        self.count += other.count;
        self.tracking += other.tracking;
        self.lost += other.lost;
    }
}

/// What was reported while the box was off the target, and on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Honesty {
    /// Off it.
    pub off: Frames,
    /// On it.
    pub on: Frames,
}

impl Honesty {
    /// Of the answers of a run.
    pub fn new(answers: &[Answer], truth: &[Option<Rect>]) -> Self {
        let mut found = Self::default();
        for (answer, truth) in answers.iter().zip(truth).skip(1) {
            let frames = if answer.overlap(*truth) < HELD_OVERLAP { &mut found.off } else { &mut found.on };
            frames.add(answer.state);
        }
        found
    }
}

impl AddAssign for Honesty {
    fn add_assign(&mut self, other: Self) {
        self.off += other.off;
        self.on += other.on;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_are_counted_on_the_target_and_off_it() {
        let rect = Rect::new(0.0, 0.0, 10.0, 10.0);
        let away = rect.shifted(50.0, 0.0);
        let answers = [
            (away, State::Tracking),
            (rect, State::Tracking),
            (rect, State::Lost),
            (away, State::Tracking),
            (away, State::Uncertain),
            (rect, State::Lost),
        ];
        let answers = answers.map(|(rect, state)| Answer { rect, confidence: None, state, reacquired: false });
        let truth = [Some(rect), Some(rect), Some(rect), Some(rect), Some(rect), None];
        let mut found = Honesty::new(&answers, &truth);
        assert_eq!(found.off, Frames { count: 3, tracking: 1, lost: 1 });
        assert_eq!(found.on, Frames { count: 2, tracking: 1, lost: 1 });
        found += found;
        assert_eq!((found.off.share_tracking(), found.on.share_lost()), (Some(1.0 / 3.0), Some(0.5)));
        assert_eq!(Frames::default().share_lost(), None);
    }
}
