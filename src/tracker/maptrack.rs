//! Many moving targets, found without a mark: MAPTrack (Basu, Karki, Stagg, DiBiano, Ganguly and Mukhopadhyay,
//! *MAPTrack: a probabilistic real time tracking framework by integrating motion, appearance and position models*).
//!
//! What moves is told from the background by an adaptive mixture of Gaussians. Blobs of it that last are taken up as
//! targets. A target is followed by three images of the region where it is expected: what moves, what has its colours,
//! and how near each place is to the expected one; together they make the composite probability image, on which mean
//! shift finds the target. One that is hidden is held where its velocity would have led it, until enough of it moves
//! again. `Maptrack::step` is the way of a frame, `Track::step` that of a target in it.
//!
//! | file | what it holds |
//! |---|---|
//! | `maptrack/view.rs` | the picture, what moves in it (section 3.2), and whose each moving pixel is |
//! | `maptrack/find.rs` | the spatial and the temporal filter (sections 3.2.2 to 3.2.4, eq 1) |
//! | `maptrack/track.rs` | one target: the framework of section 3.3, occlusions, what is learned |
//! | `maptrack/region.rs` | the images of a region (eqs 4, 7, 9 to 11) |
//! | `maptrack/colours.rs` | colour histograms (eqs 2 to 4) |
//! | `maptrack/history.rs` | the motion history image (eq 8) |
//! | `maptrack/path.rs` | velocity and expected places (eqs 5, 6, 12 and 13) |
//! | `maptrack/pattern.rs` | the pattern of a marked target |
//! | `maptrack/state.rs` | what the images say of a target (table 1) |
//! | `detect/stabilisation.rs`, `detect/camera.rs` | the camera's motion, and pictures without it (section 3.1) |
//! | `detect/background.rs`, `detect/blobs.rs` | the mixture of Gaussians; opening, closing and blobs |

mod colours;
mod find;
mod history;
mod path;
mod pattern;
mod region;
mod state;
mod track;
mod view;

use std::sync::Arc;

use super::made::Made;
use super::targets::Targets;
use super::{NewId, Output, Tracker};
use crate::crop::Cropper;
use crate::detect::blobs::Blob;
use crate::frame::Frame;
use crate::geometry::{Rect, distance};
use crate::network::Networks;
use crate::params::{Group as _, MaptrackParams, Need, Params};
use crate::trace::{Event, Proposal, Stage, Trace};
use find::{Candidate, Candidates, fits};
use region::Region;
use track::{MARGIN, Track, WIDTHS};
use view::{NOBODY, SceneView};

/// A blob belongs to a target if they share this part of the smaller of their boxes.
const SHARED: f64 = 0.3;
/// What is around a target's box by no more than this factor is still the target's.
const FRINGE: f64 = 1.2;

/// The tracker.
pub struct Maptrack {
    params: MaptrackParams,
    cropper: Cropper,
    view: SceneView,
    region: Region,
    candidates: Candidates,
    targets: Targets<Track>,
    /// Scratch: blobs that belong to no target, and what of each target's blobs is its alone.
    unexplained: Vec<Blob>,
    own: Vec<Option<Rect>>,
    /// Scratch: the blobs to show.
    proposals: Vec<Proposal>,
    /// What changed parameters had made anew since the last frame.
    made: Made,
}

impl Maptrack {
    /// A tracker that has seen nothing.
    pub fn new(params: &Params) -> Self {
        let params = params.maptrack.clone();
        Self {
            view: SceneView::new(&params),
            params,
            cropper: Cropper::default(),
            region: Region::default(),
            candidates: Candidates::default(),
            targets: Targets::default(),
            unexplained: Vec::new(),
            own: Vec::new(),
            proposals: Vec::new(),
            made: Made::default(),
        }
    }

    /// Takes out the camera's motion and finds what moves (sections 3.1 and 3.2).
    fn look(&mut self, frame: &Frame, trace: &mut dyn Trace) {
        let Self { view, targets, candidates, params, proposals, .. } = self;
        let moved = view.look(frame, params);
        targets.iter_mut().for_each(|target| target.shift(moved));
        candidates.shift(moved);
        let area = view.bounds().area();
        proposals.clear();
        let fitting = view.blobs().iter().filter(|blob| fits(blob, area, &params.find));
        proposals.extend(fitting.map(|blob| Proposal { rect: view.to_frame(&blob.rect), score: 1.0 }));
        trace.event(Event::Proposals(proposals));
    }

    /// Lets each target expect its place or recognise it, and each moving pixel be the target's that it suits best.
    fn share(&mut self, frame: &Frame, dt: f64) {
        let Self { view, region, targets, cropper, params, .. } = self;
        for target in targets.iter_mut() {
            target.expect_either(view, region, dt, params);
            target.recognise(frame, cropper, view);
        }
        if params.groups.share && targets.as_slice().len() > 1 {
            view.open_claims();
            for (i, target) in targets.as_slice().iter().enumerate().filter(|(_, target)| !target.is_hidden()) {
                target.claim(view, number(i));
            }
        }
    }

    /// What of each target's blobs is its alone: the box around them.
    fn assign(&mut self) {
        let Self { view, targets, own, .. } = self;
        let targets = targets.as_slice();
        own.clear();
        own.resize(targets.len(), None);
        for blob in view.blobs() {
            let touches = |target: &Track| {
                let shared = blob.rect.intersection(&target.expected).area();
                shared > SHARED * blob.rect.area().min(target.expected.area())
            };
            let mut touched = (0..targets.len()).filter(|&i| touches(&targets[i]));
            if let (Some(i), None) = (touched.next(), touched.next()) {
                own[i] = Some(own[i].map_or(blob.rect, |rect| union(&rect, &blob.rect)));
            }
        }
    }

    /// Follows each target (section 3.3).
    fn follow(&mut self, trace: &mut dyn Trace) {
        let Self { view, region, targets, own, params, .. } = self;
        for (i, (target, own)) in targets.iter_mut().zip(own).enumerate() {
            target.step(view, region, number(i), *own, params);
            target.show(view, region, trace);
            if i == 0 {
                target.show_cues(view, region, trace);
            }
        }
    }

    /// Ends the tracks of targets that are gone.
    fn end(&mut self) {
        let Self { view, targets, params, .. } = self;
        let bounds = view.bounds();
        targets.retain(|target| !target.has_ended(&bounds, params));
    }

    /// Takes up what moves and belongs to no target, once it is believed (section 3.2).
    fn find(&mut self, dt: f64, ids: &mut NewId) {
        let Self { view, region, candidates, targets, params, unexplained, .. } = self;
        let found = targets.as_slice().iter().filter(|target| !target.is_marked).count();
        let room = (params.find.most as usize).saturating_sub(found);
        if params.find.most == 0 || !view.is_believed() {
            candidates.clear();
            return;
        }
        let boxes = targets.as_slice().iter().filter(|t| !t.is_hidden()).map(|target| target.rect.scaled(FRINGE));
        view.unexplained(boxes, params.find.lambda, unexplained);
        let mut started = 0;
        candidates.step(unexplained, dt, view.bounds().area(), &params.find, |candidate| {
            let track = Track::found("".into(), &candidate, view, region);
            if let Some(hidden) = recalled(targets, &track, &candidate, params) {
                hidden.take_over(track);
            } else if started < room {
                started += 1;
                targets.add(Track::found(ids(), &candidate, view, region));
            }
        });
    }
}

/// The hidden target that was found again, if it is one.
fn recalled<'a>(
    targets: &'a mut Targets<Track>,
    track: &Track,
    candidate: &Candidate,
    params: &MaptrackParams,
) -> Option<&'a mut Track> {
    let reach = WIDTHS * MARGIN * candidate.rect.w;
    let fits = |target: &Track| {
        target.is_hidden()
            && distance(target.expected.centre(), candidate.rect.centre()) < reach
            && target.likeness(track) > params.find.recall
    };
    let hidden = targets.iter_mut().filter(|target| fits(target));
    hidden.max_by(|a, b| a.likeness(track).total_cmp(&b.likeness(track)))
}

/// The number under which the target at this place in the list claims pixels; by their ranges there are not too many.
fn number(index: usize) -> u8 {
    NOBODY + 1 + index.min(usize::from(u8::MAX) - 1) as u8
}

/// The box around two.
fn union(a: &Rect, b: &Rect) -> Rect {
    let (x, y) = (a.x.min(b.x), a.y.min(b.y));
    Rect::new(x, y, (a.x + a.w).max(b.x + b.w) - x, (a.y + a.h).max(b.y + b.h) - y)
}

impl Tracker for Maptrack {
    fn start(&mut self, id: &Arc<str>, frame: &Frame, rect: Rect, trace: &mut dyn Trace) {
        trace.event(Event::Stage(Stage::Learn));
        let Self { view, region, params, cropper, .. } = self;
        if view.is_fresh() {
            view.look(frame, params);
        } else {
            view.see(frame, params);
        }
        let mut track = Track::marked(id.clone(), view.to_view(&rect), view, region);
        track.learn_pattern(frame, cropper, &rect, params);
        self.targets.add(track);
    }

    fn finds(&self) -> bool {
        self.params.find.most > 0
    }

    fn stop(&mut self, id: &str) {
        self.targets.stop(id);
    }

    fn clear(&mut self) {
        self.targets = Targets::default();
        self.candidates.clear();
        self.view = SceneView::new(&self.params);
    }

    /// Motion in frames that have passed is not known any more: colours and position lead alone.
    fn catch_up(&mut self, id: &str, frame: &Frame, dt: f64, trace: &mut dyn Trace) {
        let Self { view, region, params, targets, cropper, .. } = self;
        trace.event(Event::Stage(Stage::Localise));
        if let Some(target) = targets.get_mut(id) {
            view.see(frame, params);
            target.expect_either(view, region, dt, params);
            target.recognise(frame, cropper, view);
            target.step(view, region, NOBODY, None, params);
            target.show(view, region, trace);
        }
    }

    fn step(&mut self, frame: &Frame, dt: f64, ids: &mut NewId, trace: &mut dyn Trace) {
        self.made.show(trace);
        trace.event(Event::Stage(Stage::Features));
        self.look(frame, trace);
        trace.event(Event::Stage(Stage::Localise));
        self.share(frame, dt);
        self.assign();
        self.follow(trace);
        self.end();
        trace.event(Event::Stage(Stage::Redetect));
        self.find(dt, ids);
    }

    fn report(&self, output: &mut Output) {
        self.targets.report(output);
    }

    fn retune(&mut self, params: &Params, _: Networks) {
        let old = std::mem::replace(&mut self.params, params.maptrack.clone());
        if self.params.differs(&old, Need::Background) {
            self.view.forget_background(&self.params);
            self.made.note(Need::Background);
        }
    }
}
