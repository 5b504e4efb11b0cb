//! What happened in the last minutes: figures of each frame, events, and the health of the parts.

use std::sync::Arc;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde::ser::SerializeTuple;
use serde::{Serialize, Serializer};

use crate::frame::Stamp;
use crate::geometry::Rect;
use crate::tracker::{State, Target};

/// Targets of which a sample keeps figures.
const MOST_TARGETS: usize = 8;

/// Id, state, confidence and response of a target.
type Figures = (Arc<str>, State, f32, f32);

/// The figures of one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Frames that were skipped before it.
    pub skipped: u32,
    /// From its arrival to its tracks, in milliseconds.
    pub latency: f32,
    /// Of the first targets.
    targets: Box<[Figures]>,
}

impl Sample {
    /// Of a frame with these targets.
    pub fn new(targets: &[Target], skipped: u32, latency: f32) -> Self {
        let figures = |t: &Target| -> Figures { (t.id.clone(), t.state, t.confidence, t.response) };
        Self { skipped, latency, targets: targets.iter().take(MOST_TARGETS).map(figures).collect() }
    }
}

/// A sample and when it was taken: milliseconds since the start.
#[derive(Clone, Debug)]
pub(super) struct Timed {
    pub(super) at: u64,
    pub(super) sample: Sample,
}

/// `[at, skipped, latency, [[id, state, confidence, response], ...]]`
impl Serialize for Timed {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Sample { skipped, latency, targets } = &self.sample;
        let targets: Vec<_> = targets.iter().map(|(id, state, c, r)| (&**id, *state as u8, *c, *r)).collect();
        let mut tuple = serializer.serialize_tuple(4)?;
        tuple.serialize_element(&self.at)?;
        tuple.serialize_element(skipped)?;
        tuple.serialize_element(latency)?;
        tuple.serialize_element(&targets)?;
        tuple.end()
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
