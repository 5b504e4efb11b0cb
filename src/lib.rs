//! Follows a target that a user marks in a camera stream, or all that move there, says when it has lost it, and finds
//! it again.
//!
//! # The way of the data
//!
//! ```text
//! Image message | image file | bag
//!   -> Frame            borrowed pixels, row step, encoding, stamp             frame
//!   -> Session::step    commands (start, stop, retune) between frames          session
//!      -> Tracker::step crop -> features -> window -> FFT -> response          crop, features, dcf, appearance
//!                       -> peak -> confidence -> GM-PHD filter                 tracker, filter
//!                       -> (lost: proposals -> GM-PHD -> verify)               detect, learn
//!                       -> scale -> learn                                      appearance
//!   -> Output           per target: id, state, box, velocity, confidence       output
//!   -> publish | write a row or a bag | draw | show in a browser               ros, cli, record, draw, viewer
//! ```
//!
//! Live and offline differ only at the two ends, so the same frames and parameters give the same boxes.
//!
//! # Rooms
//!
//! A room takes only from rooms that stand before it here, and no two files of the core take from each other;
//! `tests/rooms.rs` holds that. Below [`loader`] nothing writes to a log, and nothing but [`params`] reads files.
//!
//! | room | what lives there |
//! |---|---|
//! | [`geometry`], [`error`] | boxes and the one convention for coordinates; errors |
//! | [`file`](mod@file) | files read as a whole |
//! | [`frame`], [`crop`] | images as they come in; windows cut out and resampled |
//! | [`dcf`] | signals of correlation filters: the paper's filter and the default one, response maps; of no features |
//! | [`filter`], [`learn`] | motion models, Kalman steps, the GM-PHD filter, the particle filter; the incremental support vector machine, AdaBoost |
//! | [`features`] | HOG, colour names, LUV; features of pixels, colour histograms |
//! | [`network`] | convolutional networks, handed in as bytes |
//! | [`params`] | the one table of parameters, and files of them |
//! | [`trace`], [`output`] | what a step shows of its inside; what it says of the targets |
//! | [`detect`] | the detector that looks for a lost target, mean shift, background and blobs, the camera's motion |
//! | [`appearance`] | what a target looks like: layers of features, filters on them, scale, and what a response says |
//! | [`tracker`] | the interface and one file a tracker; [`tracker::lcmht`], [`tracker::etepf`] and [`tracker::maptrack`] read as their papers |
//! | [`session`] | one stream with one tracker |
//! | [`loader`] | networks from their files, and what runs them |
//! | [`decode`], [`messages`] | JPEG and PNG; ROS messages as data |
//! | [`replay`], [`draw`], [`record`] | frames from folders and bags; debug pictures; the bag that a run leaves |
//! | [`viewer`] | the live page: what a tracker does, in a browser, and what is asked of it there (served with the cargo feature `viewer`) |
//! | [`eval`], [`cli`] | scores of this tracker and others, and the page that shows them; the offline commands |
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
//! * S. Basu, M. Karki, M. Stagg, R. DiBiano, S. Ganguly, S. Mukhopadhyay: *MAPTrack: a probabilistic real time
//!   tracking framework by integrating motion, appearance and position models*: [`detect::background`],
//!   [`detect::stabilisation`], [`tracker::maptrack`].
//! * N. L. Baisa: *Derivation of a constant velocity motion model for visual tracking*: [`filter::motion`].

#![forbid(unsafe_code)]

#[cfg(all(feature = "ros", not(feature = "humble")))]
compile_error!("feature `ros` needs the feature of a distribution: humble, jazzy, kilted or lyrical");

pub mod appearance;
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
pub mod loader;
pub mod messages;
pub mod network;
pub mod output;
pub mod params;
pub mod record;
pub mod replay;
#[cfg(feature = "ros")]
pub mod ros;
pub mod session;
pub mod trace;
pub mod tracker;
pub mod viewer;

pub use error::{FrameError, NetworkError, ParamsError, RenameError, StartError};
pub use frame::{Encoding, Frame};
pub use geometry::Rect;
pub use output::{Output, State, Target};
pub use params::Params;
pub use session::Session;
pub use trace::Trace;
