//! A recording, followed frame by frame: what `track` does with one, or with many.

use std::path::PathBuf;
use std::time::Duration;

use super::Error;
use super::timing::StageClock;
use crate::frame::FrameBuffer;
use crate::geometry::Rect;
use crate::loader::FailureLog;
use crate::output::Output;
use crate::params::Algorithm;
use crate::replay::{FrameSource, truth};
use crate::session::Session;
use crate::trace::Trace;

/// A target's box on the first frame.
#[derive(Clone, Debug)]
pub struct Mark {
    /// The box.
    pub rect: Rect,
    /// Where it was taken from, for messages.
    pub from: String,
}

impl Mark {
    /// The first row of the ground truth beside the frames. `None` without one where the tracker finds targets.
    pub fn beside(source: &dyn FrameSource, algorithm: Algorithm) -> Result<Option<Self>, Error> {
        let candidates = source.truth_candidates();
        let path = candidates.iter().find(|p| p.exists()).or(candidates.first());
        let path = path.map_or_else(|| PathBuf::from(truth::FILE_NAME), Clone::clone);
        let boxes = if path.exists() { truth::read(&path).map_err(Error::Truth)? } else { Vec::new() };
        match boxes.first() {
            Some(&Some(rect)) => Ok(Some(Self { rect, from: path.display().to_string() })),
            _ if algorithm == Algorithm::Maptrack => Ok(None),
            _ => Err(Error::NoTarget(path)),
        }
    }
}

/// A recording with the tracker on it.
pub struct Following {
    /// The frames still to come.
    pub source: Box<dyn FrameSource>,
    /// The tracker.
    pub session: Session,
    /// Where the time goes.
    pub clock: StageClock,
    /// Frames so far.
    pub frames: usize,
    /// Time that the tracker took for the last frame.
    pub processing: Duration,
    mark: Option<Mark>,
    failures: FailureLog,
}

impl Following {
    /// Before the first frame, on which the target is marked.
    pub fn new(source: Box<dyn FrameSource>, session: Session, mark: Option<Mark>) -> Self {
        let (clock, failures) = (StageClock::default(), FailureLog::default());
        Self { source, session, clock, frames: 0, processing: Duration::ZERO, mark, failures }
    }

    /// Takes the tracker into the next frame; `None` after the last.
    pub fn step(&mut self, trace: &mut dyn Trace) -> Result<Option<FrameBuffer>, Error> {
        let Some(buffer) = self.source.next_frame().map_err(Error::Read)? else { return Ok(None) };
        self.clock.begin();
        let mut trace = (&mut self.clock, trace);
        match self.mark.take() {
            Some(Mark { rect, from }) => {
                let started = self.session.start(&buffer.frame(), rect, &mut trace);
                started.map_err(|source| Error::Start { from, source })?;
            }
            None => drop(self.session.step(&buffer.frame(), &mut trace)),
        }
        self.processing = self.clock.end();
        self.failures.watch(&self.session);
        self.frames += 1;
        Ok(Some(buffer))
    }

    /// What was said of the last frame.
    pub fn output(&self) -> &Output {
        self.session.output()
    }
}
