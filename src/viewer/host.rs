//! What pages can ask of the tracker behind them.

use std::pin::Pin;

use serde::{Deserialize, Serialize};

use crate::frame::Stamp;
use crate::geometry::Rect;
use crate::params::{Params, Value};

/// What a page asks for.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Follow what is in the box, on the frame of this stamp or on the newest.
    Mark {
        /// The box, in pixels of the frame.
        rect: Rect,
        /// How the target is to be called.
        id: Option<String>,
        /// The frame that was on the screen.
        stamp: Stamp,
    },
    /// Follow that target no longer, or none.
    Stop(Option<String>),
    /// Take up the last marks again.
    Restart,
    /// Call a target by another name.
    Rename {
        /// The target.
        id: String,
        /// Its new name.
        to: String,
    },
    /// Keep the frame of this stamp until it is marked or released: a page shows it and stands still.
    Hold {
        /// The page.
        page: u64,
        /// The frame.
        stamp: Stamp,
    },
    /// Keep no frame for this page any more.
    Release {
        /// The page.
        page: u64,
    },
    /// Give a parameter another value.
    Set {
        /// The parameter.
        name: String,
        /// The value.
        value: Value,
    },
    /// Go through the recording.
    Replay(Replay),
}

/// What can be done with a recording. Frames count from 0.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Replay {
    /// Go on by itself, or stand still.
    Play(bool),
    /// Show that frame; the tracker runs up to it, if it has not yet.
    Jump(usize),
    /// Go so many times as fast as the recording; 0 as fast as can be.
    Speed(f64),
    /// Run again from the start, with the same marks and the parameters of now.
    Again,
    /// Give the rows of this run.
    Rows,
    /// Write the bag of this run.
    Bag,
}

/// Where a recording stands.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Playback {
    /// The frame that is shown.
    pub frame: usize,
    /// How many there are, where that is known.
    pub frames: Option<usize>,
    /// How many the tracker has been through.
    pub ran: usize,
    /// Whether it goes on by itself.
    pub is_playing: bool,
    /// How many times as fast as the recording.
    pub speed: f64,
    /// Whether a bag can be written.
    pub has_bag: bool,
    /// How many runs there were, with this one.
    pub run: usize,
}

/// The text that was asked for, if any was, or why something was not done.
pub type Asked = Pin<Box<dyn Future<Output = Result<Option<String>, String>> + Send>>;

/// The tracker behind the pages.
pub trait Host: Send + Sync {
    /// The parameters in force.
    fn params(&self) -> Params;

    /// Does what a page asks for. What becomes of a mark is told by an [`Event`](super::Event): it may have to wait.
    fn ask(&self, command: Command) -> Asked;
}
