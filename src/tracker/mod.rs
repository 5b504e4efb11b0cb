//! The interface of all trackers, and what they say of a target.

pub mod etepf;
pub mod lcmht;
pub mod maptrack;
mod targets;

use std::sync::Arc;

use crate::error::NetworkError;
use crate::features::cnn::Networks;
use crate::frame::Frame;
use crate::geometry::Rect;
use crate::params::{Algorithm, Params};
use crate::trace::Trace;

/// Gives a target that was found, and that nobody named, an id that no other has.
pub type NewId<'a> = dyn FnMut() -> Arc<str> + 'a;

/// A tracker of one target or of several.
///
/// Frames come in order. `dt` is the time since the frame before, in frame periods (1 where none was skipped).
pub trait Tracker: Send {
    /// Takes up the target in `rect`, which has been checked against the frame, beside those that are followed already.
    /// One of the same id is begun anew.
    fn start(&mut self, id: &Arc<str>, frame: &Frame, rect: Rect, trace: &mut dyn Trace);

    /// Whether it takes up what moves without a mark, so that frames mean something to it before there is any target.
    fn finds(&self) -> bool {
        false
    }

    /// Forgets the target of this id.
    fn stop(&mut self, id: &str);

    /// Forgets all targets, and all that it has learned from frames.
    fn clear(&mut self);

    /// Follows one target into a frame that the others have been followed into already.
    fn catch_up(&mut self, id: &str, frame: &Frame, dt: f64, trace: &mut dyn Trace);

    /// Follows all targets into the next frame, and takes up, under ids from `ids`, what it finds there.
    fn step(&mut self, frame: &Frame, dt: f64, ids: &mut NewId, trace: &mut dyn Trace);

    /// Writes what is known of each target, in the order of their starts.
    fn report(&self, output: &mut Output);

    /// Takes over changed parameters, or says why it cannot; the track goes on.
    fn retune(&mut self, params: &Params) -> Result<(), NetworkError>;
}

/// The tracker that the parameters name, with its network from `networks`, or why a file that they name cannot be used.
pub fn build(params: &Params, networks: &Networks) -> Result<Box<dyn Tracker>, NetworkError> {
    match params.general.algorithm {
        Algorithm::Lcmht => Ok(Box::new(lcmht::Lcmht::new(params, networks)?)),
        Algorithm::Etepf => Ok(Box::new(etepf::Etepf::new(params))),
        Algorithm::Maptrack => Ok(Box::new(maptrack::Maptrack::new(params))),
    }
}

/// Whether the changed parameters ask for another network.
pub fn asks_for_network(old: &Params, new: &Params) -> bool {
    new.general.algorithm == Algorithm::Lcmht && lcmht::asks_for_network(old, new)
}

/// Whether a tracker that has its network from `networks` could take over the changed parameters, or why a file that they
/// name cannot be used. What has to be loaded for them is loaded here, and the tracker finds it there.
pub fn check(networks: &Networks, old: &Params, new: &Params) -> Result<(), NetworkError> {
    match new.general.algorithm {
        Algorithm::Lcmht => lcmht::check(networks, old, new),
        Algorithm::Etepf | Algorithm::Maptrack => Ok(()),
    }
}

/// How sure the tracker is of where the target is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum State {
    /// The target is where the box is.
    #[default]
    Tracking,
    /// It probably is; nothing is learned from this frame.
    Uncertain,
    /// It is not in sight. The box is the best guess, and it is being searched for.
    Lost,
}

impl State {
    /// The name in CSV files and log lines.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Tracking => "tracking",
            Self::Uncertain => "uncertain",
            Self::Lost => "lost",
        }
    }
}

/// What is known of one target on one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// Name of the target; the same from start to end.
    pub id: Arc<str>,
    /// Where it is, in pixels.
    pub rect: Rect,
    /// Velocity of the centre: pixels a second, or pixels a frame where frames bear no stamps.
    pub velocity: [f64; 2],
    /// Share of such boxes that can be expected to be right, 0 to 1.
    pub confidence: f32,
    /// Peak of the fused response map; of ETEPF, the mean likelihood within the box; of MAPTrack, how much of the target
    /// moves or looks as it is remembered.
    pub response: f32,
    /// How sure the tracker is.
    pub state: State,
    /// Whether it was found again on this very frame.
    pub reacquired: bool,
    /// Frames since the start, skipped ones not counted.
    pub age: u32,
    /// Frames since it was lost; 0 while it is not.
    pub lost_for: u32,
}

/// What a tracker says of one frame.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Output {
    /// In the order of their starts; none before the first mark, unless the tracker finds them.
    pub targets: Vec<Target>,
}
