//! What a response says of the target: tracking, uncertain or lost (T_ad and T_td of LCMHT section 4.2).
//!
//! The paper holds the response against fixed thresholds. What a good response is depends on the target, though, and
//! drops as it changes its looks. By default responses are therefore measured in units of what the target usually gets:
//! `quality = response / reference`, where the reference follows the responses of the target while it is not lost.

use super::settings::ConfidenceSettings;
use crate::output::State;
use crate::trace::Thresholds;

/// The reference starts at this share of the response to the very sample that the filter was trained on: no later look
/// of the target answers as well.
const FIRST_SHARE: f64 = 0.6;
/// Share of the reference that is left of it at least when the images become of another kind: what answers less is not
/// the target without its colours, but something in front of it.
const LEAST_REBASE: f64 = 0.25;
/// Rate at which the reference follows the response of a frame.
const ADAPT: f64 = 0.05;
/// Keeps the reference above zero.
const LEAST_REFERENCE: f64 = 1e-6;

/// Logarithm of the odds that the box overlaps the target by more than half, against quality: slope and value at 0. By
/// logistic regression over the frames of 26 real sequences, each weighted by the root of its length, with and without
/// a network; `evaluate` shows how well it holds.
const ODDS_SLOPE: f64 = 2.9;
const ODDS_AT_ZERO: f64 = -1.0;
/// Share of that probability that is left when the target is lost: its box is a guess.
const LOST_SHARE: f64 = 0.1;

/// The state of one target.
pub struct Confidence {
    settings: ConfidenceSettings,
    reference: f64,
    state: State,
    /// Uncertain frames in a row, and the sum of their qualities.
    uncertain: u32,
    sum: f64,
}

impl Confidence {
    /// A target that is tracked and whose training sample got `response`.
    pub fn new(settings: &ConfidenceSettings, response: f64) -> Self {
        Self {
            settings: settings.clone(),
            reference: (FIRST_SHARE * response).max(LEAST_REFERENCE),
            state: State::Tracking,
            uncertain: 0,
            sum: 0.0,
        }
    }

    /// Takes over changed settings.
    pub fn retune(&mut self, settings: &ConfidenceSettings) {
        self.settings = settings.clone();
    }

    /// Another filter answers from now on, whose training sample got `response`. Gives what a response of the filter
    /// before is worth in responses of this one.
    pub fn remake(&mut self, response: f64) -> f64 {
        let before = std::mem::replace(&mut self.reference, (FIRST_SHARE * response).max(LEAST_REFERENCE));
        self.reference / before
    }

    /// The state after the last frame.
    pub fn state(&self) -> State {
        self.state
    }

    /// The response that the target usually gets.
    pub fn usual(&self) -> f64 {
        self.reference
    }

    /// The response in the unit of the thresholds.
    pub fn quality(&self, response: f64) -> f64 {
        if self.settings.relative { response / self.reference } else { response }
    }

    /// The confidence to report for a box that got `response`: calibrated, how probable it is that the box overlaps the
    /// target by more than half, otherwise the quality. In `0..=1`.
    pub fn reported(&self, response: f64) -> f64 {
        let quality = self.quality(response).clamp(0.0, 1.0);
        if !self.settings.calibrated {
            return quality;
        }
        let probability = 1.0 / (1.0 + (-(ODDS_SLOPE * quality + ODDS_AT_ZERO)).exp());
        self.discounted(probability)
    }

    /// The confidence to report where `judged` is the [response of](Self::response_of) a probability. In `0..=1`: what
    /// the target usually gets may have sunk since.
    pub fn reported_probability(&self, judged: f64) -> f64 {
        self.discounted(self.quality(judged).clamp(0.0, 1.0))
    }

    /// What remains of a probability where the target is lost.
    pub fn discounted(&self, probability: f64) -> f64 {
        if self.state == State::Lost { LOST_SHARE * probability } else { probability }
    }

    /// The response of a quality.
    pub fn response_of(&self, quality: f64) -> f64 {
        if self.settings.relative { quality * self.reference } else { quality }
    }

    /// What the responses of this frame are held against.
    pub fn thresholds(&self) -> Thresholds {
        let ConfidenceSettings { activate, lost, reacquire, .. } = self.settings;
        let [certain, lost, found] = [activate, lost, reacquire].map(|quality| self.response_of(quality));
        Thresholds { certain, lost, found }
    }

    /// Whether a response shows the target (at least T_ad).
    pub fn is_certain(&self, response: f64) -> bool {
        self.quality(response) >= self.settings.activate
    }

    /// Whether a response at a place that the detector proposes is good enough to take up the target there.
    pub fn is_convincing(&self, response: f64) -> bool {
        self.quality(response) >= self.settings.reacquire
    }

    /// Whether a response is good enough to teach the detector (at least T_td).
    pub fn is_exemplary(&self, response: f64) -> bool {
        self.quality(response) >= self.settings.train
    }

    /// How far a response is to be believed, 0 to 1.
    pub fn trust(&self, response: f64) -> f64 {
        if self.settings.activate > 0.0 {
            (self.quality(response) / self.settings.activate).clamp(0.0, 1.0)
        } else {
            1.0
        }
    }

    /// Takes in the response of a frame in which the target was looked for where it was expected. A lost target stays
    /// lost until [`found`](Self::found) says otherwise.
    pub fn assess(&mut self, response: f64) -> State {
        self.assess_as(response, response)
    }

    /// Likewise, where more is known than the response: the state follows from what is as sure as the response
    /// `judged`, what the target usually gets from `response`.
    pub fn assess_as(&mut self, judged: f64, response: f64) -> State {
        let quality = self.quality(judged);
        if self.state == State::Lost {
            return State::Lost;
        }
        if self.is_certain(judged) {
            self.found();
        } else {
            self.uncertain += 1;
            self.sum += quality;
            let mean = self.sum / f64::from(self.uncertain);
            let gone = self.uncertain > self.settings.patience && mean < self.settings.lost;
            self.state = if gone { State::Lost } else { State::Uncertain };
        }
        if self.state != State::Lost {
            self.reference += ADAPT * (response - self.reference);
            self.reference = self.reference.max(LEAST_REFERENCE);
        }
        self.state
    }

    /// Takes in the response of a frame, and takes up a lost target that it convinces of.
    pub fn judge(&mut self, response: f64) -> State {
        let was_lost = self.state == State::Lost;
        self.assess(response);
        if was_lost && self.is_convincing(response) {
            self.found();
        }
        self.state
    }

    /// Takes what a tracked target just got for what it usually gets from now on, or `LEAST_REBASE` of that: the
    /// images have become of another kind.
    pub fn rebase(&mut self, response: f64) {
        if self.state == State::Tracking {
            self.reference = response.max(LEAST_REBASE * self.reference).max(LEAST_REFERENCE);
        }
    }

    /// The target is there.
    pub fn found(&mut self) {
        self.state = State::Tracking;
        self.uncertain = 0;
        self.sum = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn confidence() -> Confidence {
        Confidence::new(&ConfidenceSettings::default(), 1.0)
    }

    #[test]
    fn a_target_that_stays_hidden_is_uncertain_then_lost_then_found() {
        let mut c = confidence();
        let patience = c.settings.patience;
        for _ in 0..20 {
            assert_eq!(c.assess(0.6), State::Tracking);
        }
        for _ in 0..patience {
            assert_eq!(c.assess(0.05), State::Uncertain);
        }
        assert_eq!(c.assess(0.05), State::Lost);
        // The reference stands still while the target is lost, however long that takes.
        let before = c.reference;
        (0..1000).for_each(|_| assert_eq!(c.assess(0.05), State::Lost));
        assert_eq!(c.reference, before);
        c.found();
        assert_eq!(c.assess(0.6), State::Tracking);
    }

    #[test]
    fn the_reported_confidence_is_a_probability_and_small_when_lost() {
        let mut c = confidence();
        let [good, poor] = [c.reference, 0.2 * c.reference].map(|r| c.reported(r));
        assert!((good - 1.0 / (1.0 + (-1.9f64).exp())).abs() < 1e-12, "{good}");
        assert!((poor - 1.0 / (1.0 + 0.42f64.exp())).abs() < 1e-12, "{poor}");
        for _ in 0..20 {
            c.assess(0.05);
        }
        assert!(c.reported(0.05) < 0.05);
        c.settings.calibrated = false;
        assert_eq!(c.reported(0.5 * c.reference), 0.5);
    }

    #[test]
    fn a_reported_probability_is_one_though_the_usual_response_sinks() {
        let mut c = confidence();
        let judged = c.response_of(0.99);
        c.assess_as(judged, 0.1 * c.reference);
        assert!(c.quality(judged) > 1.0);
        assert_eq!(c.reported_probability(judged), 1.0);
    }

    #[test]
    fn a_target_that_changes_its_looks_is_not_lost() {
        let mut c = confidence();
        let mut response = 0.6;
        for _ in 0..60 {
            response *= 0.97;
            assert_ne!(c.assess(response), State::Lost);
        }
        for _ in 0..60 {
            c.assess(response);
        }
        assert_eq!(c.state(), State::Tracking);
    }

    #[test]
    fn a_target_seen_in_another_kind_of_images_is_measured_by_those_unless_it_is_lost() {
        let mut c = confidence();
        c.rebase(0.2);
        assert_eq!((c.assess(0.2), c.quality(0.1)), (State::Tracking, 0.5));
        for _ in 0..20 {
            c.assess(0.01);
        }
        let usual = c.usual();
        c.rebase(0.01);
        assert_eq!((c.state(), c.usual()), (State::Lost, usual));
        // Hidden just then, it is not measured by what hides it.
        let mut c = confidence();
        c.rebase(0.01);
        assert_eq!(c.assess(0.01), State::Uncertain);
    }

    #[test]
    fn fixed_thresholds_are_those_of_the_paper() {
        let settings = ConfidenceSettings {
            relative: false,
            activate: 0.15,
            train: 0.4,
            lost: 0.15,
            patience: 0,
            ..ConfidenceSettings::default()
        };
        let mut c = Confidence::new(&settings, 1.0);
        assert_eq!(c.assess(0.16), State::Tracking);
        assert!(!c.is_exemplary(0.39) && c.is_exemplary(0.41));
        assert_eq!(c.assess(0.14), State::Lost);
        assert_eq!(c.trust(0.075), 0.5);
    }
}
