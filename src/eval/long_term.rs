//! Long-term tracking's precision, recall and F (Lukezic, Cehovin Zajc, Vojir, Matas and Kristan, *Now you see me:
//! evaluating performance in long-term visual tracking*, arXiv 1804.07056, section 3).
//!
//! A tracker answers with a box and a confidence, or not at all. With only the answers of at least the confidence tau,
//!
//! * precision `Pr(tau)` is the mean overlap of the answers with the true box, where an answer of a target that is not
//!   to be seen overlaps nothing: wrong boxes and boxes of nothing lower it;
//! * recall `Re(tau)` is the mean overlap over the frames in which the target is to be seen, where no answer overlaps
//!   nothing: silence lowers it;
//! * `F(tau) = 2 Pr Re / (Pr + Re)`, and the tracker's figures are those at the tau of the largest F.
//!
//! Here a tracker that says `lost` gives no answer on that frame, whatever its best guess; and a target is not to be
//! seen where it is out of view or fully hidden ([`Sequence::visible`](super::dataset::Sequence::visible)). Over
//! several sequences, `Pr` and `Re` are means over these at the same tau. Trackers without confidence have one `F`.

use serde::Serialize;

use super::answer::Answer;
use crate::geometry::Rect;

/// Precision, recall and F at one threshold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Point {
    /// `Pr`.
    pub precision: f64,
    /// `Re`.
    pub recall: f64,
    /// `F`.
    pub f: f64,
}

impl Point {
    fn new(precision: f64, recall: f64) -> Self {
        let sum = precision + recall;
        Self { precision, recall, f: if sum > 0.0 { 2.0 * precision * recall / sum } else { 0.0 } }
    }
}

/// The figures of one or more sequences.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct LongTerm {
    /// Where F is largest.
    #[serde(flatten)]
    pub best: Point,
    /// The confidence from which answers count there; `None` of trackers without.
    pub threshold: Option<f64>,
    /// With every answer, as the tracker gives them.
    pub all: Point,
}

/// What the answers of one sequence add up to from each confidence on.
#[derive(Clone, Debug)]
pub struct Profile {
    /// Falling confidence, and of the answers of at least that, their number and the sum of their overlaps.
    steps: Vec<(f64, usize, f64)>,
    /// Frames in which the target is to be seen.
    visible: usize,
    has_confidence: bool,
}

impl Profile {
    /// Adds up the answers against the true box where the target is to be seen; `None` where it never is.
    pub fn new(answers: &[Answer], visible: &[Option<Rect>]) -> Option<Self> {
        let given: Vec<_> = answers.iter().zip(visible).filter(|(a, _)| !a.is_lost()).collect();
        let has_confidence = given.iter().all(|(a, _)| a.confidence.is_some());
        let confidence = |a: &Answer| a.confidence.filter(|_| has_confidence).unwrap_or(1.0);
        let mut rows: Vec<_> = given.iter().map(|(a, t)| (confidence(a), a.overlap(**t))).collect();
        rows.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut steps: Vec<(f64, usize, f64)> = Vec::new();
        let mut sum = 0.0;
        for (i, (confidence, overlap)) in rows.into_iter().enumerate() {
            sum += overlap;
            if steps.last().is_some_and(|s| s.0 == confidence) {
                steps.pop();
            }
            steps.push((confidence, i + 1, sum));
        }
        let visible = visible[..answers.len()].iter().flatten().count();
        (visible > 0).then_some(Self { steps, visible, has_confidence })
    }

    /// `Pr` and `Re` with the answers of at least this confidence. Without any answer there is no wrong one, and `Pr`
    /// is 1, as in the benchmark's own code.
    fn at(&self, threshold: f64) -> (f64, f64) {
        match self.steps.partition_point(|s| s.0 >= threshold).checked_sub(1) {
            None => (1.0, 0.0),
            Some(last) => {
                let (_, count, sum) = self.steps[last];
                (sum / count as f64, sum / self.visible as f64)
            }
        }
    }
}

/// The figures over all sequences at one threshold.
fn point(profiles: &[&Profile], threshold: f64) -> Point {
    let count = profiles.len() as f64;
    let (p, r) = profiles.iter().map(|p| p.at(threshold)).fold((0.0, 0.0), |sum, at| (sum.0 + at.0, sum.1 + at.1));
    Point::new(p / count, r / count)
}

/// The confidences that any answer has, from the least.
fn thresholds(profiles: &[&Profile]) -> Vec<f64> {
    let mut all: Vec<f64> = profiles.iter().flat_map(|p| p.steps.iter().map(|s| s.0)).collect();
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

/// The figures over all sequences at the threshold of the largest F, of several such at the least.
pub fn best(profiles: &[&Profile]) -> LongTerm {
    if profiles.is_empty() {
        return LongTerm::default();
    }
    let all = point(profiles, f64::NEG_INFINITY);
    let mut found = LongTerm { best: all, threshold: None, all };
    for threshold in thresholds(profiles) {
        let at = point(profiles, threshold);
        if found.threshold.is_none() || at.f > found.best.f {
            found = LongTerm { best: at, threshold: Some(threshold), all };
        }
    }
    if profiles.iter().any(|p| !p.has_confidence) {
        found.threshold = None;
    }
    found
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::tracker::State;

    const BOX: Rect = Rect::new(100.0, 50.0, 10.0, 20.0);

    fn answer(shift: f64, confidence: f64, state: State) -> Answer {
        Answer { rect: BOX.shifted(shift, 0.0), confidence: Some(confidence), state, reacquired: false }
    }

    fn of(answers: &[Answer], visible: &[Option<Rect>]) -> LongTerm {
        best(&[&Profile::new(answers, visible).unwrap()])
    }

    /// Five frames by hand: exact and sure; half shifted (overlap 1/3) and fairly sure; absent but answered, unsure;
    /// absent and said so; there but said lost.
    #[test]
    fn figures_agree_with_those_computed_by_hand() {
        let answers = [
            answer(0.0, 0.9, State::Tracking),
            answer(5.0, 0.8, State::Uncertain),
            answer(0.0, 0.3, State::Tracking),
            answer(0.0, 0.7, State::Lost),
            answer(0.0, 0.1, State::Lost),
        ];
        let visible = [Some(BOX), Some(BOX), None, None, Some(BOX)];
        let found = of(&answers, &visible);
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        // All: three answers that overlap by 1, 1/3 and 0; three frames with the target.
        close(found.all.precision, 4.0 / 9.0);
        close(found.all.recall, 4.0 / 9.0);
        close(found.all.f, 4.0 / 9.0);
        // From 0.8: Pr = 2/3, Re = 4/9, F = 8/15; from 0.9: Pr = 1, Re = 1/3, F = 1/2.
        assert_eq!(found.threshold, Some(0.8));
        close(found.best.precision, 2.0 / 3.0);
        close(found.best.recall, 4.0 / 9.0);
        close(found.best.f, 8.0 / 15.0);
    }

    #[test]
    fn a_tracker_without_confidence_has_one_f() {
        let mute = |shift, state| Answer { confidence: None, ..answer(shift, 0.0, state) };
        let answers = [mute(0.0, State::Tracking), mute(5.0, State::Tracking), mute(0.0, State::Lost)];
        let found = of(&answers, &[Some(BOX), None, Some(BOX)]);
        assert_eq!((found.threshold, found.best), (None, Point::new(0.5, 0.5)));
        assert_eq!(found.all, found.best);
    }

    #[test]
    fn silence_is_precise_and_recalls_nothing() {
        let found = of(&[answer(0.0, 0.5, State::Lost)], &[Some(BOX)]);
        assert_eq!((found.best, found.threshold), (Point { precision: 1.0, recall: 0.0, f: 0.0 }, None));
        assert!(Profile::new(&[answer(0.0, 0.5, State::Tracking)], &[None]).is_none());
        assert_eq!(best(&[]), LongTerm::default());
    }

    /// The definition word by word, at every confidence that occurs.
    fn naive(sequences: &[(Vec<Answer>, Vec<Option<Rect>>)]) -> LongTerm {
        let at = |threshold: f64| {
            let mut mean = (0.0, 0.0);
            for (answers, visible) in sequences {
                let (mut overlap, mut given, mut there) = (0.0, 0, 0);
                for (answer, truth) in answers.iter().zip(visible) {
                    there += usize::from(truth.is_some());
                    if answer.state != State::Lost && answer.confidence.unwrap() >= threshold {
                        given += 1;
                        overlap += truth.map_or(0.0, |t| t.iou(&answer.rect));
                    }
                }
                mean.0 += if given == 0 { 1.0 } else { overlap / f64::from(given) } / sequences.len() as f64;
                mean.1 += overlap / there as f64 / sequences.len() as f64;
            }
            Point::new(mean.0, mean.1)
        };
        let given = sequences.iter().flat_map(|s| &s.0).filter(|a| a.state != State::Lost);
        let mut all: Vec<f64> = given.map(|a| a.confidence.unwrap()).collect();
        all.sort_by(f64::total_cmp);
        let (threshold, best) = all
            .into_iter()
            .map(|t| (t, at(t)))
            .fold((0.0, Point::default()), |best, next| if next.1.f > best.1.f + 1e-12 { next } else { best });
        LongTerm { best, threshold: Some(threshold), all: at(f64::NEG_INFINITY) }
    }

    #[test]
    fn sums_from_each_confidence_on_give_what_the_definition_gives() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut sequence = |frames: usize| {
            let mut answers = Vec::new();
            let mut visible = vec![Some(BOX)];
            for _ in 0..frames {
                let shift: f64 = rng.random_range(0.0..12.0);
                // Rounded, so that confidences repeat; sinking with the overlap, so that the best is in the middle.
                let confidence = ((1.0 - shift / 15.0 + rng.random_range(-0.2..0.2)) * 20.0).round() / 20.0;
                let state = if rng.random_bool(0.2) { State::Lost } else { State::Tracking };
                answers.push(answer(shift, confidence, state));
                visible.push(rng.random_bool(0.7).then_some(BOX));
            }
            visible.truncate(frames);
            (answers, visible)
        };
        let sequences = [sequence(40), sequence(90), sequence(15)];
        let profiles: Vec<_> = sequences.iter().map(|(a, v)| Profile::new(a, v).unwrap()).collect();
        let (fast, slow) = (best(&profiles.iter().collect::<Vec<_>>()), naive(&sequences));
        assert_eq!(fast.threshold, slow.threshold);
        for (a, b) in [(fast.best, slow.best), (fast.all, slow.all)] {
            assert!((a.precision - b.precision).abs() + (a.recall - b.recall).abs() + (a.f - b.f).abs() < 1e-12);
        }
        assert!(fast.best.f > fast.all.f + 0.01, "the threshold must matter: {fast:?}");
    }
}
