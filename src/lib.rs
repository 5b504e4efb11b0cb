//! Follows a target that a user marks in a camera stream, says when it has lost it, and finds it again.

pub mod cli;
pub mod crop;
pub mod dcf;
pub mod detect;
pub mod draw;
pub mod error;
pub mod eval;
pub mod features;
pub mod filter;
pub mod frame;
pub mod geometry;
pub mod learn;
pub mod params;
pub mod replay;
#[cfg(feature = "ros")]
pub mod ros;
pub mod session;
pub mod trace;
pub mod tracker;

pub use error::{FrameError, ParamsError, StartError};
pub use frame::{Encoding, Frame};
pub use geometry::Rect;
pub use params::Params;
pub use session::Session;
pub use trace::Trace;
pub use tracker::{Output, State, Target};
