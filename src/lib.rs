//! Follows a target that a user marks in a camera stream, or all that move there, says when it has lost it, and finds it again.
//!
//! # The way of the data
//!
//! ```text
//! Image message | image file | bag
//!   -> Frame            borrowed pixels, row step, encoding, stamp             frame
//!   -> Session::step    commands (start, stop, retune) between frames          session
//!      -> Tracker::step crop -> features -> window -> FFT -> response          crop, features, dcf
//!                       -> peak -> confidence -> GM-PHD filter                 tracker, filter
//!                       -> (lost: proposals -> GM-PHD -> verify)               detect, learn
//!                       -> scale -> learn
//!   -> Output           per target: id, state, box, velocity, confidence       tracker
//!   -> publish | write a row or a bag | draw                                   ros, cli, record, draw
//! ```
//!
//! Live and offline differ only at the two ends, so the same frames and parameters give the same boxes.
//!
//! # Rooms
//!
//! | room | what lives there |
//! |---|---|
//! | [`geometry`], [`frame`], [`error`] | boxes and the one convention for coordinates; images as they come in; errors |
//! | [`crop`], [`features`] | search windows cut out and resampled; HOG, colour names, LUV, layers of them; features of pixels, colour histograms |
//! | [`dcf`] | correlation filters: the paper's and the default one, response maps, scale |
//! | [`filter`] | motion models, Kalman steps, the GM-PHD filter; the particle filter |
//! | [`learn`], [`detect`] | the incremental support vector machine, AdaBoost; the detector that looks for a lost target, mean shift, background and blobs, the camera's motion |
//! | [`tracker`] | the interface and one file a tracker; [`tracker::lcmht`], [`tracker::etepf`] and [`tracker::maptrack`] read as their papers |
//! | [`session`], [`trace`] | one stream with one tracker; what a step shows of its inside |
//! | [`params`] | the one table of parameters, and files of them |
//! | [`messages`], [`decode`], [`file`](mod@file) | ROS messages as data; JPEG and PNG; files read as a whole |
//! | [`replay`], [`record`] | frames from folders and bags; the bag that a run leaves |
//! | [`eval`] | scores of this tracker and others, and the page that shows them |
//! | [`cli`], [`draw`] | the offline commands; debug pictures |
//! | `ros` | the node (cargo feature `ros`, on by default) |
//!
//! Start reading at [`tracker::lcmht`], or at [`session`] for how it is driven.
//!
//! # Papers
//!
//! * N. L. Baisa, D. Bhowmik, A. Wallace: *Long-term correlation tracking using multi-layer hybrid features in dense
//!   environments* (LCMHT): [`dcf`], [`detect`], [`filter::gm_phd`], [`tracker::lcmht`].
//! * Y. Gu, P. Li, B. Han: *Embedding ensemble tracking in a stochastic framework for robust object tracking* (ETEPF):
//!   [`learn::adaboost`], [`detect::mean_shift`], [`filter::particles`], [`tracker::etepf`].
//! * S. Basu, M. Karki, M. Stagg, R. DiBiano, S. Ganguly, S. Mukhopadhyay: *MAPTrack: a probabilistic real time tracking
//!   framework by integrating motion, appearance and position models*: [`detect::background`], [`detect::stabilisation`],
//!   [`tracker::maptrack`].
//! * N. L. Baisa: *Derivation of a constant velocity motion model for visual tracking*: [`filter::motion`].

#[cfg(all(feature = "ros", not(feature = "humble")))]
compile_error!("feature `ros` needs a distribution's: humble, jazzy, kilted or lyrical");

pub mod cli;
pub mod crop;
pub mod dcf;
pub mod decode;
pub mod detect;
pub mod draw;
pub mod error;
pub mod eval;
pub mod features;
pub mod file;
pub mod filter;
pub mod frame;
pub mod geometry;
pub mod learn;
pub mod messages;
pub mod params;
pub mod record;
pub mod replay;
#[cfg(feature = "ros")]
pub mod ros;
pub mod session;
pub mod trace;
pub mod tracker;

pub use error::{FrameError, NetworkError, ParamsError, StartError};
pub use frame::{Encoding, Frame};
pub use geometry::Rect;
pub use params::Params;
pub use session::Session;
pub use trace::Trace;
pub use tracker::{Output, State, Target};
