//! Whether what is followed is still the target that was marked: a judge whose evidence the followed box cannot bend.
//!
//! Filter, scale filter and detector go on learning, and so does what counts as a usual response: whatever is followed
//! soon looks right to them. The judge keeps the mean of the target's first looks, as the detector sees them (HOG; LUV
//! colour with gradient magnitude), and compares every frame with it. It weighs how alike they are and how well
//! anything else in the search window answers. With matching networks, whose template is the marked target as well, it
//! weighs how sure they are of the best place that they see and of any other. It gives the probability that the box
//! overlaps the target by more than half.

use super::matching::Matching;
use crate::detect::online::Example;

/// The weights of the evidence in the logarithm of the odds: by logistic regression over the frames of 47 real
/// sequences, each weighted by the root of its length. The curve without matching networks is one for all presets.
struct Curve {
    at_zero: f64,
    /// Of the mean likeness to the first looks, in gradients and in colours.
    likeness: [f64; 2],
    /// Of the best answer elsewhere, in units of the target's.
    elsewhere: f64,
    /// Of the logarithm of the odds of the networks' best score, and of their best score elsewhere.
    scores: [f64; 2],
}

const BY_LOOKS: Curve = Curve { at_zero: -16.0, likeness: [14.1, 8.4], elsewhere: -3.0, scores: [0.0, 0.0] };
const BY_LOOKS_AND_NETWORKS: Curve =
    Curve { at_zero: -11.4, likeness: [4.9, 5.4], elsewhere: 0.0, scores: [0.91, -0.42] };
/// As far from 0 and 1 as a score can be believed.
const SCORE_MARGIN: f64 = 0.01;

/// The judge of one target.
pub(super) struct Judge {
    /// The mean of the first looks, and how many it is of.
    look: Example,
    looks: u32,
    /// Looks that it is made of at most; with none, nothing is judged.
    most: u32,
    probability: f64,
}

impl Judge {
    /// A judge that learns so many looks.
    pub fn new(most: u32) -> Self {
        Self { look: Example::default(), looks: 0, most, probability: 1.0 }
    }

    /// Learns so many looks from now on; those that it has learned stay.
    pub fn retune(&mut self, most: u32) {
        if most == 0 {
            self.probability = 1.0;
        }
        self.most = most;
    }

    /// Whether it judges: it is to, and knows a look.
    pub fn is_asked(&self) -> bool {
        self.most > 0 && self.looks > 0
    }

    /// Whether it has not learned enough looks.
    pub fn learns(&self) -> bool {
        self.looks < self.most
    }

    /// Learns a look at the target.
    pub fn learn(&mut self, seen: &Example) {
        self.look.take_in(seen, self.looks);
        self.looks += 1;
    }

    /// The probability by the last evidence, 1 before any.
    pub fn probability(&self) -> f64 {
        self.probability
    }

    /// Whether the box shows the target rather than not.
    pub fn is_sure(&self) -> bool {
        self.probability >= 0.5
    }

    /// How probable it is by looks alone that what is seen is the target.
    pub fn recognises(&self, seen: &Example) -> f64 {
        probability(BY_LOOKS.at_zero + dot(BY_LOOKS.likeness, self.look.cosines(seen)))
    }

    /// Weighs the evidence of a frame: what is seen in the box, the best answer elsewhere in units of the answer there,
    /// and what matching networks say.
    pub fn weigh(&mut self, seen: &Example, elsewhere: f64, matching: Option<&Matching>) {
        let curve = if matching.is_some() { &BY_LOOKS_AND_NETWORKS } else { &BY_LOOKS };
        let odds = |score: f64| ((score + SCORE_MARGIN) / (1.0 - score + SCORE_MARGIN)).ln();
        let scores = matching.map_or([0.0; 2], |matching| [matching.best_score(), matching.rival()].map(odds));
        self.probability = probability(
            curve.at_zero
                + dot(curve.likeness, self.look.cosines(seen))
                + curve.elsewhere * elsewhere
                + dot(curve.scores, scores),
        );
    }
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// The probability of which this is the logarithm of the odds.
fn probability(log_odds: f64) -> f64 {
    1.0 / (1.0 + (-log_odds).exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crop::Cropper;
    use crate::detect::online::{Detector, DetectorSettings};
    use crate::frame::{Encoding, Frame};
    use crate::geometry::Rect;

    #[test]
    fn the_probability_follows_from_likeness_and_from_what_else_answers() {
        let data: Vec<u8> = (0..64 * 64 * 3u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        let frame = Frame::new(&data, 64, 64, 192, Encoding::Rgb8, None).unwrap();
        let (target, other) = (Rect::new(8.0, 8.0, 20.0, 30.0), Rect::new(34.0, 20.0, 20.0, 30.0));
        let (mut cropper, mut detector) = (Cropper::default(), Detector::new(DetectorSettings::PAPER, &target, 0));
        let look = detector.see(&frame, &mut cropper, &target).clone();
        let elsewhere = detector.see(&frame, &mut cropper, &other).clone();
        let mut judge = Judge::new(2);
        assert!(!judge.is_asked() && judge.is_sure());
        judge.learn(&look);
        assert!(judge.is_asked());
        // Cosines of 1: 14.1 + 8.4 - 16 = 6.5, less 3 for an equal answer elsewhere.
        for (best, log_odds) in [(0.0, 6.5f64), (1.0, 3.5)] {
            judge.weigh(&look, best, None);
            let want = 1.0 / (1.0 + (-log_odds).exp());
            assert!((judge.probability() - want).abs() < 1e-3, "{} {want}", judge.probability());
        }
        // The mean look of both is less like either.
        judge.learn(&elsewhere);
        assert!(!judge.learns());
        let [gradients, colours] = look.cosines(&elsewhere);
        let want = -16.0 + 14.1 * (1.0 + gradients) / 2.0 + 8.4 * (1.0 + colours) / 2.0;
        assert!((judge.recognises(&look) - 1.0 / (1.0 + (-want).exp())).abs() < 1e-3);
        judge.retune(0);
        assert!(!judge.is_asked() && judge.is_sure());
    }
}
