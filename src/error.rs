//! The errors of the core. Each variant carries the values that a reader of the message needs.
//!
//! Losing the target is no error: it is [`State::Lost`](crate::State::Lost).

mod yaml;

use std::path::PathBuf;

pub use yaml::{NameError, YamlError};
use yaml_events::Place;

use crate::geometry::Rect;

/// Why the bytes of an image cannot be taken as a [`Frame`](crate::Frame).
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum FrameError {
    /// An image without pixels.
    #[error("image of {width} x {height} has no pixels")]
    Empty { width: u32, height: u32 },
    /// A side that no camera has: the guard against corrupt headers.
    #[error("image of {width} x {height} is larger than {limit} on a side")]
    TooLarge { width: u32, height: u32, limit: u32 },
    /// The name of the encoding is not known.
    #[error("encoding '{name}' is not supported; supported are {}", known.join(", "))]
    Encoding { name: String, known: Vec<&'static str> },
    /// The sides are no multiples of what the encoding puts together.
    #[error("image of {width} x {height} cannot be {encoding}: its sides must be multiples of {columns} and {rows}")]
    Block { width: u32, height: u32, encoding: &'static str, columns: u32, rows: u32 },
    /// A row is shorter than its pixels.
    #[error("step of {step} bytes is shorter than a row of {width} {encoding} pixels ({row} bytes)")]
    Step { step: usize, width: u32, encoding: &'static str, row: usize },
    /// The buffer ends before the last row does.
    #[error("data of {len} bytes is shorter than {height} rows of {step} bytes (at least {needed})")]
    Data { len: usize, height: u32, step: usize, needed: usize },
}

/// Why a marked box cannot be followed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum StartError {
    /// A coordinate is NaN or infinite.
    #[error("box {0} is not finite")]
    NotFinite(Rect),
    /// A side is too short to hold features.
    #[error("box {rect} is too small: each side must be at least {min} px")]
    TooSmall { rect: Rect, min: f64 },
    /// Too long and thin for a search window around it.
    #[error("box {rect} is too thin: its longer side is {ratio:.1} x the shorter, at most {max} is allowed")]
    TooThin { rect: Rect, ratio: f64, max: f64 },
    /// Larger than the image.
    #[error("box {rect} is larger than the image of {width} x {height}")]
    TooLarge { rect: Rect, width: u32, height: u32 },
    /// Too little of it is in view.
    #[error(
        "box {rect} lies outside the image of {width} x {height}: {visible:.0} % of it is in view, at least {min:.0} % \
         must be"
    )]
    Outside { rect: Rect, width: u32, height: u32, visible: f64, min: f64 },
    /// There is nothing in and around it that would tell it from other places.
    #[error(
        "box {rect} shows nothing to follow: the image in and around it varies by {contrast:.1} of 255 levels, \
         at least {min} are needed"
    )]
    Blank { rect: Rect, contrast: f64, min: f64 },
    /// As many targets are followed as may be.
    #[error("{most} targets are already followed, and max_targets is {most}")]
    Full { most: usize },
    /// There is nothing to start again from.
    #[error("no target has been marked yet")]
    NoMark,
}

/// Why a target keeps its name.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RenameError {
    /// There is none of this name.
    #[error("there is no target {0}")]
    NoTarget(String),
    /// Another has the name.
    #[error("another target is already called {0}")]
    Taken(String),
}

/// Why a set of parameters was refused. The set in force stays as it was.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum ParamsError {
    /// No parameter bears that name.
    #[error("unknown parameter '{name}'{hint}")]
    Unknown { name: String, hint: String },
    /// The value is of another type.
    #[error("parameter '{name}' is of type {expected}, got {got}")]
    Type { name: String, expected: &'static str, got: String },
    /// The number lies outside the range.
    #[error("parameter '{name}' must be from {range}, got {got}")]
    Range { name: String, range: String, got: String },
    /// The string is none of the choices.
    #[error("parameter '{name}' must be one of {choices}, got '{got}'")]
    Choice { name: String, choices: String, got: String },
    /// The string or list is longer than any that makes sense.
    #[error("parameter '{name}' may hold at most {most} characters or values, got {len}")]
    Long { name: String, len: usize, most: usize },
    /// More changes than make sense.
    #[error("{len} parameters at once are too many, at most {most} are accepted")]
    Many { len: usize, most: usize },
    /// The parameter is fixed once the program runs.
    #[error("parameter '{name}' is read-only while the program runs")]
    ReadOnly { name: String },
    /// Each value is right by itself, but not together.
    #[error("parameters do not fit together: {0}")]
    Conflict(String),
    /// The network that they name cannot be used.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// `NAME:=VALUE` without the `:=`, or with a value that is no YAML.
    #[error("'{text}' is not a parameter assignment: {source}")]
    Assignment { text: String, source: YamlError },
    /// What should be a preset's name is none.
    #[error("'{name}' is neither a file nor a preset; presets are {known}")]
    Preset { name: String, known: String },
    /// A parameter file that cannot be read or understood.
    #[error("parameter file {}: {source}", path.display())]
    File { path: PathBuf, source: YamlError },
    /// What a parameter file says, at `place` where one is known, is refused.
    #[error("parameter file {}: {}{source}", path.display(), at(*place))]
    InFile { path: PathBuf, place: Option<Place>, source: Box<Self> },
}

/// `PLACE: `; nothing where none is known.
fn at(place: Option<Place>) -> String {
    place.map(|place| format!("{place}: ")).unwrap_or_default()
}

/// Why a network cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum NetworkError {
    /// The file cannot be read.
    #[error("network {file} cannot be read: {why}")]
    Unreadable { file: String, why: String },
    /// The file is larger than may be.
    #[error("network {file} has {len} bytes, limits.file_mb allows {most}")]
    TooLarge { file: String, len: u64, most: u64 },
    /// It is no network, or one that cannot be run.
    #[error("network {file} cannot be run, expected an ONNX network that takes an image: {why}")]
    Format { file: String, why: String },
    /// It takes something else than one image of the size that the parameters say.
    #[error("network {file} takes {got}, expected one image of 1 x 3 x {side} x {side}")]
    Input { file: String, got: String, side: usize },
    /// It lacks an output that the parameters name.
    #[error("network {file} has no output '{name}', expected one of {known}")]
    Output { file: String, name: String, known: String },
    /// It computes no numbers.
    #[error("network {file} gives non-finite values at output '{name}', expected weights without NaN")]
    NotFinite { file: String, name: String },
    /// A file is needed and not named.
    #[error("lcmht.matching.enabled needs a network file, got none in {parameter}: see docs/matching.md")]
    Unnamed { parameter: String },
    /// It is no backbone or head of a pair that finds a template in a window.
    #[error("network {file} cannot be used for matching: {why}")]
    Matching { file: String, why: String },
    /// ONNX Runtime was asked for and is not to be had.
    #[error("ONNX Runtime cannot be used: {why}")]
    Runtime { why: String },
}
