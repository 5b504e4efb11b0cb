//! What happened in the last minutes: figures of each frame, events, and the health of the parts.

use std::sync::Arc;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde::{Serialize, Serializer};

use crate::frame::Stamp;
use crate::geometry::Rect;
use crate::trace::{self, Thresholds, Trace};
use crate::tracker::{State, Target};

/// Targets of which a sample keeps figures.
const MOST_TARGETS: usize = 8;

/// What the responses of a step were held against, of each target.
#[derive(Clone, Debug, Default)]
pub struct KeptThresholds(Vec<(String, Thresholds)>);

impl KeptThresholds {
    fn of(&self, id: &str) -> Option<Thresholds> {
        // A target that caught up was followed through several frames.
        self.0.iter().rev().find(|(other, _)| other == id).map(|(_, thresholds)| *thresholds)
    }
}

impl Trace for KeptThresholds {
    fn event(&mut self, event: trace::Event) {
        if let trace::Event::Thresholds { id, thresholds } = event {
            self.0.push((id.to_owned(), thresholds));
        }
    }

    fn looks_inside(&self) -> bool {
        false
    }
}

/// What was said of a frame.
#[derive(Clone, Copy, Debug)]
pub struct Said<'a> {
    /// What marks name the frame by.
    pub stamp: Stamp,
    /// Its targets.
    pub targets: &'a [Target],
    /// What their responses were held against.
    pub thresholds: &'a KeptThresholds,
    /// Frames that were skipped before it.
    pub skipped: u32,
    /// From its arrival to its tracks, in milliseconds.
    pub latency: f32,
}

/// Id, state, confidence and response of a target; thresholds of the response: certain, lost and found.
type Figures = (Arc<str>, State, f32, f32, Option<[f32; 3]>);

/// The figures of one frame.
#[derive(Clone, Debug)]
pub(super) struct Sample {
    /// When it was taken: milliseconds since the start.
    at: u64,
    skipped: u32,
    latency: f32,
    /// Of the first targets.
    targets: Box<[Figures]>,
}

impl Sample {
    pub(super) fn new(at: u64, said: &Said) -> Self {
        let figures = |t: &Target| -> Figures {
            let thresholds = said.thresholds.of(&t.id).map(|t| [t.certain, t.lost, t.found].map(|value| value as f32));
            (t.id.clone(), t.state, t.confidence, t.response, thresholds)
        };
        let targets = said.targets.iter().take(MOST_TARGETS).map(figures).collect();
        Self { at, skipped: said.skipped, latency: said.latency, targets }
    }
}

/// `[at, skipped, latency, [[id, state, confidence, response, [certain, lost, found]], ...]]`
impl Serialize for Sample {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self { at, skipped, latency, targets } = self;
        let targets: Vec<_> = targets.iter().map(|(id, state, c, r, t)| (&**id, *state as u8, *c, *r, *t)).collect();
        (at, skipped, latency, targets).serialize(serializer)
    }
}

/// Something that a user should know of.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A target was taken up.
    Marked {
        /// Its id.
        id: String,
        /// Where it was marked.
        rect: Rect,
    },
    /// A mark was not obeyed.
    Refused {
        /// Where it was.
        rect: Rect,
        /// The reason.
        why: String,
    },
    /// A target was lost, or found again.
    Changed {
        /// Its id.
        id: String,
        /// Where it was.
        rect: Rect,
        /// Lost, or what it is now.
        state: State,
    },
    /// A target is followed no longer, or none is.
    Stopped(Option<String>),
    /// A target is called otherwise.
    Renamed {
        /// Its name until now.
        id: String,
        /// Its name from now on.
        to: String,
    },
    /// A parameter has another value.
    Set {
        /// The parameter.
        name: String,
        /// Its value.
        value: String,
    },
}

/// An event with its time and, of a moment that was seen, its picture.
#[derive(Clone, Debug)]
pub(super) struct Happened {
    pub(super) at: u64,
    pub(super) stamp: Stamp,
    pub(super) event: Event,
    /// JPEG.
    pub(super) picture: Option<Vec<u8>>,
}

#[derive(Serialize)]
struct Row<'a> {
    at: u64,
    kind: &'static str,
    id: Option<&'a str>,
    rect: Option<[f64; 4]>,
    text: Option<&'a str>,
    stamp: Option<String>,
    picture: Option<String>,
}

impl Serialize for Happened {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let sides = |r: &Rect| Some([r.x, r.y, r.w, r.h]);
        let (kind, id, rect, text) = match &self.event {
            Event::Marked { id, rect } => ("marked", Some(id), sides(rect), None),
            Event::Refused { rect, why } => ("refused", None, sides(rect), Some(why.as_str())),
            Event::Changed { id, rect, state: State::Lost } => ("lost", Some(id), sides(rect), None),
            Event::Changed { id, rect, .. } => ("found", Some(id), sides(rect), None),
            Event::Stopped(id) => ("stopped", id.as_ref(), None, None),
            Event::Renamed { id, to } => ("renamed", Some(id), None, Some(to.as_str())),
            Event::Set { name, value } => ("set", Some(name), None, Some(value.as_str())),
        };
        let row = Row {
            at: self.at,
            kind,
            id: id.map(String::as_str),
            rect,
            text,
            stamp: self.stamp.map(|stamp| stamp.to_string()),
            picture: self.picture.as_ref().map(|jpeg| STANDARD.encode(jpeg)),
        };
        row.serialize(serializer)
    }
}

/// The health of one part of the tracker.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Part {
    /// What it is called.
    pub name: String,
    /// 0 where all is well, 1 for a warning, 2 for an error.
    pub level: u8,
    /// How it is, in a line.
    pub message: String,
    /// Names and values.
    pub values: Vec<(String, String)>,
}
