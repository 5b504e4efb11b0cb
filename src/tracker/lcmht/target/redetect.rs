//! A lost target is searched for, and taken up again where it is found.

use super::{LcmhtTarget, Localised};
use crate::appearance::Answer;
use crate::appearance::matching::Match;
use crate::crop::Cropper;
use crate::frame::Frame;
use crate::geometry::Rect;
use crate::trace::{Event, Proposal, Trace};
use crate::tracker::lcmht::matching::Matching;

/// Probability by looks from which on a place anywhere in the image is worth a look.
const WORTH_A_LOOK: f64 = 0.5;
/// How sure the judge must be to take up a target near where it was expected, and anywhere else: of all the places in
/// an image, some always look a little like the target.
const NEAR: f64 = 0.5;
const ANYWHERE: f64 = 0.9;

/// The target, found again.
struct Again {
    answer: Answer,
    size: [f64; 2],
}

impl LcmhtTarget {
    /// Takes up a lost target where correlation filter, detector and judge agree that it is: where it was expected,
    /// where the detector proposes and the GM-PHD filter finds it most likely, or anywhere else in the image.
    pub(super) fn redetect(
        &mut self,
        found: &mut Localised,
        frame: &Frame,
        cropper: &mut Cropper,
        trace: &mut dyn Trace,
    ) {
        let again = self.again(found, frame, cropper).or_else(|| self.proposed(found, frame, cropper, trace));
        if let Some(Again { answer, size }) = again {
            (found.response, found.judged) = (answer.response, self.agreed(&answer, size));
            self.appearance.confidence.found();
            found.state = self.appearance.state();
            found.rect = Rect::around(answer.centre, size);
        }
    }

    /// The answer where the target was expected, if that is the target. Without the gate it stays in the image.
    fn again(&mut self, found: &Localised, frame: &Frame, cropper: &mut Cropper) -> Option<Again> {
        let (mut answer, size) = (found.answer, self.rect.size());
        if !self.params.confidence.gate {
            answer.centre = found.rect.centre();
        }
        let is_certain = self.appearance.confidence.is_certain(self.agreed(&answer, size));
        (is_certain && self.is_it(&answer, size, NEAR, frame, cropper)).then_some(Again { answer, size })
    }

    /// What the detector proposes around the place where the target was expected, the networks in the search window
    /// and the sweep anywhere, filtered by the GM-PHD filter: the heaviest component, or else the sweep's place, as the
    /// correlation filter sees it, if that is the target. Without the gate the target is where that component is, as in
    /// Algorithm 1, otherwise where the filter answers best around it.
    fn proposed(
        &mut self,
        found: &Localised,
        frame: &Frame,
        cropper: &mut Cropper,
        trace: &mut dyn Trace,
    ) -> Option<Again> {
        self.detector.scan(frame, cropper, &found.rect, &mut self.proposals);
        let matched = self.matching.as_ref().and_then(Matching::proposal);
        self.proposals.extend(matched.map(|Match { rect, score }| Proposal { rect, score }));
        let anywhere = self.sweep(frame, cropper);
        self.proposals.extend(anywhere);
        trace.event(Event::Proposals(&self.proposals));
        let heaviest = self.motion.filter(self.proposals.iter().map(|p| p.rect));
        let size = self.rect.size();
        let again = heaviest.and_then(|it| self.look_there(it.centre(), size, NEAR, frame, cropper));
        again.or_else(|| {
            let Proposal { rect, .. } = anywhere?;
            self.look_there(rect.centre(), rect.size(), ANYWHERE, frame, cropper)
        })
    }

    /// The place that the judge recognises best in the next areas of the image, if it is worth a look.
    fn sweep(&mut self, frame: &Frame, cropper: &mut Cropper) -> Option<Proposal> {
        let Self { sweep, detector, judge, rect, .. } = self;
        if self.lost_for == 0 {
            sweep.restart();
        }
        if !judge.is_asked() {
            return None;
        }
        let mut best: Option<Proposal> = None;
        for area in sweep.areas(&frame.bounds(), rect.size(), self.params.svm.areas as usize) {
            if let Some((rect, score)) = detector.search(frame, cropper, &area, |seen| judge.recognises(seen))
                && score >= best.map_or(WORTH_A_LOOK, |best| best.score)
            {
                best = Some(Proposal { rect, score });
            }
        }
        best
    }

    /// What the correlation filter answers to a target of that size around `place`, if that is the target and the judge
    /// is at least so sure.
    fn look_there(
        &mut self,
        place: [f64; 2],
        size: [f64; 2],
        least: f64,
        frame: &Frame,
        cropper: &mut Cropper,
    ) -> Option<Again> {
        let place = frame.nearest(place);
        self.appearance.correlator.look(frame, cropper, place, size, self.turn.degrees());
        self.match_there(frame, cropper, size);
        let mut answer = self.appearance.correlator.highest();
        if !self.params.confidence.gate {
            answer.centre = place;
        }
        let is_convincing = self.appearance.confidence.is_convincing(self.agreed(&answer, size));
        (is_convincing && self.is_it(&answer, size, least, frame, cropper)).then_some(Again { answer, size })
    }

    /// Whether detector and judge, who must be at least so sure, take what is there for the target, and it is no
    /// neighbour.
    fn is_it(&mut self, answer: &Answer, size: [f64; 2], least: f64, frame: &Frame, cropper: &mut Cropper) -> bool {
        let place = Rect::around(answer.centre, size);
        if self.neighbours.is_at(answer.centre, place.scale()) {
            return false;
        }
        self.detector.see(frame, cropper, &place);
        self.ask(answer, size);
        if self.judge.probability() < least {
            return false;
        }
        let vouched = |matching: &Matching| matching.vouches_for(answer.centre, size);
        self.matching.as_ref().is_some_and(vouched) || self.detector.margin_of_seen() >= self.params.svm.least_margin
    }
}
