//! The interface of all trackers, and the trackers.
//!
//! | file | what it holds |
//! |---|---|
//! | `lcmht.rs`, `etepf.rs`, `maptrack.rs` | a tracker each, which reads as its paper |
//! | `targets.rs` | the list of the targets that a tracker follows |
//! | `build.rs` | the tracker that the parameters name |

mod build;
pub mod etepf;
pub mod lcmht;
mod made;
pub mod maptrack;
mod targets;

use std::sync::Arc;

pub use build::build;

use crate::frame::Frame;
use crate::geometry::Rect;
use crate::network::Networks;
pub use crate::output::{Output, State, Target};
use crate::params::Params;
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

    /// Takes over changed parameters and the networks that they ask for; the track goes on.
    fn retune(&mut self, params: &Params, networks: Networks);
}
