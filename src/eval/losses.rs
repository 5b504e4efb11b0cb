//! What became of a target that was reported lost.

use super::answer::Answer;
use crate::geometry::Rect;

/// Overlap with the true box above which a found target counts as the right one.
pub const RECOVERED_OVERLAP: f64 = 0.3;
/// Frames after the end of a loss within which that overlap must be reached.
pub const RECOVERY_FRAMES: usize = 10;

/// Losses of a target and how they ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Losses {
    /// Frames on which it was reported lost.
    pub frames: usize,
    /// Runs of such frames.
    pub count: usize,
    /// Runs after which the right target was found: within 10 frames, and before it is lost again, a box overlaps
    /// the true one by more than 0.3.
    pub recovered: usize,
    /// Frames before the first on which the target is in view and was lost: said to be, or by a box that does not touch
    /// the true one. All of them where there is no such frame. (MAPTrack's table 3 has "the number of frames after
    /// which the trackers lost track for the first time", and does not say what counts; this is how we read it.)
    pub first: usize,
}

/// Counts the losses among frames with the answer on each, and the true box where there is one.
pub fn losses(answers: &[Answer], truth: &[Option<Rect>]) -> Losses {
    let lost = |i: usize| answers[i].is_lost();
    let right = |i: usize| answers[i].overlap(truth[i]) > RECOVERED_OVERLAP;
    let count = answers.len().min(truth.len());
    let gone = |i: usize| truth[i].is_some() && (lost(i) || answers[i].overlap(truth[i]) <= 0.0);
    let mut found = Losses { first: (0..count).find(|&i| gone(i)).unwrap_or(count), ..Losses::default() };
    for i in (0..count).filter(|&i| lost(i)) {
        found.frames += 1;
        found.count += usize::from(i == 0 || !lost(i - 1));
        let mut after = (i + 1..count).take(RECOVERY_FRAMES).take_while(|&k| !lost(k));
        found.recovered += usize::from(after.any(right));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracker::State;

    /// Rows from letters: `t` tracked on the target, `w` tracked on its edge, `o` tracked beside it, `l` lost, `a`
    /// absent and tracked nowhere, `A` absent and lost.
    fn count(letters: &str) -> Losses {
        let target = Rect::new(0.0, 0.0, 10.0, 20.0);
        let answer = |state, rect| Answer { rect, confidence: None, state, reacquired: false };
        let (answers, truth): (Vec<_>, Vec<_>) = letters
            .chars()
            .map(|c| match c {
                't' => (answer(State::Tracking, target.shifted(2.0, 0.0)), Some(target)),
                'w' => (answer(State::Uncertain, target.shifted(8.0, 0.0)), Some(target)),
                'o' => (answer(State::Tracking, target.shifted(10.0, 0.0)), Some(target)),
                'a' => (answer(State::Tracking, target), None),
                'A' => (answer(State::Lost, target), None),
                _ => (answer(State::Lost, target), Some(target)),
            })
            .unzip();
        losses(&answers, &truth)
    }

    #[test]
    fn runs_of_lost_frames_are_losses_and_recovered_on_the_right_target_only() {
        let of = |frames, count, recovered| (frames, count, recovered);
        let count = |letters| {
            let Losses { frames, count, recovered, .. } = count(letters);
            (frames, count, recovered)
        };
        assert_eq!(count("tttt"), of(0, 0, 0));
        assert_eq!(count("ttlllt"), of(3, 1, 1));
        assert_eq!(count("ttlllw"), of(3, 1, 0));
        assert_eq!(count("tlwltl"), of(3, 3, 1), "only the second loss ends well");
        assert_eq!(count("tlaat"), of(1, 1, 1));
        assert_eq!(count("tlwwwwwwwwwt"), of(1, 1, 1), "the tenth frame still counts");
        assert_eq!(count("tlwwwwwwwwwwt"), of(1, 1, 0), "the eleventh does not");
        assert_eq!(count("tlla"), of(2, 1, 0), "absent all along");
    }

    #[test]
    fn the_first_loss_is_said_or_seen_but_only_of_a_target_in_view() {
        let first = |letters| count(letters).first;
        assert_eq!(first("tttt"), 4, "never");
        assert_eq!(first("ttwwlt"), 4, "an edge is enough");
        assert_eq!(first("ttwotl"), 3, "beside it is not");
        assert_eq!(first("taAAtl"), 5, "none can lose what is not there");
        assert_eq!(first("ot"), 0);
        assert_eq!(first(""), 0);
    }
}
