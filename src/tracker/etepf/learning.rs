//! Training of the ensemble: on the first frame, as in the paper, and again while the target is certain, as the paper
//! leaves to be done.
//!
//! An ensemble is always trained as a whole, on pixels of the first frame and of the latest frames that could be
//! trusted. The first frame never weighs less than its share, so that what is learned later can refine the ensemble but
//! not replace it; and frames that fade from memory take their errors with them. That is the guard against drift. The
//! colours, in `appearance.rs`, are held likewise.

use std::collections::VecDeque;

use super::likelihood::LikelihoodView;
use crate::features::pixelwise::FEATURES;
use crate::geometry::Rect;
use crate::learn::adaboost::{Ensemble, Examples};
use crate::params::{EtepfParams, SURROUND};

/// Pixels of the target, and of the background, that are learned from the first frame, at most.
const EXAMPLES: usize = 1000;
/// Frames that are learned from beside the first.
const MEMORY: usize = 5;
/// Share of the first frame in the weight of all examples, and in the colours: it guards against drift.
pub(super) const FIRST_SHARE: f64 = 0.5;

/// What the ensemble is trained on.
pub(super) struct Learning {
    /// Of the first frame.
    first: Examples<FEATURES>,
    /// Of the latest frames, the oldest in front.
    recent: VecDeque<Examples<FEATURES>>,
    /// All of them, while an ensemble is trained.
    all: Examples<FEATURES>,
}

impl Learning {
    /// Takes in the first frame: the target is in `rect`, and the view shows it with its surroundings.
    pub(super) fn new(view: &mut LikelihoodView, rect: &Rect) -> Self {
        let mut first = Examples::default();
        collect(view, rect, EXAMPLES, &mut first);
        Self { first, recent: VecDeque::new(), all: Examples::default() }
    }

    /// Takes in another frame likewise. All frames but the first have as many examples together as the first alone.
    pub(super) fn add(&mut self, view: &mut LikelihoodView, rect: &Rect) {
        let mut examples = Examples::default();
        while self.recent.len() >= MEMORY {
            examples = self.recent.pop_front().unwrap_or_default();
        }
        examples.clear();
        collect(view, rect, EXAMPLES.div_ceil(MEMORY), &mut examples);
        self.recent.push_back(examples);
    }

    /// An ensemble of all that is remembered.
    pub(super) fn train(&mut self, params: &EtepfParams) -> Ensemble<FEATURES> {
        self.train_with(FIRST_SHARE, params.ensemble.classifiers as usize)
    }

    /// An ensemble of so many classifiers, in which the first frame has at least this share.
    fn train_with(&mut self, first: f64, classifiers: usize) -> Ensemble<FEATURES> {
        let share = if self.recent.is_empty() { 1.0 } else { first };
        self.all.clear();
        self.all.extend(&self.first, share);
        for examples in &self.recent {
            self.all.extend(examples, (1.0 - share) / self.recent.len() as f64);
        }
        Ensemble::train(&mut self.all, classifiers)
    }
}

/// Adds at most `most` pixels of the target, and as many of the ring around it, evenly spread; each class weighs one
/// half.
fn collect(view: &mut LikelihoodView, rect: &Rect, most: usize, examples: &mut Examples<FEATURES>) {
    let outer = rect.scaled(SURROUND);
    let target = view.count(rect);
    let ring = view.count(&outer) - target;
    // Every n-th pixel of a class; fractions of n keep the pixels from lining up in columns.
    let stride = |pixels: usize| (pixels as f64 / most as f64).max(1.0);
    let strides = [stride(ring), stride(target)];
    let mut seen = [0.0f64; 2];
    view.pixels(|[x, y], features| {
        let within = |r: &Rect| x >= r.x && x < r.x + r.w && y >= r.y && y < r.y + r.h;
        let positive = within(rect);
        if !positive && !within(&outer) {
            return;
        }
        let class = usize::from(positive);
        seen[class] += 1.0;
        if seen[class] >= strides[class] {
            seen[class] -= strides[class];
            examples.push(features, positive, 1.0);
        }
    });
    examples.balance();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crop::Cropper;
    use crate::frame::{Encoding, Frame};
    use crate::params::Params;

    const SIDE: usize = 60;
    const TARGET: Rect = Rect::new(20.0, 20.0, 20.0, 20.0);

    /// A square of one grey on another.
    fn view(target: u8, ground: u8, params: &EtepfParams) -> LikelihoodView {
        let inside = |i: usize| (20..40).contains(&(i % SIDE)) && (20..40).contains(&(i / SIDE));
        let data: Vec<u8> = (0..SIDE * SIDE).map(|i| if inside(i) { target } else { ground }).collect();
        let frame = Frame::new(&data, SIDE as u32, SIDE as u32, SIDE, Encoding::Mono8, None).unwrap();
        let mut view = LikelihoodView::default();
        view.look(&frame, &mut Cropper::default(), &TARGET.scaled(2.5), TARGET.size(), &params.features);
        view
    }

    /// How likely a pixel of this grey is the target, far from all edges.
    fn likelihood(ensemble: &Ensemble<FEATURES>, grey: u8) -> f64 {
        let features = std::array::from_fn(|i| if i + 3 < FEATURES { 0.0 } else { f32::from(grey) / 255.0 });
        1.0 / (1.0 + (-2.0 * ensemble.margin(&features)).exp())
    }

    #[test]
    fn target_and_ring_are_learned_in_equal_numbers_and_weights() {
        let params = Params::default().etepf;
        let mut examples = Examples::default();
        collect(&mut view(200, 50, &params), &TARGET, 150, &mut examples);
        assert!((295..=300).contains(&examples.len()), "{}", examples.len());
        // The ring of twice the sides has 1200 pixels, the target 400; fewer than are allowed are all taken.
        examples.clear();
        collect(&mut view(200, 50, &params), &TARGET, 5000, &mut examples);
        assert_eq!(examples.len(), 1600);
    }

    #[test]
    fn what_has_changed_is_learned_and_what_fades_from_memory_forgotten() {
        let params = Params::default().etepf;
        let mut learning = Learning::new(&mut view(200, 50, &params), &TARGET);
        let first = learning.train(&params);
        assert!(likelihood(&first, 200) > 0.9 && likelihood(&first, 50) < 0.1);
        // Now the ground is as light as the target was at first to the classifier.
        assert!(likelihood(&first, 150) > 0.5);
        (0..MEMORY).for_each(|_| learning.add(&mut view(200, 150, &params), &TARGET));
        let second = learning.train(&params);
        assert!(likelihood(&second, 150) < 0.5 && likelihood(&second, 200) > 0.5, "{}", likelihood(&second, 150));
        (0..MEMORY).for_each(|_| learning.add(&mut view(200, 50, &params), &TARGET));
        assert_eq!(learning.recent.len(), MEMORY);
        assert!(likelihood(&learning.train(&params), 150) > 0.5);
    }

    #[test]
    fn the_first_frame_holds_its_own_against_whatever_comes_later() {
        let params = Params::default().etepf;
        let classifiers = params.ensemble.classifiers as usize;
        let mut learning = Learning::new(&mut view(200, 50, &params), &TARGET);
        // Everything the wrong way round: an occluder that was taken for the target.
        (0..5).for_each(|_| learning.add(&mut view(50, 200, &params), &TARGET));
        let anchored = learning.train_with(0.6, classifiers);
        assert!(likelihood(&anchored, 200) > likelihood(&anchored, 50));
        let adrift = learning.train_with(0.0, classifiers);
        assert!(likelihood(&adrift, 200) < likelihood(&adrift, 50));
    }
}
