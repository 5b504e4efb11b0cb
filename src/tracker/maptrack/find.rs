//! Finding targets without a mark: blobs that fit in space and last in time (sections 3.2.2 to 3.2.4).
//!
//! Equation 1 as printed, `delta = (0.5^-n) v (-0.5^-n)`, is read as what a confidence gains or loses in a frame: in
//! the n-th frame in a row that shows the blob it gains 0.5^-n, in the n-th frame in a row that does not it loses as
//! much. So both double from frame to frame, and what is seen without a break is soon believed, what stays away soon
//! forgotten.

use crate::detect::blobs::Blob;
use crate::geometry::{Rect, distance};
use crate::params::MaptrackFind;

/// A blob is the candidate of the frame before if its centre is no farther from it than so many of its larger side.
const NEAR: f64 = 0.5;
/// Base of the confidence (eq 1), and confidence below which a blob is forgotten (tau); the paper's values.
const GAIN: f64 = 0.5;
const DROP: f64 = 0.0;
/// A blob this much longer than wide has an orientation.
const LONG: f64 = 1.5;
/// From one frame to the next a blob's area changes by no more than this factor.
const GROWTH: f64 = 2.5;

/// A blob that may become a target.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    /// Where it is.
    pub(super) rect: Rect,
    /// Where it was seen first.
    pub(super) from: [f64; 2],
    /// Frame periods since.
    pub(super) age: f64,
    confidence: f64,
    /// Frames in a row that have shown it, if positive, or have not.
    run: i32,
}

impl Candidate {
    fn new(rect: Rect) -> Self {
        Self { rect, from: rect.centre(), age: 0.0, confidence: 0.0, run: 0 }
    }

    /// Gains or loses confidence (eq 1).
    fn judge(&mut self, is_seen: bool) {
        self.run = match (is_seen, self.run) {
            (true, run) => run.max(0) + 1,
            (false, run) => run.min(0) - 1,
        };
        let change = GAIN.powi(-self.run.abs());
        self.confidence += if is_seen { change } else { -change };
    }

    /// Whether it has come away from where it was first seen: what only flickers, or was left in the background, has
    /// not.
    fn has_moved(&self, settings: &MaptrackFind) -> bool {
        distance(self.rect.centre(), self.from) >= settings.moved * self.rect.scale()
    }
}

/// The prospective tracks.
#[derive(Default)]
pub(super) struct Candidates {
    all: Vec<Candidate>,
    /// Scratch: whether a blob is free, for each that fits.
    free: Vec<(Rect, bool)>,
}

impl Candidates {
    /// Moves all places, as the window of the view has moved over the scene by so much.
    pub(super) fn shift(&mut self, [x, y]: [f64; 2]) {
        for candidate in &mut self.all {
            candidate.rect = candidate.rect.shifted(-x, -y);
            candidate.from = [candidate.from[0] - x, candidate.from[1] - y];
        }
    }

    /// Forgets all.
    pub(super) fn clear(&mut self) {
        self.all.clear();
    }

    /// Goes on with the blobs of a frame that belong to no target (in no order); `area` is that of the picture. What is
    /// believed now is taken out and handed to `start`.
    pub(super) fn step(
        &mut self,
        blobs: &[Blob],
        dt: f64,
        area: f64,
        settings: &MaptrackFind,
        mut start: impl FnMut(Candidate),
    ) {
        self.free.clear();
        self.free.extend(blobs.iter().filter(|blob| fits(blob, area, settings)).map(|blob| (blob.rect, true)));
        for candidate in &mut self.all {
            candidate.age += dt;
            let own = nearest(&mut self.free, &candidate.rect, dt);
            candidate.judge(own.is_some());
            if let Some((rect, is_free)) = own {
                (candidate.rect, *is_free) = (*rect, false);
            }
        }
        for (rect, _) in self.free.iter().filter(|(_, is_free)| *is_free) {
            let mut candidate = Candidate::new(*rect);
            candidate.judge(true);
            self.all.push(candidate);
        }
        let is_ready = |c: &Candidate| c.run > 0 && c.confidence > settings.start && c.has_moved(settings);
        self.all.extract_if(.., |candidate| is_ready(candidate)).for_each(&mut start);
        self.all.retain(|candidate| candidate.confidence >= DROP);
    }
}

/// The nearest free blob that a candidate may have become in `dt` frame periods.
fn nearest<'a>(blobs: &'a mut [(Rect, bool)], last: &Rect, dt: f64) -> Option<&'a mut (Rect, bool)> {
    let far = |rect: &Rect| distance(rect.centre(), last.centre());
    let may_be = |rect: &Rect| {
        let growth = rect.area() / last.area();
        far(rect) <= NEAR * dt * last.w.max(last.h) && (1.0 / GROWTH..=GROWTH).contains(&growth)
    };
    let free = blobs.iter_mut().filter(|(rect, is_free)| *is_free && may_be(rect));
    free.min_by(|a, b| far(&a.0).total_cmp(&far(&b.0)))
}

/// The spatial filter (section 3.2.2): area and orientation. `area` is that of the picture.
pub(super) fn fits(blob: &Blob, area: f64, settings: &MaptrackFind) -> bool {
    let share = blob.area / area;
    let from_upright = 90.0 - blob.orientation.to_degrees().abs();
    (settings.least_area..=settings.most_area).contains(&share)
        && (blob.elongation < LONG || from_upright <= settings.orientation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::Params;

    fn settings() -> MaptrackFind {
        Params::default().maptrack.find
    }

    /// An upright blob.
    fn blob(x: f64) -> Blob {
        let rect = Rect::new(x, 20.0, 10.0, 30.0);
        let orientation = std::f64::consts::FRAC_PI_2;
        Blob { rect, area: 250.0, centroid: rect.centre(), orientation, elongation: 3.0 }
    }

    /// The frames (from 1) in which something is started, of those that show the blob or not; it goes to the right.
    fn started(settings: &MaptrackFind, shown: &[bool], speed: f64) -> Vec<usize> {
        let mut candidates = Candidates::default();
        let mut frames = Vec::new();
        for (i, &is_shown) in shown.iter().enumerate() {
            let blobs = [blob(20.0 + speed * i as f64)];
            let blobs = if is_shown { blobs.as_slice() } else { &[] };
            candidates.step(blobs, 1.0, 1e5, settings, |_| frames.push(i + 1));
        }
        frames
    }

    /// 2 + 4 + 8 + 16 + 32 = 62 is the first sum above 60.
    #[test]
    fn confidence_gains_twice_as_much_with_each_frame_in_a_row() {
        assert_eq!(started(&settings(), &[true; 5], 3.0), [5]);
        // 2 + 4 - 2 + 2 + 4 + 8 + 16 = 34, + 32 = 66.
        assert_eq!(started(&settings(), &[true, true, false, true, true, true, true, true], 1.0), [8]);
        let sooner = MaptrackFind { start: 5.0, ..settings() };
        assert_eq!(started(&sooner, &[true; 3], 9.0)[0], 2);
    }

    /// 2 - 2 = 0 is still kept, - 4 is not.
    #[test]
    fn what_stays_away_is_forgotten() {
        let mut candidates = Candidates::default();
        let mut step = |blobs: &[Blob]| {
            candidates.step(blobs, 1.0, 1e5, &settings(), |_| panic!("too soon"));
            candidates.all.iter().map(|candidate| candidate.confidence).collect::<Vec<_>>()
        };
        assert_eq!(step(&[blob(20.0)]), [2.0]);
        assert_eq!(step(&[]), [0.0]);
        assert!(step(&[]).is_empty());
    }

    #[test]
    fn what_does_not_come_away_from_its_place_is_no_target() {
        assert!(started(&settings(), &[true; 20], 0.0).is_empty());
        let at_once = MaptrackFind { moved: 0.0, ..settings() };
        assert_eq!(started(&at_once, &[true; 5], 0.0), [5]);
    }

    #[test]
    fn blobs_must_fit_in_area_and_orientation() {
        let upright = MaptrackFind { orientation: 30.0, ..settings() };
        let fits = |blob: &Blob| fits(blob, 1e5, &upright);
        assert!(fits(&blob(0.0)));
        assert!(!fits(&Blob { area: 60.0, ..blob(0.0) }) && !fits(&Blob { area: 3e4, ..blob(0.0) }));
        for (degrees, fit) in [(70.0f64, true), (-70.0, true), (50.0, false), (0.0, false)] {
            assert_eq!(fits(&Blob { orientation: degrees.to_radians(), ..blob(0.0) }), fit, "{degrees}");
        }
        assert!(fits(&Blob { orientation: 0.0, elongation: 1.2, ..blob(0.0) }), "what is round has no orientation");
    }

    #[test]
    fn blobs_side_by_side_become_targets_of_their_own() {
        let mut candidates = Candidates::default();
        let mut places = Vec::new();
        for n in 0..5 {
            let x = 3.0 * n as f64;
            candidates
                .step(&[blob(90.0 - x), blob(20.0 + x)], 1.0, 1e5, &settings(), |c| places.push((c.rect.x, c.age)));
        }
        assert_eq!(places, [(78.0, 4.0), (32.0, 4.0)]);
    }
}
