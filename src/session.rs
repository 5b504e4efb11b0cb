//! One stream of frames, one tracker: what the node, the offline commands and the tests all drive.
//!
//! Commands (start, stop, restart, retune) are calls between frames, so a frame is never half of one and half of
//! another parameter set.
//!
//! What changes in mid-stream does not end a track. A picture of another size is taken for the same scene in other
//! pixels, and boxes go along in proportion. Another encoding is looked at as it is; with the colour gone the target
//! may become uncertain. Stamps that cannot be those of a camera, or that there are none of, count as one frame period.

mod cadence;
mod names;
mod zoom;

use std::sync::Arc;

use crate::error::{RenameError, StartError};
use crate::features::contrast::{LEAST_CONTRAST, contrast};
use crate::frame::Frame;
use crate::geometry::Rect;
use crate::network::Networks;
use crate::params::Params;
use crate::trace::Trace;
use crate::tracker::{self, Output, Tracker};
use cadence::Cadence;
use names::Names;
use zoom::{Zoom, factors, stretched};

/// A tracker with the targets it was given and the rhythm of its frames.
pub struct Session {
    params: Params,
    networks: Networks,
    tracker: Box<dyn Tracker>,
    /// Of the targets that are followed, in the order of their starts; when the last has been stopped, of those that
    /// were stopped with it.
    marks: Vec<Mark>,
    stopped: bool,
    /// Whether the tracker has seen no frame yet, or none that it remembers.
    fresh: bool,
    cadence: Cadence,
    /// To the size of picture that the tracker saw first.
    zoom: Zoom,
    output: Output,
    next_id: u32,
    /// Of targets that were renamed.
    names: Names,
}

/// Where a target was marked.
#[derive(Clone, Debug)]
struct Mark {
    id: Arc<str>,
    /// Whether the user gave the id.
    named: bool,
    rect: Rect,
    /// The size of the picture.
    size: [u32; 2],
}

impl Session {
    /// A session that waits for a mark or, where the tracker finds targets by itself, for frames. `networks` are
    /// what the parameters ask for, loaded (see [`loader`](crate::loader)); without one, what it gives is left out.
    pub fn with_networks(params: Params, networks: Networks) -> Self {
        Self {
            tracker: tracker::build(&params, networks.clone()),
            networks,
            params,
            marks: Vec::new(),
            stopped: false,
            fresh: true,
            cadence: Cadence::default(),
            zoom: Zoom::new([1; 2]),
            output: Output::default(),
            next_id: 0,
            names: Names::default(),
        }
    }

    /// The parameters in force.
    pub fn params(&self) -> &Params {
        &self.params
    }

    /// The networks that the parameters in force ask for, as they were handed in.
    pub fn networks(&self) -> Networks {
        self.networks.clone()
    }

    /// Why the last run of a network failed, if it did: nothing answers to what such a run leaves, so that targets
    /// may be lost by it.
    pub fn network_failure(&self) -> Option<String> {
        self.networks.failure()
    }

    /// Whether frames are tracked: a target is being followed, or targets are being looked for.
    pub fn is_active(&self) -> bool {
        !self.stopped && (self.tracker.finds() || !self.marks.is_empty())
    }

    /// Takes up the target in `rect` under a number of its own: see [`Session::start_as`].
    pub fn start(&mut self, frame: &Frame, rect: Rect, trace: &mut dyn Trace) -> Result<&Output, StartError> {
        self.start_as(None, frame, rect, trace)
    }

    /// Takes up the target in `rect`, on the frame that the session was stepped into last or, if no target is followed
    /// yet, on any. A target of the same id begins anew; where a single target may be followed, the new one takes its
    /// place. A mark that cannot be followed is refused and changes nothing. What the tracker has found by itself does
    /// not count.
    pub fn start_as(
        &mut self,
        id: Option<&str>,
        frame: &Frame,
        rect: Rect,
        trace: &mut dyn Trace,
    ) -> Result<&Output, StartError> {
        self.start_from(id, frame, &[], rect, trace)
    }

    /// Takes up the target in `rect` of a frame that has passed, and follows it alone through those that came after it,
    /// in order, up to the one that the session was stepped into last. Otherwise as [`Session::start_as`].
    pub fn start_from<'a, 'b: 'a>(
        &mut self,
        id: Option<&str>,
        frame: &Frame,
        later: impl IntoIterator<Item = &'a Frame<'b>>,
        rect: Rect,
        trace: &mut dyn Trace,
    ) -> Result<&Output, StartError> {
        self.check_mark(frame, &rect)?;
        let most = self.params.general.max_targets as usize;
        if self.stopped {
            self.marks.clear();
        }
        let known = id.map(|id| self.names.known(id).to_owned());
        let is_known = self.marks.iter().any(|mark| Some(&*mark.id) == known.as_deref());
        if most == 1 && !is_known {
            self.drop_marks();
        } else if !is_known && self.marks.len() >= most {
            return Err(StartError::Full { most });
        }
        let (id, named) = match (id, known) {
            // The tracker knows another target by this name.
            (Some(shown), Some(known)) if known == shown && self.names.is_left(shown) => {
                let id = self.new_id();
                self.names.set(&id, shown);
                (id, true)
            }
            (_, Some(known)) => (known.into(), true),
            (_, None) => (self.new_id(), false),
        };
        let size = [frame.width(), frame.height()];
        self.begin(Mark { id, named, rect, size }, frame, later, trace);
        self.report();
        Ok(&self.output)
    }

    /// Forgets all targets and takes up those of the last marks again, each where it was marked; all of them or, where
    /// one cannot be followed in this frame, none. A tracker that finds targets by itself looks for them again, with
    /// marks or without.
    pub fn restart(&mut self, frame: &Frame, trace: &mut dyn Trace) -> Result<&Output, StartError> {
        if self.marks.is_empty() && !self.tracker.finds() {
            return Err(StartError::NoMark);
        }
        let size = [frame.width(), frame.height()];
        let here = |mark: &Mark| stretched(mark.rect, factors(mark.size, size));
        self.marks.iter().try_for_each(|mark| self.check_mark(frame, &here(mark)))?;
        let marks = std::mem::take(&mut self.marks);
        self.stop();
        self.stopped = false;
        for mark in marks {
            let rect = here(&mark);
            let id = if mark.named { mark.id } else { self.new_id() };
            self.begin(Mark { id, rect, size, ..mark }, frame, &[], trace);
        }
        self.report();
        Ok(&self.output)
    }

    /// Forgets all targets, and finds none, until one is marked or [`Session::restart`] is called.
    pub fn stop(&mut self) {
        self.tracker.clear();
        (self.stopped, self.fresh) = (true, true);
        self.output.targets.clear();
    }

    /// Forgets one target; says whether there was one of this id. One that moves may be found again, under another id.
    pub fn stop_target(&mut self, id: &str) -> bool {
        let is_known = self.is_followed(id);
        if is_known && self.output.targets.len() == 1 && !self.tracker.finds() {
            self.stop();
        } else if is_known {
            let id = self.names.known(id).to_owned();
            self.marks.retain(|mark| *mark.id != *id);
            self.tracker.stop(&id);
            self.report();
        }
        is_known
    }

    /// Calls a target otherwise from now on. Refused where there is no such target, or another has that name.
    pub fn rename(&mut self, id: &str, to: &str) -> Result<(), RenameError> {
        if !self.is_followed(id) {
            return Err(RenameError::NoTarget(id.to_owned()));
        }
        if id == to {
            return Ok(());
        }
        if self.is_followed(to) {
            return Err(RenameError::Taken(to.to_owned()));
        }
        let known: Arc<str> = self.names.known(id).into();
        self.marks.iter_mut().filter(|mark| mark.id == known).for_each(|mark| mark.named = true);
        self.names.set(&known, to);
        self.output.targets.iter_mut().filter(|target| *target.id == *id).for_each(|target| target.id = to.into());
        Ok(())
    }

    fn is_followed(&self, id: &str) -> bool {
        self.output.targets.iter().any(|target| &*target.id == id)
    }

    /// Takes over changed parameters from the next frame on, with the networks that they ask for: those of
    /// [`networks`](Self::networks) if they ask for no others. What is fixed stays as it was. Targets beyond a smaller
    /// `max_targets` are kept.
    pub fn retune(&mut self, params: Params, networks: Networks) {
        self.tracker.retune(&params, networks.clone());
        (self.params, self.networks) = (params, networks);
    }

    /// Follows the targets into the next frame. Without a target the output is empty and nothing is computed, unless
    /// the tracker finds targets by itself.
    pub fn step(&mut self, frame: &Frame, trace: &mut dyn Trace) -> &Output {
        if self.is_active() {
            if std::mem::take(&mut self.fresh) {
                self.set_out(frame);
            }
            let dt = self.cadence.advance(frame.stamp());
            let seen = self.see(frame);
            let Self { tracker, zoom, marks, next_id, names, .. } = self;
            tracker.step(&seen, dt, &mut || new_id(next_id, marks, names), &mut zoom.trace(&mut names.trace(trace)));
            self.report();
        }
        &self.output
    }

    /// What was said of the last frame.
    pub fn output(&self) -> &Output {
        &self.output
    }

    /// Checks that the target can be followed from this frame on, and that there is anything to follow.
    fn check_mark(&self, frame: &Frame, rect: &Rect) -> Result<(), StartError> {
        frame.check_target(rect)?;
        let (contrast, min) = (contrast(&frame.with_levels(self.params.levels.range()), rect), LEAST_CONTRAST);
        if contrast < min { Err(StartError::Blank { rect: *rect, contrast, min }) } else { Ok(()) }
    }

    fn new_id(&mut self) -> Arc<str> {
        new_id(&mut self.next_id, &self.marks, &self.names)
    }

    /// Forgets the targets that were marked; what a tracker knows besides them stays.
    fn drop_marks(&mut self) {
        self.marks.iter().for_each(|mark| self.tracker.stop(&mark.id));
        self.marks.clear();
        self.fresh |= !self.tracker.finds();
    }

    /// This is the first frame that the tracker sees.
    fn set_out(&mut self, frame: &Frame) {
        self.cadence = Cadence::default();
        self.cadence.set_out(frame.stamp());
        self.zoom = Zoom::new([frame.width(), frame.height()]);
    }

    fn begin<'a, 'b: 'a>(
        &mut self,
        mark: Mark,
        frame: &Frame,
        later: impl IntoIterator<Item = &'a Frame<'b>>,
        trace: &mut dyn Trace,
    ) {
        self.marks.retain(|other| other.id != mark.id);
        let is_first = std::mem::take(&mut self.fresh) || (self.marks.is_empty() && !self.tracker.finds());
        if is_first {
            self.set_out(frame);
        }
        let mut cadence = self.cadence.clone();
        cadence.set_out(frame.stamp());
        let seen = self.see(frame);
        let rect = self.zoom.into_known(mark.rect);
        self.tracker.start(&mark.id, &seen, rect, &mut self.zoom.trace(&mut self.names.trace(trace)));
        for frame in later {
            let dt = cadence.advance(frame.stamp());
            let seen = self.see(frame);
            self.tracker.catch_up(&mark.id, &seen, dt, &mut self.zoom.trace(&mut self.names.trace(trace)));
        }
        if is_first {
            self.cadence = cadence;
        }
        self.marks.push(mark);
        self.stopped = false;
    }

    /// The frame as the tracker is to see it.
    fn see<'a>(&mut self, frame: &Frame<'a>) -> Frame<'a> {
        self.zoom.see(&frame.with_levels(self.params.levels.range()))
    }

    fn report(&mut self) {
        self.tracker.report(&mut self.output);
        let Self { names, marks, output, .. } = self;
        names.retain(|id| marks.iter().any(|mark| mark.id == *id) || output.targets.iter().any(|t| t.id == *id));
        for target in &mut self.output.targets {
            target.id = self.names.shown(&target.id).clone();
            target.velocity = target.velocity.map(|v| v * self.cadence.frame_rate());
            self.zoom.apply(target);
        }
    }
}

/// The next number that is no mark's id, nor another target's name.
fn new_id(next: &mut u32, marks: &[Mark], names: &Names) -> Arc<str> {
    loop {
        let id = next.to_string();
        *next += 1;
        if !marks.iter().any(|mark| *mark.id == *id) && !names.is_taken(&id) {
            return id.into();
        }
    }
}
