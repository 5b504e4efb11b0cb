//! What a pair of matching networks says of the target, and how far it is believed.
//!
//! Its score map becomes a layer of the response, so that places are chosen by both. Its box is an opinion on centre,
//! width and height: the score says how much of it one frame takes over. What its boxes are off by in the first frames,
//! in which the target is known, is taken off them later. And its score is evidence of whether the target is there at
//! all: together with the filter's response, for the networks take the target's like for the target.

use crate::appearance::Correlator;
use crate::appearance::matching::{Match, Matcher, size_penalty};
use crate::crop::Cropper;
use crate::frame::{Frame, MIN_TARGET_SIDE};
use crate::geometry::{Rect, distance};
use crate::network::SharedMatching;
use crate::output::State;
use crate::params::LcmhtMatching;

/// Scores below this are of nothing.
const LEAST_SCORE: f64 = 0.05;
/// How much a change of size and aspect is held against a match: as NanoTrack V3 is published.
const SIZE_PENALTY: f64 = 0.14;
/// Share of its score that a match loses at the border of the search window.
const WINDOW_INFLUENCE: f64 = 0.4;
/// Width of the Gaussian by which a match answers around its centre, in target sizes.
const SPREAD: f64 = 0.15;
/// A match speaks for a place by a Gaussian that is so many times as wide.
const REACH: f64 = 2.0;
/// Frames in which it is learned what boxes are off by, and share of it that is taken off. A frame whose score is below
/// the last of these tells nothing.
const CALIBRATION: u32 = 4;
const BIAS_SHARE: f64 = 0.75;
const KNOWN_SCORE: f64 = 0.5;
/// The evidence, as logarithm of the odds that the target is there: at a score of a half and no response, for a
/// response in units of the usual one, and for the logarithm of the score's odds. Fitted to the frames of a first run.
const ODDS_AT_ZERO: f64 = -3.0;
const ODDS_OF_RESPONSE: f64 = 1.5;
const ODDS_OF_SCORE: f64 = 1.4;
/// Response above which more of it is no more evidence.
const FULL_RESPONSE: f64 = 1.2;
/// Where something else looks like the target, the response must not be below this, and what it lacks counts so much.
const RIVAL_RESPONSE: f64 = 0.4;
const ODDS_OF_RIVAL: f64 = 12.0;
/// What remains of a rival from one frame to the next.
const RIVAL_KEPT: f64 = 0.95;
/// Something else begins at this distance in target sizes, unless it overlaps the target by more than that.
const ELSEWHERE: f64 = 0.6;
const SAME_PLACE_IOU: f64 = 0.4;
/// Score from which an uncertain target takes over the box.
const BELIEVED: f64 = 0.7;
/// Score from which a size is remembered for the time when the target is lost, and the share of it that is taken in.
const SURE: f64 = 0.85;
const SIZE_KEPT: f64 = 0.1;
/// Score from which a lost target is taken up without the detector's word.
const VOUCHED: f64 = 0.9;
/// Score from which a match is a proposal.
const PROPOSED: f64 = 0.5;

/// The matcher of one target.
pub(super) struct Matching {
    matcher: Matcher,
    /// Matches of the last look, less what they are known to be off by and what is held against them.
    found: Vec<Match>,
    bias: Bias,
    /// The size when it was last sure.
    size: [f64; 2],
    /// The best score of anything else, less the longer that is ago.
    rival: f64,
}

/// What boxes are off by: the centre, in target sizes, and the logarithms of width and height.
#[derive(Default)]
struct Bias {
    mean: [f64; 4],
    /// Frames that it is the mean of.
    frames: u32,
}

impl Bias {
    /// The part of it that is taken off.
    fn share(&self) -> [f64; 4] {
        self.mean.map(|off| BIAS_SHARE * off)
    }

    /// How far it is known, 0 to 1.
    fn known(&self) -> f64 {
        f64::from(self.frames) / f64::from(CALIBRATION)
    }

    /// Takes in a frame in which the target of `truth` was seen as `seen`, this having been taken off already.
    fn learn(&mut self, seen: &Rect, truth: &Rect) {
        self.frames += 1;
        let ([x, y], [u, v]) = (seen.centre(), truth.centre());
        let off = [(x - u) / truth.w, (y - v) / truth.h, (seen.w / truth.w).ln(), (seen.h / truth.h).ln()];
        let taken = self.share();
        for (i, mean) in self.mean.iter_mut().enumerate() {
            *mean += (off[i] + taken[i] - *mean) / f64::from(self.frames);
        }
    }

    /// The box without it, for a target of size `size`.
    fn taken_off(&self, seen: &Rect, size: [f64; 2]) -> Rect {
        let [x, y, w, h] = self.share();
        let centre = [seen.centre()[0] - x * size[0], seen.centre()[1] - y * size[1]];
        Rect::around(centre, [seen.w * (-w).exp(), seen.h * (-h).exp()])
    }
}

impl Matching {
    /// Learns the target in `rect`, and what is seen of it there.
    pub fn new(network: SharedMatching, frame: &Frame, cropper: &mut Cropper, rect: &Rect) -> Self {
        let mut matcher = Matcher::new(network, frame, cropper, rect);
        matcher.look(frame, cropper, rect.centre(), rect.size(), None);
        let found = Vec::with_capacity(matcher.matches().len());
        let mut made = Self { matcher, found, bias: Bias::default(), size: rect.size(), rival: 0.0 };
        made.take_in(rect.size());
        made.calibrate(rect);
        made
    }

    /// Goes on with what runs the same networks by now.
    pub fn use_network(&mut self, network: &SharedMatching) {
        self.matcher.use_network(network);
    }

    /// Looks for the target where the correlator looked, and makes the score map a layer of its response.
    pub fn look(
        &mut self,
        params: &LcmhtMatching,
        frame: &Frame,
        cropper: &mut Cropper,
        size: [f64; 2],
        correlator: &mut Correlator,
    ) {
        let window = correlator.window();
        let middle = window.centre();
        self.matcher.look(frame, cropper, middle, size, correlator.seen_by_network());
        self.take_in(size);
        let [half_w, half_h] = window.size().map(|side| side / 2.0);
        let hann = |offset: f64, half: f64| 0.5 + 0.5 * (std::f64::consts::PI * (offset / half).clamp(-1.0, 1.0)).cos();
        let answer = |found: &Match| {
            let [x, y] = found.rect.centre();
            let hann = hann(x - middle[0], half_w) * hann(y - middle[1], half_h);
            ([x, y], found.score * (1.0 - WINDOW_INFLUENCE + WINDOW_INFLUENCE * hann))
        };
        correlator.add_layer(params.share, SPREAD * scale(size), self.found.iter().map(answer));
    }

    /// Keeps what the last look found.
    fn take_in(&mut self, size: [f64; 2]) {
        let Self { matcher, found, bias, .. } = self;
        found.clear();
        found.extend(matcher.matches().iter().filter(|seen| seen.score > LEAST_SCORE && seen.is_a_box()).map(|seen| {
            let rect = bias.taken_off(&seen.rect, size);
            Match { score: seen.score * size_penalty(SIZE_PENALTY, size, rect.size()), rect }
        }));
    }

    /// The target of size `size` as those cells see it that see it at `place`, and how much the best of them does.
    fn at(&self, place: [f64; 2], size: [f64; 2]) -> Option<Match> {
        let spread = SPREAD * scale(size);
        let (mut weights, mut sum, mut score) = (0.0, [0.0; 4], 0.0f64);
        for found in &self.found {
            let d = distance(found.rect.centre(), place) / spread;
            let weight = found.score * (-0.5 * d * d).exp();
            let Rect { x, y, w, h } = found.rect;
            sum.iter_mut().zip([x, y, w, h]).for_each(|(sum, v)| *sum += weight * v);
            weights += weight;
            score = score.max(found.score * (-0.5 * (d / REACH).powi(2)).exp());
        }
        let [x, y, w, h] = sum.map(|v| v / weights);
        (score > LEAST_SCORE && weights > f64::MIN_POSITIVE).then(|| Match { rect: Rect::new(x, y, w, h), score })
    }

    /// How probable it is that the target of size `size` is at `place`, where the filter answers with `response` in
    /// units of the usual response. Of a lost target, anything may be a rival.
    pub fn probability(&self, response: f64, place: [f64; 2], size: [f64; 2], state: State) -> f64 {
        let score = self.at(place, size).map_or(0.0, |seen| seen.score);
        // As far from 0 and 1 as a score can be believed.
        let odds = ((score + 1e-3) / (1.0 - score + 1e-3)).ln();
        let rival = if state == State::Lost { 1.0 } else { self.rival };
        let lacking = (RIVAL_RESPONSE - response).max(0.0);
        let evidence = ODDS_AT_ZERO + ODDS_OF_RESPONSE * response.min(FULL_RESPONSE) + ODDS_OF_SCORE * odds
            - ODDS_OF_RIVAL * rival * lacking;
        1.0 / (1.0 + (-evidence).exp())
    }

    /// How sure the networks are of the best place that they saw in the last look.
    pub fn best_score(&self) -> f64 {
        self.matcher.matches().iter().map(|seen| seen.score).fold(0.0, f64::max)
    }

    /// How sure they were of the best other place, less the longer that is ago.
    pub fn rival(&self) -> f64 {
        self.rival
    }

    /// Whether a lost target of size `size` may be taken up at `place` on the networks' word.
    pub fn vouches_for(&self, place: [f64; 2], size: [f64; 2]) -> bool {
        self.at(place, size).is_some_and(|seen| seen.score > VOUCHED)
    }

    /// The best match of the last look, if it is worth a look.
    pub fn proposal(&self) -> Option<Match> {
        let best = self.found.iter().max_by(|a, b| a.score.total_cmp(&b.score));
        best.copied().filter(|found| found.score > PROPOSED)
    }

    /// The target in `rect` as it is by the networks, as far as they are believed.
    pub fn settled(&mut self, params: &LcmhtMatching, frame: &Frame, rect: &Rect, state: State) -> Rect {
        let Some(seen) = self.at(rect.centre(), rect.size()).filter(|_| state != State::Lost) else { return *rect };
        if state == State::Uncertain && seen.score < BELIEVED {
            return *rect;
        }
        let known = self.bias.known();
        let rates = [params.centre_rate * seen.score, params.size_rate * seen.score.powi(2)].map(|rate| known * rate);
        let blend = |from: [f64; 2], to: [f64; 2], rate: f64| [0, 1].map(|i| from[i] + rate * (to[i] - from[i]));
        let most = [frame.width(), frame.height()].map(|side| f64::from(side).max(MIN_TARGET_SIDE));
        let size = blend(rect.size(), seen.rect.size(), rates[1]);
        let size = [0, 1].map(|i| size[i].clamp(MIN_TARGET_SIDE, most[i]));
        let settled = Rect::around(frame.nearest(blend(rect.centre(), seen.rect.centre(), rates[0])), size);
        if state == State::Tracking {
            self.calibrate(&settled);
        }
        self.watch_rivals(&settled);
        if seen.score > SURE {
            self.size = blend(self.size, size, SIZE_KEPT);
        }
        settled
    }

    /// The size when the networks were last sure of it.
    pub fn last_size(&self) -> [f64; 2] {
        self.size
    }

    /// Learns what boxes are off by, from one of the first frames, in which the target is in `rect`.
    fn calibrate(&mut self, rect: &Rect) {
        if self.bias.frames >= CALIBRATION {
            return;
        }
        if let Some(seen) = self.at(rect.centre(), rect.size()).filter(|seen| seen.score >= KNOWN_SCORE) {
            self.bias.learn(&seen.rect, rect);
        }
    }

    /// Takes in whether something else looks like the target in `rect`.
    fn watch_rivals(&mut self, rect: &Rect) {
        let is_elsewhere = |found: &&Match| {
            distance(found.rect.centre(), rect.centre()) > ELSEWHERE * rect.scale()
                && found.rect.iou(rect) < SAME_PLACE_IOU
        };
        let best = self.found.iter().filter(is_elsewhere).map(|found| found.score).fold(0.0, f64::max);
        self.rival = best.max(RIVAL_KEPT * self.rival);
    }
}

/// The side of the square of a size's area.
fn scale([w, h]: [f64; 2]) -> f64 {
    (w * h).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_boxes_are_off_by_in_the_first_frames_is_taken_off_for_the_most_part() {
        let truth = Rect::new(100.0, 50.0, 40.0, 80.0);
        // A tenth to the right, a fifth too wide, an eighth too low.
        let seen = Rect::around([truth.centre()[0] + 4.0, truth.centre()[1]], [48.0, 70.0]);
        let mut bias = Bias::default();
        for _ in 0..CALIBRATION {
            bias.learn(&bias.taken_off(&seen, truth.size()), &truth);
        }
        assert_eq!(bias.known(), 1.0);
        let [x, y, w, h] = bias.mean;
        assert!((x - 0.1).abs() < 1e-9 && y.abs() < 1e-9, "{x} {y}");
        assert!((w - 1.2f64.ln()).abs() < 1e-9 && (h - 0.875f64.ln()).abs() < 1e-9, "{w} {h}");
        let corrected = bias.taken_off(&seen, truth.size());
        assert!((corrected.centre()[0] - truth.centre()[0] - 1.0).abs() < 1e-9, "{corrected}");
        assert!((corrected.w - 48.0 / 1.2f64.powf(0.75)).abs() < 1e-9, "{corrected}");
    }
}
