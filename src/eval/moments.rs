//! The frames of a run that are worth looking at.

use super::answer::Answer;
use crate::geometry::Rect;

/// The worst frames of a run, at most so many, in order. How bad a frame is counts by the overlap that is missing;
/// where the target is not in view, a frame is as bad as can be unless the target was said to be lost. The worst is
/// taken first, of several the earliest, and the frames around it are left out, so that one failure does not take all
/// the places. The first frame, whose box was given, is never among them.
pub fn worst(answers: &[Answer], truth: &[Option<Rect>], count: usize) -> Vec<usize> {
    let badness = |(answer, truth): (&Answer, &Option<Rect>)| match truth {
        Some(_) => 1.0 - answer.overlap(*truth),
        None => f64::from(u8::from(!answer.is_lost())),
    };
    let badness: Vec<f64> = answers.iter().zip(truth).map(badness).collect();
    let apart = badness.len().div_ceil(2 * count.max(1));
    let mut found: Vec<usize> = Vec::new();
    while found.len() < count {
        let open = (1..badness.len()).filter(|&i| badness[i] > 0.0 && found.iter().all(|&f| f.abs_diff(i) >= apart));
        // Of equals `max_by` takes the last.
        let Some(next) = open.rev().max_by(|&a, &b| badness[a].total_cmp(&badness[b])) else { break };
        found.push(next);
    }
    found.sort_unstable();
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracker::State;

    const BOX: Rect = Rect::new(0.0, 0.0, 10.0, 10.0);

    /// Answers by how far they are off.
    fn answers(shifts: &[f64]) -> Vec<Answer> {
        let answer = |&shift: &f64| Answer {
            rect: BOX.shifted(shift, 0.0),
            confidence: None,
            state: State::Tracking,
            reacquired: false,
        };
        shifts.iter().map(answer).collect()
    }

    #[test]
    fn the_worst_frames_are_taken_and_their_neighbours_left_out() {
        let mut shifts = [0.0; 40];
        shifts[0] = 20.0;
        (10..16).for_each(|i| shifts[i] = 20.0);
        shifts[25] = 4.0;
        shifts[27] = 5.0;
        shifts[38] = 1.0;
        let run = answers(&shifts);
        assert_eq!(worst(&run, &[Some(BOX); 40], 4), [10, 15, 27, 38], "10 ends where 15 begins: five are left out");
        assert_eq!(worst(&run, &[Some(BOX); 40], 1), [10]);
        assert!(worst(&answers(&[0.0; 9]), &[Some(BOX); 9], 4).is_empty(), "nothing is amiss");
    }

    #[test]
    fn saying_nothing_of_an_absence_is_bad_and_saying_it_is_not() {
        let mut run = answers(&[0.0; 4]);
        let truth = [Some(BOX), Some(BOX), None, None];
        assert_eq!(worst(&run, &truth, 4), [2, 3]);
        run[2].state = State::Lost;
        run[3].state = State::Lost;
        assert!(worst(&run, &truth, 4).is_empty());
    }
}
