//! One target, followed from frame to frame by Algorithm 1.

mod redetect;

use std::sync::Arc;

use super::judge::Judge;
use super::matching::Matching;
use super::motion::TargetMotion;
use super::neighbours::{LEAST_FIT, Neighbours};
use super::settings;
use super::sweep::Sweep;
use super::turn::{self, Fit, Turn};
use crate::appearance::{Answer, Appearance};
use crate::crop::Cropper;
use crate::detect::online::Detector;
use crate::frame::Frame;
use crate::geometry::{Rect, distance};
use crate::network::Networks;
use crate::params::{Group as _, LcmhtParams, Need};
use crate::trace::{Event, Proposal, Stage, Thresholds, Trace};
use crate::tracker::targets::Followed;
use crate::tracker::{State, Target};

/// Share of the usual response that a peak must have to be the target's where a neighbour needs a better one.
const ALTERNATIVE: f64 = 0.25;
/// Distance in target sizes from which on two expected places are looked at one by one.
const OTHER_PLACE: f64 = 0.1;
/// Distance in target sizes from which on an answer is of something else.
const ELSEWHERE: f64 = 0.5;
/// Margin above which a peak is taken for a neighbour.
const ALIKE: f64 = 0.0;

/// A target and all that is known of it.
pub(super) struct LcmhtTarget {
    id: Arc<str>,
    pub(super) params: LcmhtParams,
    rect: Rect,
    /// Whether the last frame had colour.
    colour: bool,
    pub(super) appearance: Appearance,
    matching: Option<Matching>,
    motion: TargetMotion,
    neighbours: Neighbours,
    detector: Detector,
    judge: Judge,
    sweep: Sweep,
    proposals: Vec<Proposal>,
    response: f64,
    /// The response as far as the detector lets it count.
    judged: f64,
    thresholds: Thresholds,
    turn: Turn,
    /// Whether nothing at all was to be seen where it was looked for in the last frame: then the box stays where it is.
    blind: bool,
    age: u32,
    updates: u32,
    lost_for: u32,
    reacquired: bool,
}

/// Where a target is expected.
#[derive(Clone, Copy)]
struct Expected {
    place: [f64; 2],
    /// Frame periods since the frame before.
    elapsed: f64,
}

/// What a frame tells of a target: it goes from stage to stage.
struct Localised {
    /// Where it was expected.
    expected: Expected,
    /// The filter's answer there: `(x_k, y_k)` and `max(r)` of Algorithm 1.
    answer: Answer,
    /// Where it is taken to be.
    rect: Rect,
    /// The response there.
    response: f64,
    /// The response as far as the detector lets it count.
    judged: f64,
    /// How sure it was in the frame before, and is now.
    before: State,
    state: State,
    /// Whether it moved so little that its size can be told: what moves fast is blurred, which looks like another size.
    steady: bool,
}

impl Localised {
    /// Whether it was found again in this frame.
    fn is_reacquired(&self) -> bool {
        self.before == State::Lost && self.state == State::Tracking
    }
}

impl Followed for LcmhtTarget {
    fn id(&self) -> &Arc<str> {
        &self.id
    }

    fn report(&self) -> Target {
        Target {
            id: self.id.clone(),
            rect: self.rect,
            velocity: if self.blind { [0.0; 2] } else { self.motion.velocity() },
            confidence: self.confidence() as f32,
            response: self.response as f32,
            state: self.state(),
            reacquired: self.reacquired,
            age: self.age,
            lost_for: self.lost_for,
        }
    }

    fn thresholds(&self) -> Option<Thresholds> {
        Some(self.thresholds)
    }
}

impl LcmhtTarget {
    pub(super) fn new(
        id: Arc<str>,
        params: &LcmhtParams,
        networks: Networks,
        seed: u64,
        frame: &Frame,
        cropper: &mut Cropper,
        rect: Rect,
    ) -> Self {
        let (appearance, response) =
            Appearance::new(&settings::appearance(params), networks.cnn, frame, cropper, &rect);
        let matching = networks.matching.map(|network| Matching::new(network, frame, cropper, &rect));
        let mut detector = Detector::new(settings::detector(&params.svm), &rect, seed);
        detector.learn(frame, cropper, &rect);
        let mut judge = Judge::new(params.confidence.looks as u32);
        if judge.learns() {
            judge.learn(detector.see(frame, cropper, &rect));
        }
        let thresholds = appearance.confidence.thresholds();
        Self {
            id,
            rect,
            colour: frame.encoding().is_colour(),
            appearance,
            matching,
            motion: TargetMotion::new(&params.motion, &rect, frame.bounds().area()),
            neighbours: Neighbours::new(&params.neighbours),
            detector,
            judge,
            sweep: Sweep::default(),
            proposals: Vec::new(),
            response,
            judged: response,
            thresholds,
            turn: Turn::upright(),
            blind: false,
            age: 0,
            updates: 0,
            lost_for: 0,
            reacquired: false,
            params: params.clone(),
        }
    }

    /// The state that is reported: a target that the judge does not know is not tracked.
    fn state(&self) -> State {
        match self.appearance.state() {
            State::Tracking if !self.judge.is_sure() => State::Uncertain,
            state => state,
        }
    }

    /// What is reported: the judge's probability if there is a judge, otherwise that which filter and matching networks
    /// agree on, or which follows from the filter's response alone.
    fn confidence(&self) -> f64 {
        let confidence = &self.appearance.confidence;
        if self.judge.is_asked() && self.params.confidence.calibrated {
            return confidence.discounted(self.judge.probability());
        }
        match &self.matching {
            Some(_) => confidence.reported_probability(self.judged),
            None => confidence.reported(self.judged),
        }
    }

    /// Follows the target into the next frame: Algorithm 1.
    pub(super) fn step(&mut self, frame: &Frame, cropper: &mut Cropper, dt: f64, trace: &mut dyn Trace) {
        self.age = self.age.saturating_add(1);
        trace.event(Event::Stage(Stage::Features));
        let expected = self.look(frame, cropper, dt, trace);
        trace.event(Event::Stage(Stage::Localise));
        let mut localised = self.localise(expected, frame, cropper);
        self.watch_neighbours(&localised, frame, cropper, trace);
        self.measure(&localised);
        if localised.state == State::Lost {
            trace.event(Event::Stage(Stage::Redetect));
            self.redetect(&mut localised, frame, cropper, trace);
        }
        self.settle(&localised, frame, cropper, trace);
        trace.event(Event::Stage(Stage::Learn));
        self.learn(&localised, frame, cropper);
    }

    /// Looks for the target where it is expected, in turned pictures as well if it answers poorly: features and
    /// response map (eqs 5 and 6). Moves what is known of motion on to this frame.
    fn look(&mut self, frame: &Frame, cropper: &mut Cropper, dt: f64, trace: &mut dyn Trace) -> Expected {
        let expected = self.look_ahead(frame, cropper, dt);
        self.motion.predict(expected.elapsed);
        self.neighbours.predict(expected.elapsed);
        trace.event(Event::Prediction(Rect::around(expected.place, self.rect.size())));
        self.blind = self.appearance.correlator.is_blank();
        self.look_turned(frame, cropper);
        self.match_there(frame, cropper, self.rect.size());
        self.appearance.correlator.show(trace);
        expected
    }

    /// Looks for the target by the matching networks where the filter looked.
    fn match_there(&mut self, frame: &Frame, cropper: &mut Cropper, size: [f64; 2]) {
        if let Some(matching) = &mut self.matching {
            let correlator = &mut self.appearance.correlator;
            matching.look(&self.params.matching, frame, cropper, size, correlator);
        }
    }

    /// Looks where the target is expected `dt` frames later. Stamps tell of a gap where frames were skipped, and
    /// likewise where none was and the link stalled; so where that makes another place of it, the next frame's is
    /// looked at as well, and the better answer says how many frames have passed. Not for a lost one: the more looks,
    /// the more often something else is taken for it.
    fn look_ahead(&mut self, frame: &Frame, cropper: &mut Cropper, dt: f64) -> Expected {
        let Self { appearance: Appearance { correlator, confidence, .. }, motion, rect, turn, .. } = self;
        let [later, next] = [dt, 1.0].map(|dt| frame.nearest(motion.expected(rect.centre(), dt)));
        correlator.look(frame, cropper, later, rect.size(), turn.degrees());
        if confidence.state() != State::Lost && distance(later, next) > OTHER_PLACE * rect.scale() {
            let response = correlator.highest().response;
            if correlator.look_around(frame, cropper, next, |other| other > response) {
                return Expected { place: next, elapsed: 1.0 };
            }
        }
        Expected { place: later, elapsed: dt }
    }

    /// Looks for a target that answers poorly in turned pictures as well, and stays with the first in which it is
    /// certain and answers much better. Not for a lost one: the more looks, the more often something else is taken for
    /// it.
    fn look_turned(&mut self, frame: &Frame, cropper: &mut Cropper) {
        let Self { params, appearance: Appearance { correlator, confidence, .. }, rect, turn, .. } = self;
        let response = correlator.highest().response;
        let fit = match confidence.is_certain(response) {
            _ if !params.turn.enabled || confidence.state() == State::Lost => Fit::Good,
            _ if rect.w.max(rect.h) > turn::MOST_ASPECT * rect.w.min(rect.h) => Fit::Good,
            _ if confidence.quality(response) >= turn::POOR => Fit::Good,
            true => Fit::Poor,
            false => Fit::Uncertain,
        };
        let Some(others) = turn.others(fit) else {
            return;
        };
        let much_better = |other| confidence.is_certain(other) && other >= turn::GAIN * response;
        let chosen = others.into_iter().find(|&turn| correlator.look_turned(frame, cropper, turn, much_better));
        turn.chose(chosen);
    }

    /// Finds the target in the response map (eq 7), and says how sure that is.
    fn localise(&mut self, expected: Expected, frame: &Frame, cropper: &mut Cropper) -> Localised {
        let answer = self.best(expected.place);
        let colour = frame.encoding().is_colour();
        if !self.blind && colour != std::mem::replace(&mut self.colour, colour) {
            // Without colour the filter answers less to the same target.
            self.appearance.confidence.rebase(answer.response);
        }
        self.thresholds = self.appearance.confidence.thresholds();
        self.detector.see(frame, cropper, &Rect::around(answer.centre, self.rect.size()));
        let opinion = self.opinion();
        self.ask(&answer, self.rect.size());
        let judged = self.agreed(&answer, self.rect.size()) * opinion;
        let before = self.appearance.state();
        let state = self.appearance.confidence.assess_as(judged, answer.response * opinion);
        if state == State::Tracking {
            self.turn.settle(self.appearance.correlator.turn());
        }
        let rect = if self.blind {
            self.rect
        } else {
            Rect::around(self.place(&answer, expected.place, frame), self.rect.size())
        };
        let step = distance(self.rect.centre(), rect.centre());
        let steady = step <= self.params.scale.max_step * rect.scale() * expected.elapsed;
        Localised { expected, answer, rect, response: answer.response, judged, before, state, steady }
    }

    /// The best answer of the filter, unless a neighbour explains it and another one is left for the target: then that
    /// which makes target and neighbours together most likely.
    fn best(&mut self, expected: [f64; 2]) -> Answer {
        let Self { appearance: Appearance { correlator, confidence, .. }, motion, neighbours, rect, .. } = self;
        let favourite = correlator.best(|place| motion.prior(expected, place));
        let (answers, unit) = (correlator.answers(), rect.scale());
        let price = |answer: &Answer| neighbours.price(answer.centre, answers, unit);
        let least = ALTERNATIVE * confidence.usual();
        if price(&favourite) == 0.0 || !answers.iter().any(|a| a.response > least && price(a) == 0.0) {
            return favourite;
        }
        let likelihood = |answer: &Answer| {
            let own = motion.prior(expected, answer.centre) * motion.nearness(expected, answer.centre).max(LEAST_FIT);
            (answer.fused * own).ln() - price(answer)
        };
        let best = answers.iter().max_by(|a, b| likelihood(a).total_cmp(&likelihood(b)));
        best.copied().unwrap_or(favourite)
    }

    /// The response of an answer, or the response that is as sure as filter and matching networks are together.
    fn agreed(&self, answer: &Answer, size: [f64; 2]) -> f64 {
        let Some(matching) = &self.matching else { return answer.response };
        let confidence = &self.appearance.confidence;
        let quality = confidence.quality(answer.response);
        let probability = matching.probability(quality, answer.centre, size, confidence.state());
        confidence.response_of(probability)
    }

    /// How far the detector, which saw what is there, lets the filter's answer count, 0 to 1: a second opinion from
    /// other features, in every frame. A margin below 0 takes `svm.opinion` of the response a unit.
    fn opinion(&self) -> f64 {
        if self.params.svm.opinion == 0.0 || !self.detector.is_trained() {
            return 1.0;
        }
        (1.0 + self.params.svm.opinion * self.detector.margin_of_seen()).clamp(0.0, 1.0)
    }

    /// Asks the judge whether the answer, where the detector saw what is there, is the target of that size.
    fn ask(&mut self, answer: &Answer, size: [f64; 2]) {
        if self.judge.is_asked() {
            let unit = (size[0] * size[1]).sqrt();
            let others = self.appearance.correlator.answers().iter();
            let elsewhere = others.filter(|other| distance(other.centre, answer.centre) > ELSEWHERE * unit);
            let best = elsewhere.map(|other| other.response).fold(0.0, f64::max);
            self.judge.weigh(
                self.detector.seen(),
                best / answer.response.max(f64::MIN_POSITIVE),
                self.matching.as_ref(),
            );
        }
    }

    /// Where the target is taken to be: at the answer as far as the filter's response is believed, else where it was
    /// expected. The detector's opinion decides whether the target is there at all, not where. Without the gate it is
    /// at the answer, as in the paper.
    fn place(&self, answer: &Answer, expected: [f64; 2], frame: &Frame) -> [f64; 2] {
        let trust = match self.appearance.state() {
            _ if !self.params.confidence.gate => 1.0,
            State::Tracking => 1.0,
            State::Uncertain => self.appearance.confidence.trust(self.agreed(answer, self.rect.size())),
            State::Lost => 0.0,
        };
        let between = |i: usize| expected[i] + trust * (answer.centre[i] - expected[i]);
        frame.nearest([between(0), between(1)])
    }

    /// Follows what looks like the target, the target itself being at the answer if that is certain. Then other peaks
    /// that the detector takes for it as well become neighbours.
    fn watch_neighbours(&mut self, found: &Localised, frame: &Frame, cropper: &mut Cropper, trace: &mut dyn Trace) {
        let Self { appearance: Appearance { correlator, confidence, .. }, neighbours, detector, rect, .. } = self;
        let (answers, usual, unit) = (correlator.answers(), confidence.usual(), rect.scale());
        let Answer { centre, response, .. } = found.answer;
        let certain = confidence.is_certain(response);
        neighbours.follow(answers, certain.then_some(centre), usual, unit);
        if certain {
            for (i, other) in answers.iter().enumerate() {
                if neighbours.is_new(i, other, centre, usual, unit)
                    && detector.margin(frame, cropper, &Rect::around(other.centre, rect.size())) >= ALIKE
                {
                    neighbours.add(other.centre);
                }
            }
        }
        neighbours.show(rect.size(), trace);
    }

    /// Updates the GM-PHD filter by the estimated position, so that it knows the target's motion when that has to be
    /// found again. Without the gate this is done in every frame, as in Algorithm 1; otherwise the position must be
    /// believed first: see [`settle`](Self::settle).
    fn measure(&mut self, found: &Localised) {
        if self.params.confidence.gate {
            return;
        }
        if self.blind {
            self.motion.missed();
        } else {
            self.motion.saw(&found.rect, found.expected.place);
        }
    }

    /// Takes over where the target is and how sure that is, estimates its size, and tells the motion model what has
    /// become of it.
    fn settle(&mut self, found: &Localised, frame: &Frame, cropper: &mut Cropper, trace: &mut dyn Trace) {
        let Localised { expected, rect, response, judged, steady, .. } = *found;
        (self.rect, self.response, self.judged) = (rect, response, judged);
        self.reacquired = found.is_reacquired();
        self.lost_for = if found.state == State::Lost { self.lost_for.saturating_add(1) } else { 0 };
        if let (1, Some(matching)) = (self.lost_for, &self.matching) {
            self.rect = Rect::around(self.rect.centre(), matching.last_size());
        }
        if found.state == State::Tracking && !self.reacquired && steady && self.params.scale.enabled {
            trace.event(Event::Stage(Stage::Scale));
            self.rect = self.appearance.resized(frame, cropper, &self.rect);
        }
        if let Some(matching) = &mut self.matching {
            self.rect = matching.settled(&self.params.matching, frame, &self.rect, found.state);
        }
        match found.state {
            // It has been told: see `measure`.
            _ if !self.params.confidence.gate => {}
            State::Tracking if self.reacquired => self.motion.restart(&self.rect),
            State::Tracking => self.motion.saw(&self.rect, expected.place),
            State::Uncertain | State::Lost => self.motion.missed(),
        }
    }

    /// Updates filter, scale filter and detector with the target as it is in this frame; without the gate in every
    /// frame, as in Algorithm 1. Then what the mark left to learn of the first frame: a little in each of the next.
    fn learn(&mut self, found: &Localised, frame: &Frame, cropper: &mut Cropper) {
        let gate = self.params.confidence.gate;
        let is_good = found.state == State::Tracking && !self.reacquired;
        if (is_good || !gate) && self.appearance.is_due(self.age) {
            self.appearance.learn(frame, cropper, &self.rect);
            self.updates += 1;
            // The paper holds T_td against the response where the target was expected.
            let response = if gate { found.response } else { found.answer.response };
            if self.appearance.confidence.is_exemplary(response)
                && self.updates.is_multiple_of(self.params.svm.interval as u32)
            {
                self.detector.learn(frame, cropper, &self.rect);
                if self.judge.learns() {
                    self.judge.learn(self.detector.see(frame, cropper, &self.rect));
                }
            }
        }
        self.appearance.correlator.learn_look(cropper);
    }

    /// Takes over parameters, and says whether its motion filter begins anew. What filters are made of waits
    /// until they can be made anew: see [`remake`](Self::remake).
    pub(super) fn retune(&mut self, params: &LcmhtParams, networks: &Networks) -> bool {
        let moves_anew = self.motion.retune(&params.motion, &self.rect);
        self.neighbours.retune(&params.neighbours);
        self.detector.retune(settings::detector(&params.svm));
        self.judge.retune(params.confidence.looks as u32);
        let mut taken = params.clone();
        taken.keep(&self.params);
        let fits = !params.differs(&taken, Need::Network);
        self.appearance.retune(&settings::appearance(&taken), networks.cnn.as_ref().filter(|_| fits));
        if let (Some(matching), Some(network)) = (&mut self.matching, &networks.matching) {
            matching.use_network(network);
        }
        self.params = taken;
        moves_anew
    }

    /// Makes anew what changed parameters ask for, from the target as it is in this frame, which is certain.
    pub(super) fn remake(
        &mut self,
        params: &LcmhtParams,
        networks: Networks,
        frame: &Frame,
        cropper: &mut Cropper,
        trace: &mut dyn Trace,
    ) {
        let made = std::mem::replace(&mut self.params, params.clone());
        let anew = |need| params.differs(&made, need);
        if anew(Need::Filters) || anew(Need::Network) {
            let worth = self.appearance.remake(&settings::appearance(params), networks.cnn, frame, cropper, &self.rect);
            // The template stays the target as it was marked.
            let (matching, rect) = (self.matching.take(), self.rect);
            let anew = |network| matching.unwrap_or_else(|| Matching::new(network, frame, cropper, &rect));
            self.matching = networks.matching.map(anew);
            self.turn = Turn::upright();
            (self.response, self.judged) = (self.response * worth, self.judged * worth);
        }
        if anew(Need::Scale) {
            self.appearance.remake_scale(settings::scale(&params.scale).as_ref(), frame, cropper, &self.rect);
        }
        let remade = Need::ALL.into_iter().filter(|&need| need.waits() && anew(need));
        remade.for_each(|need| trace.event(Event::MadeAnew(need)));
    }
}
