//! Where a target has been, how fast it goes (eqs 5 and 6), how well it was seen (eq 12) and where it is to be expected
//! while it is hidden (eq 13).

use std::collections::VecDeque;

use crate::geometry::distance;

/// What is remembered of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moment {
    /// When, in frame periods (f).
    pub(super) time: f64,
    /// The centre (p).
    pub(super) place: [f64; 2],
    /// The velocity at that time, in pixels a frame period (v).
    pub(super) velocity: [f64; 2],
    /// How well the target was seen (occval).
    pub(super) visibility: f64,
}

/// The latest moments, the oldest first; never empty.
pub(super) struct Path {
    moments: VecDeque<Moment>,
    longest: usize,
}

impl Path {
    /// That of a target which is seen for the first time.
    pub(super) fn new(place: [f64; 2], visibility: f64, longest: i64) -> Self {
        let longest = longest as usize;
        let mut moments = VecDeque::with_capacity(longest + 1);
        moments.push_back(Moment { time: 0.0, place, velocity: [0.0; 2], visibility });
        Self { moments, longest }
    }

    /// The latest moment.
    pub(super) fn last(&self) -> Moment {
        self.moments[self.moments.len() - 1]
    }

    /// The target is there now, `dt` frame periods after the last moment, and its velocity follows (eq 6): from `width`
    /// away or, where it has not come so far, from as long ago as is remembered.
    pub(super) fn go(&mut self, place: [f64; 2], visibility: f64, dt: f64, width: f64) {
        let time = self.last().time + dt;
        let from = self.base(place, width);
        let velocity = [0, 1].map(|axis| (place[axis] - from.place[axis]) / (time - from.time));
        if self.moments.len() >= self.longest {
            self.moments.pop_front();
        }
        self.moments.push_back(Moment { time, place, velocity, visibility });
    }

    /// Where it will be `dt` later (eq 5).
    pub(super) fn expected(&self, dt: f64) -> [f64; 2] {
        let Moment { place, velocity, .. } = self.last();
        [0, 1].map(|axis| place[axis] + velocity[axis] * dt)
    }

    /// The moment f0: the nearest in which the target was at least `width` from `place`, or else the oldest.
    pub(super) fn base(&self, place: [f64; 2], width: f64) -> Moment {
        let far = |moment: &&Moment| distance(moment.place, place) >= width;
        *self.moments.iter().rev().find(far).unwrap_or(&self.moments[0])
    }

    /// The best visibility since f0 (eq 12).
    pub(super) fn best_visibility(&self, width: f64) -> f64 {
        let since = self.base(self.last().place, width).time;
        let recent = self.moments.iter().rev().take_while(|moment| moment.time >= since);
        recent.map(|moment| moment.visibility).fold(0.0, f64::max)
    }

    /// Moves all of it, as when the picture is another part of the scene.
    pub(super) fn shift(&mut self, by: [f64; 2]) {
        self.moments.iter_mut().for_each(|moment| [0, 1].iter().for_each(|&axis| moment.place[axis] += by[axis]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(places: &[f64]) -> Path {
        let mut path = Path::new([places[0], 0.0], 0.5, 5);
        places[1..].iter().for_each(|&x| path.go([x, 0.0], x / 100.0, 1.0, 10.0));
        path
    }

    #[test]
    fn velocity_is_measured_from_one_width_away() {
        // From 18, the nearest that is 10 away is 6, two frames before.
        assert_eq!(path(&[0.0, 2.0, 6.0, 11.0, 18.0]).last().velocity, [6.0, 0.0]);
        // Never so far: from the first.
        assert_eq!(path(&[0.0, 2.0, 4.0, 6.0]).last().velocity, [2.0, 0.0]);
        let mut path = path(&[0.0, 2.0, 4.0]);
        path.go([10.0, 3.0], 0.0, 2.0, 100.0);
        assert_eq!(path.last().velocity, [2.5, 0.75]);
        assert_eq!(path.expected(2.0), [15.0, 4.5]);
    }

    #[test]
    fn what_is_too_old_is_forgotten() {
        let path = path(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
        assert_eq!((path.moments.len(), path.moments[0].place), (5, [3.0, 0.0]));
    }

    #[test]
    fn the_best_visibility_is_that_since_the_target_was_a_width_away() {
        let mut path = Path::new([0.0, 0.0], 0.9, 50);
        for (x, visibility) in [(5.0, 0.8), (12.0, 0.3), (17.0, 0.4)] {
            path.go([x, 0.0], visibility, 1.0, 10.0);
        }
        // f0 is where it was at 5, whose own visibility counts.
        assert_eq!(path.best_visibility(10.0), 0.8);
        assert_eq!(path.best_visibility(5.0), 0.4);
        path.shift([3.0, -1.0]);
        assert_eq!(path.last().place, [20.0, -1.0]);
    }
}
