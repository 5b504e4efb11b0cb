//! What looks like the target but is not: other peaks of the response map, followed from frame to frame.
//!
//! People in a crowd look alike, and when two of them cross, the filter answers to both. A neighbour that has been seen
//! apart from the target explains a peak where it is expected, so a peak that a neighbour needs is not taken for the
//! target if another one is left for it. The paper leaves this to the GM-PHD filter of a lost target; here it is done
//! in each frame, by joint assignment of peaks to the target and its neighbours.
//!
//! Lengths count in target sizes, the root of the target's area.

use crate::appearance::Answer;
use crate::geometry::{Rect, distance};
use crate::params::LcmhtNeighbours;
use crate::trace::{Event, Trace};

/// Distance within which a peak goes on with a neighbour, and within which a neighbour is where the target is.
const REACH: f64 = 0.5;
/// Least distance of a new neighbour from the target and from others.
const APART: f64 = 0.2;
/// Response above which a second peak is taken for a neighbour, in units of what the target usually gets.
const RESPONSE: f64 = 0.3;
/// Standard deviation of a neighbour's position from where it is expected.
const WIDTH: f64 = 0.25;
/// Share of the response of a new neighbour that is enough for a known one.
const FAINT: f64 = 0.5;
/// Frames in which a neighbour must have been seen before it explains anything.
const ESTABLISHED: u32 = 2;
/// Frames for which an unseen neighbour is remembered, if it had been seen as often.
const PATIENCE: u32 = 4;
/// Gains of the alpha-beta filter of a neighbour's position and velocity.
const POSITION_GAIN: f64 = 0.7;
const VELOCITY_GAIN: f64 = 0.3;
/// Likelihood, relative to the best, of a peak that what is assigned to it, a neighbour or the target, has nothing to
/// do with.
pub(super) const LEAST_FIT: f64 = 0.1;

/// One that looks like the target.
#[derive(Clone, Copy, Debug)]
struct Neighbour {
    centre: [f64; 2],
    /// In pixels a frame.
    velocity: [f64; 2],
    /// Frames in which it was seen, and frames since it was last.
    seen: u32,
    unseen: u32,
}

/// All that look like one target.
pub(super) struct Neighbours {
    settings: LcmhtNeighbours,
    all: Vec<Neighbour>,
    /// Which answers are explained.
    taken: Vec<bool>,
}

impl Neighbours {
    /// None yet.
    pub(super) fn new(settings: &LcmhtNeighbours) -> Self {
        Self { settings: settings.clone(), all: Vec::new(), taken: Vec::new() }
    }

    pub(super) fn retune(&mut self, settings: &LcmhtNeighbours) {
        self.settings = settings.clone();
        if !settings.enabled {
            self.all.clear();
        }
    }

    /// Moves all to where they are expected `dt` frames later.
    pub(super) fn predict(&mut self, dt: f64) {
        for n in &mut self.all {
            n.centre = [n.centre[0] + n.velocity[0] * dt, n.centre[1] + n.velocity[1] * dt];
        }
    }

    /// What it costs to take the answer at `place` for the target: by how much the log likelihood of the neighbour that
    /// needs it most falls when it has to do with the next best of `answers`, or with none. 0 where no neighbour
    /// loses anything. `unit` is the target's size in pixels.
    pub(super) fn price(&self, place: [f64; 2], answers: &[Answer], unit: f64) -> f64 {
        let width = WIDTH * unit;
        let fit = |n: &Neighbour, at: [f64; 2]| (-0.5 * (distance(n.centre, at) / width).powi(2)).exp().max(LEAST_FIT);
        let loss = |n: &Neighbour| {
            let others = answers.iter().filter(|a| a.centre != place);
            let left = others.map(|a| fit(n, a.centre)).fold(LEAST_FIT, f64::max);
            (fit(n, place) / left).ln().max(0.0)
        };
        self.established().map(loss).fold(0.0, f64::max)
    }

    /// Shows those that explain peaks, as boxes of the target's size.
    pub(super) fn show(&self, size: [f64; 2], trace: &mut dyn Trace) {
        self.established().for_each(|n| trace.event(Event::Neighbour(Rect::around(n.centre, size))));
    }

    /// Whether a neighbour is where `place` is.
    pub(super) fn is_at(&self, place: [f64; 2], unit: f64) -> bool {
        self.established().any(|n| distance(n.centre, place) < REACH * unit)
    }

    /// Follows the neighbours to the answers, other than that where the `target` is if it is anywhere: the one peak may
    /// be that of a neighbour which hides it. `usual` is the response that the target usually gets.
    pub(super) fn follow(&mut self, answers: &[Answer], target: Option<[f64; 2]>, usual: f64, unit: f64) {
        let least = FAINT * RESPONSE * usual;
        self.taken.clear();
        self.taken.extend(answers.iter().map(|a| Some(a.centre) == target));
        for n in &mut self.all {
            let free = (0..answers.len()).filter(|&i| !self.taken[i] && answers[i].response > least);
            let near = free.map(|i| (distance(answers[i].centre, n.centre), i)).filter(|c| c.0 < REACH * unit);
            if let Some((_, i)) = near.min_by(|a, b| a.0.total_cmp(&b.0)) {
                self.taken[i] = true;
                n.correct(answers[i].centre);
            } else {
                n.unseen += 1;
            }
        }
        self.all.retain(|n| n.unseen <= PATIENCE.min(n.seen));
    }

    /// Whether `answer`, the `i`th of those last followed, may be a new neighbour of a target at `chosen`: strong
    /// enough, and apart from the target and all others.
    pub(super) fn is_new(&self, i: usize, answer: &Answer, chosen: [f64; 2], usual: f64, unit: f64) -> bool {
        let apart = |from: [f64; 2]| distance(answer.centre, from) > APART * unit;
        self.settings.enabled
            && !self.taken[i]
            && answer.response > RESPONSE * usual
            && apart(chosen)
            && self.all.iter().all(|n| apart(n.centre))
    }

    /// Takes in a new neighbour, at rest.
    pub(super) fn add(&mut self, centre: [f64; 2]) {
        self.all.push(Neighbour { centre, velocity: [0.0; 2], seen: 1, unseen: 0 });
    }

    /// The centres of those that explain peaks.
    #[cfg(test)]
    fn centres(&self) -> impl Iterator<Item = [f64; 2]> {
        self.established().map(|n| n.centre)
    }

    fn established(&self) -> impl Iterator<Item = &Neighbour> {
        self.all.iter().filter(|n| n.seen >= ESTABLISHED)
    }
}

impl Neighbour {
    /// Takes in where it was seen, by an alpha-beta filter.
    fn correct(&mut self, seen: [f64; 2]) {
        for ((centre, velocity), seen) in self.centre.iter_mut().zip(&mut self.velocity).zip(seen) {
            let error = seen - *centre;
            *centre += POSITION_GAIN * error;
            *velocity += VELOCITY_GAIN * error;
        }
        self.seen += 1;
        self.unseen = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::Params;

    const UNIT: f64 = 40.0;

    fn answers<const N: usize>(places: [([f64; 2], f64); N]) -> [Answer; N] {
        places.map(|(centre, response)| Answer { centre, response, fused: response })
    }

    /// A target that stands at (100, 100) and a neighbour that comes from the right by 5 px a frame.
    fn met() -> Neighbours {
        let mut neighbours = Neighbours::new(&Params::default().lcmht.neighbours);
        for k in 0..6 {
            let seen = answers([([100.0, 100.0], 1.0), ([160.0 - 5.0 * f64::from(k), 100.0], 0.6)]);
            neighbours.predict(1.0);
            neighbours.follow(&seen, Some([100.0, 100.0]), 1.0, UNIT);
            if neighbours.is_new(1, &seen[1], [100.0, 100.0], 1.0, UNIT) {
                neighbours.add(seen[1].centre);
            }
        }
        neighbours
    }

    #[test]
    fn a_neighbour_is_followed() {
        let neighbours = met();
        let centres: Vec<[f64; 2]> = neighbours.centres().collect();
        assert_eq!(centres.len(), 1);
        assert!(distance(centres[0], [135.0, 100.0]) < 3.0, "{centres:?}");
        assert!(neighbours.is_at([125.0, 100.0], UNIT) && !neighbours.is_at([100.0, 100.0], UNIT));
    }

    #[test]
    fn a_peak_that_a_neighbour_needs_has_its_price() {
        let mut neighbours = met();
        neighbours.predict(1.0);
        let expected = neighbours.centres().next().unwrap();
        let both = answers([(expected, 0.9), ([100.0, 100.0], 0.5)]);
        let price = neighbours.price(expected, &both, UNIT);
        // Nothing but the target's own peak would be left for it, three widths or more away.
        assert!((price - (1.0 / LEAST_FIT).ln()).abs() < 1e-9, "{price}");
        assert_eq!(neighbours.price([100.0, 100.0], &both, UNIT), 0.0);
        // One width away there is as good as another peak: what that costs is half.
        let width = WIDTH * UNIT;
        let next = answers([(expected, 0.9), ([expected[0], expected[1] + width], 0.4)]);
        assert!((neighbours.price(expected, &next, UNIT) - 0.5).abs() < 1e-9);
    }

    #[test]
    fn one_that_is_not_seen_is_forgotten() {
        let mut neighbours = met();
        for _ in 0..PATIENCE {
            neighbours.follow(&[], None, 1.0, UNIT);
            assert_eq!(neighbours.centres().count(), 1);
        }
        neighbours.follow(&[], None, 1.0, UNIT);
        assert_eq!(neighbours.centres().count(), 0);
    }

    #[test]
    fn one_that_hides_the_target_is_followed_by_the_only_peak() {
        let mut neighbours = met();
        for k in 6..20 {
            let place = [160.0 - 5.0 * f64::from(k), 100.0];
            let only = answers([(place, 0.6)]);
            neighbours.predict(1.0);
            neighbours.follow(&only, None, 1.0, UNIT);
            assert!(neighbours.is_at(place, UNIT), "{k}");
            // Where it is the target's instead, nobody else is there.
            let mut others = met();
            others.follow(&only, Some(place), 1.0, UNIT);
            assert!(!others.taken.is_empty() && others.all.iter().all(|n| n.unseen == 1));
        }
    }

    #[test]
    fn faint_and_close_peaks_are_no_neighbours() {
        let mut neighbours = Neighbours::new(&Params::default().lcmht.neighbours);
        let seen = answers([([100.0, 100.0], 1.0), ([160.0, 100.0], 0.2), ([104.0, 100.0], 0.6)]);
        neighbours.follow(&seen, Some([100.0, 100.0]), 1.0, UNIT);
        assert!((0..3).all(|i| !neighbours.is_new(i, &seen[i], [100.0, 100.0], 1.0, UNIT)));
    }
}
