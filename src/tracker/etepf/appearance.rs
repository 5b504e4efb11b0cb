//! What the target looks like: the ensemble that tells its pixels from those around it, and its colours; and what both
//! say of a place (eqs 3, 4 and 7 to 9).

use super::learning::{FIRST_SHARE, Learning};
use super::likelihood::LikelihoodView;
use crate::features::colour_histogram::Histogram;
use crate::features::pixelwise::FEATURES;
use crate::geometry::Rect;
use crate::learn::adaboost::Ensemble;
use crate::params::{EtepfMethod, EtepfParams, EtepfParticles, Observation, SURROUND};

/// How much the distance of colour histograms counts (lambda of eq 8, the paper's value).
const LAMBDA: f64 = 20.0;
/// Weight of a learned frame in the recent colours.
const RECENT: f64 = 0.2;
/// Contrast below this counts as this much, so that no place is impossible.
const LEAST_CONTRAST: f64 = 0.001;

/// The ensemble, what it was trained on, and the colours.
pub(super) struct Appearance {
    ensemble: Ensemble<FEATURES>,
    learning: Learning,
    colours: Colours,
}

/// What is seen of a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Evidence {
    /// The likelihood mean of the target (w_obj, eq 3).
    pub(super) target: f64,
    /// The likelihood mean of what is around it (w_bg).
    pub(super) around: f64,
    /// How alike its colours are to those of the target (rho of eq 7).
    pub(super) likeness: f64,
}

impl Evidence {
    /// How much the target stands out (diff, eq 4).
    pub(super) fn contrast(&self) -> f64 {
        self.target - self.around
    }

    /// The likelihood of a target there (eq 9), but for a constant factor.
    pub(super) fn likelihood(&self, settings: &EtepfParticles) -> f64 {
        let colours = (-LAMBDA * (1.0 - self.likeness)).exp();
        let stands_out = match (settings.method, settings.observation) {
            (EtepfMethod::Particles, _) => 1.0,
            (_, Observation::Mean) => self.target,
            (_, Observation::Contrast) => self.contrast().max(LEAST_CONTRAST),
        };
        stands_out * colours
    }
}

impl Appearance {
    /// Learns the target in `rect`, which the view shows with its surroundings.
    pub(super) fn new(view: &mut LikelihoodView, rect: &Rect, params: &EtepfParams) -> Self {
        let mut learning = Learning::new(view, rect);
        let ensemble = learning.train(params);
        view.judge(&ensemble);
        Self { ensemble, learning, colours: Colours::new(view, rect, params.particles.parts as usize) }
    }

    /// The classifiers that make the likelihood image.
    pub(super) fn ensemble(&self) -> &Ensemble<FEATURES> {
        &self.ensemble
    }

    /// What the view shows of a place.
    pub(super) fn evidence(&self, view: &LikelihoodView, rect: &Rect) -> Evidence {
        Evidence {
            target: view.mean(rect),
            around: view.mean_around(rect, SURROUND),
            likeness: self.colours.likeness(view, rect),
        }
    }

    /// Trains the ensemble anew on what it was trained on.
    pub(super) fn retrain(&mut self, params: &EtepfParams) {
        self.ensemble = self.learning.train(params);
    }

    /// Takes the target as the view shows it into the ensemble and the colours.
    pub(super) fn update(&mut self, view: &mut LikelihoodView, rect: &Rect, params: &EtepfParams) {
        self.learning.add(view, rect);
        self.retrain(params);
        self.colours.update(view, rect);
    }
}

/// Histograms of the parts of the target, one below the other. One histogram of the whole knows nothing of where a
/// colour is, so that a box may slide along what has its colours (Perez et al., section 3.3).
struct Colours {
    /// Of the first frame.
    first: Vec<Histogram>,
    /// Of the frames that were learned from, the latest counting most.
    recent: Vec<Histogram>,
    /// What places are compared with: both of them, as the ensemble has it.
    reference: Vec<Histogram>,
}

impl Colours {
    fn new(view: &LikelihoodView, rect: &Rect, parts: usize) -> Self {
        let first: Vec<_> = (0..parts).map(|k| view.histogram(&part(rect, k, parts))).collect();
        Self { recent: first.clone(), reference: first.clone(), first }
    }

    /// The mean likeness of the parts.
    fn likeness(&self, view: &LikelihoodView, rect: &Rect) -> f64 {
        let parts = self.reference.len();
        let likeness = |(k, own): (usize, &Histogram)| view.histogram(&part(rect, k, parts)).likeness(own);
        self.reference.iter().enumerate().map(likeness).sum::<f64>() / parts as f64
    }

    /// Takes in the colours that the view shows.
    fn update(&mut self, view: &LikelihoodView, rect: &Rect) {
        let parts = self.first.len();
        for k in 0..parts {
            let now = view.histogram(&part(rect, k, parts));
            self.recent[k] = self.recent[k].mix(&now, RECENT);
            self.reference[k] = self.recent[k].mix(&self.first[k], FIRST_SHARE);
        }
    }
}

/// Part `k` of so many equal ones, from the top.
fn part(rect: &Rect, k: usize, parts: usize) -> Rect {
    let height = rect.h / parts as f64;
    Rect::new(rect.x, rect.y + height * k as f64, rect.w, height)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crop::Cropper;
    use crate::frame::{Encoding, Frame};
    use crate::params::Params;

    const SIDE: usize = 60;
    const TARGET: Rect = Rect::new(20.0, 20.0, 20.0, 20.0);

    /// Red above, blue below, on a green ground.
    fn data() -> Vec<u8> {
        let pixel = |i: usize| match (i % SIDE, i / SIDE) {
            (20..40, 20..30) => [200, 30, 30],
            (20..40, 30..40) => [30, 30, 200],
            _ => [30, 150, 30],
        };
        (0..SIDE * SIDE).flat_map(pixel).collect()
    }

    fn seen(params: &EtepfParams, place: &Rect) -> Evidence {
        let data = data();
        let frame = Frame::new(&data, SIDE as u32, SIDE as u32, 3 * SIDE, Encoding::Rgb8, None).unwrap();
        let mut view = LikelihoodView::default();
        view.look(&frame, &mut Cropper::default(), &frame.bounds(), TARGET.size(), &params.features);
        Appearance::new(&mut view, &TARGET, params).evidence(&view, place)
    }

    #[test]
    fn the_target_is_told_from_its_surroundings() {
        let params = Params::default().etepf;
        let [there, beside, away] = [0.0, 10.0, 20.0].map(|x| seen(&params, &TARGET.shifted(x, 0.0)));
        assert!(there.target > 0.9 && there.around < 0.1 && (there.likeness - 1.0).abs() < 1e-5, "{there:?}");
        assert!((there.contrast() - (there.target - there.around)).abs() < 1e-12);
        let likelihood = |e: &Evidence| e.likelihood(&params.particles);
        assert!(likelihood(&there) > likelihood(&beside) && likelihood(&beside) > likelihood(&away));
        assert!(away.contrast() < 0.0 && likelihood(&away) > 0.0, "no place is impossible");
    }

    #[test]
    fn the_likelihood_is_that_of_equation_9() {
        let mut settings = Params::default().etepf.particles;
        let evidence = Evidence { target: 0.8, around: 0.3, likeness: 0.9 };
        let colours = (-20.0f64 * 0.1).exp();
        for (method, observation, want) in [
            (EtepfMethod::Full, Observation::Mean, 0.8 * colours),
            (EtepfMethod::Full, Observation::Contrast, 0.5 * colours),
            (EtepfMethod::Particles, Observation::Contrast, colours),
        ] {
            (settings.method, settings.observation) = (method, observation);
            assert!((evidence.likelihood(&settings) - want).abs() < 1e-12);
        }
    }

    #[test]
    fn colours_that_change_are_taken_up_beside_those_of_the_first_frame() {
        let params = Params::default().etepf;
        // Parts of two greys, far from each other.
        let view = |grey: u8| {
            let data = vec![grey; SIDE * SIDE];
            let frame = Frame::new(&data, SIDE as u32, SIDE as u32, SIDE, Encoding::Mono8, None).unwrap();
            let mut view = LikelihoodView::default();
            view.look(&frame, &mut Cropper::default(), &frame.bounds(), TARGET.size(), &params.features);
            view
        };
        let (dark, light) = (view(40), view(220));
        let mut colours = Colours::new(&dark, &TARGET, 2);
        assert_eq!(colours.likeness(&light, &TARGET), 0.0);
        // So much of what is recent is light, then as much of the rest too; the first frame has its share of the
        // reference.
        for recent in [RECENT, 1.0 - (1.0 - RECENT).powi(2)] {
            let share = (1.0 - FIRST_SHARE) * recent;
            colours.update(&light, &TARGET);
            assert!((colours.likeness(&light, &TARGET) - share.sqrt()).abs() < 1e-5);
            assert!((colours.likeness(&dark, &TARGET) - (1.0 - share).sqrt()).abs() < 1e-5);
        }
        (0..99).for_each(|_| colours.update(&light, &TARGET));
        assert!((colours.likeness(&dark, &TARGET) - FIRST_SHARE.sqrt()).abs() < 1e-5, "the first frame stays");
    }

    #[test]
    fn another_number_of_classifiers_is_trained_on_what_was_learned_before() {
        let mut params = Params::default().etepf;
        let data: Vec<u8> = data().iter().enumerate().map(|(i, v)| v ^ (i * 7919 % 251) as u8).collect();
        let frame = Frame::new(&data, SIDE as u32, SIDE as u32, 3 * SIDE, Encoding::Rgb8, None).unwrap();
        let mut view = LikelihoodView::default();
        view.look(&frame, &mut Cropper::default(), &frame.bounds(), TARGET.size(), &params.features);
        let mut appearance = Appearance::new(&mut view, &TARGET, &params);
        let five = appearance.ensemble().classifiers().to_vec();
        params.ensemble.classifiers = 2;
        appearance.retrain(&params);
        assert_eq!((five.len(), appearance.ensemble().classifiers()), (5, &five[..2]));
    }

    #[test]
    fn parts_know_where_a_colour_is() {
        let mut params = Params::default().etepf;
        let upside_down = |params: &EtepfParams| {
            // Seen where its lower half is above: blue, then green.
            seen(params, &TARGET.shifted(0.0, 10.0)).likeness
        };
        let two = upside_down(&params);
        params.particles.parts = 1;
        let one = upside_down(&params);
        assert!(two < 0.1 && one > 0.4, "{two} {one}");
    }
}
