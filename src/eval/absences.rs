//! How honestly a tracker says `lost`, held against when the target is to be seen and when not.
//!
//! An absence is a run of frames in which the target is out of view or fully hidden
//! ([`Sequence::visible`](super::dataset::Sequence::visible)).

use std::ops::AddAssign;

use serde::Serialize;

use super::answer::Answer;
use super::losses::RECOVERED_OVERLAP;
use super::otb::HELD_OVERLAP;
use crate::geometry::Rect;

/// After so many frames of an absence, the tracker ought to have said `lost`.
pub const NOTICE_FRAMES: usize = 10;

/// So many events that took so many frames altogether.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Delay {
    /// Events.
    pub count: usize,
    /// The frames that all of them took together.
    pub frames: usize,
}

impl Delay {
    fn add(&mut self, frames: usize) {
        self.count += 1;
        self.frames += frames;
    }

    /// Frames that one took; `None` where there was none.
    pub fn mean(&self) -> Option<f64> {
        (self.count > 0).then(|| self.frames as f64 / self.count as f64)
    }
}

/// Frames and absences of one or more sequences, and what the tracker said of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Absences {
    /// Frames in which the target is not to be seen.
    pub absent_frames: usize,
    /// Those of them on which `lost` was said, rightly.
    pub right: usize,
    /// Frames on which `lost` was said although the target is to be seen.
    pub wrong: usize,
    /// Frames in which the target is to be seen, `lost` was not said, and the box overlaps the true one by at most 0.1:
    /// followed something else without knowing.
    pub astray: usize,
    /// Absences.
    pub count: usize,
    /// Those that last longer than 10 frames.
    pub due: usize,
    /// Those of them in which `lost` was said within the first 10 frames, or had been said before.
    pub in_time: usize,
    /// Absences in which `lost` was said, and the frames from the first of the absence to that.
    pub noticed: Delay,
    /// Absences after which the target came back.
    pub returns: usize,
    /// Those of them after which it was found before it went again (an overlap above 0.3, not `lost`), and the frames
    /// from the first in which it was back to that.
    pub regained: Delay,
}

impl AddAssign for Absences {
    fn add_assign(&mut self, other: Self) {
        self.absent_frames += other.absent_frames;
        self.right += other.right;
        self.wrong += other.wrong;
        self.astray += other.astray;
        self.count += other.count;
        self.due += other.due;
        self.in_time += other.in_time;
        self.noticed.count += other.noticed.count;
        self.noticed.frames += other.noticed.frames;
        self.returns += other.returns;
        self.regained.count += other.regained.count;
        self.regained.frames += other.regained.frames;
    }
}

/// Holds the answers against the true box where the target is to be seen.
pub fn absences(answers: &[Answer], visible: &[Option<Rect>]) -> Absences {
    let mut found = Absences::default();
    for (answer, truth) in answers.iter().zip(visible) {
        match (truth.is_some(), answer.is_lost()) {
            (false, lost) => {
                found.absent_frames += 1;
                found.right += usize::from(lost);
            }
            (true, true) => found.wrong += 1,
            (true, false) => found.astray += usize::from(answer.overlap(*truth) <= HELD_OVERLAP),
        }
    }
    let rows: Vec<_> = answers.iter().zip(visible).collect();
    let mut runs = rows.chunk_by(|a, b| a.1.is_some() == b.1.is_some()).peekable();
    while let Some(run) = runs.next() {
        if run[0].1.is_some() {
            continue;
        }
        found.count += 1;
        let notice = run.iter().position(|(a, _)| a.is_lost());
        notice.into_iter().for_each(|frames| found.noticed.add(frames));
        if run.len() > NOTICE_FRAMES {
            found.due += 1;
            found.in_time += usize::from(notice.is_some_and(|frames| frames < NOTICE_FRAMES));
        }
        if let Some(back) = runs.peek() {
            found.returns += 1;
            let regained = back.iter().position(|(a, t)| !a.is_lost() && a.overlap(**t) > RECOVERED_OVERLAP);
            regained.into_iter().for_each(|frames| found.regained.add(frames));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracker::State;

    /// Frames from letters: `t` tracked on the target, `w` tracked on something else, `l` lost; in capitals where the
    /// target is not to be seen.
    fn of(letters: &str) -> Absences {
        let target = Rect::new(0.0, 0.0, 10.0, 20.0);
        let answer = |state, rect| Answer { rect, confidence: None, state, reacquired: false };
        let row = |c: char| {
            let answer = match c.to_ascii_lowercase() {
                't' => answer(State::Tracking, target),
                'w' => answer(State::Uncertain, target.shifted(9.0, 0.0)),
                _ => answer(State::Lost, target),
            };
            (answer, c.is_ascii_lowercase().then_some(target))
        };
        let (answers, visible): (Vec<_>, Vec<_>) = letters.chars().map(row).unzip();
        absences(&answers, &visible)
    }

    #[test]
    fn frames_are_counted_by_what_was_said_and_what_was_true() {
        let a = of("ttwlTLLt");
        assert_eq!((a.absent_frames, a.right, a.wrong, a.astray), (3, 2, 1, 1));
        assert_eq!(of("tttt"), Absences::default());
    }

    #[test]
    fn absences_are_noticed_and_returns_regained_after_so_many_frames() {
        let delay = |count, frames| Delay { count, frames };
        let a = of("ttTTLLllwt");
        assert_eq!((a.count, a.noticed, a.returns, a.regained), (1, delay(1, 2), 1, delay(1, 3)));
        assert_eq!((a.due, a.in_time), (0, 0), "too short to ask for");
        let a = of("tLLtTTwwTLtt");
        assert_eq!((a.count, a.noticed), (3, delay(2, 1)), "at once, never, after a frame");
        assert_eq!((a.returns, a.regained), (3, delay(2, 0)), "the second went again before it was found");
        let a = of("tTTT");
        assert_eq!((a.count, a.noticed.mean(), a.returns), (1, None, 0), "it does not come back");
        assert_eq!(delay(2, 3).mean(), Some(1.5));
    }

    #[test]
    fn long_absences_are_due_after_ten_frames() {
        let long = |before: usize| of(&format!("t{}{}", "T".repeat(before), "L".repeat(11 - before)));
        assert_eq!((long(9).due, long(9).in_time), (1, 1), "said on the tenth");
        assert_eq!((long(10).due, long(10).in_time), (1, 0), "said on the eleventh");
        assert_eq!(of(&format!("t{}", "L".repeat(10))).due, 0);
    }

    #[test]
    fn sums_are_those_of_both() {
        let mut sum = of("ttwlTLLtTTTTTTTTTTTTw");
        sum += of("tLLtTTwwTLtt");
        assert_eq!(
            sum,
            Absences {
                absent_frames: 21,
                right: 5,
                wrong: 1,
                astray: 4,
                count: 5,
                due: 1,
                in_time: 0,
                noticed: Delay { count: 3, frames: 2 },
                returns: 5,
                regained: Delay { count: 3, frames: 0 },
            }
        );
    }
}
