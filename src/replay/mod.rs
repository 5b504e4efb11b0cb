//! Recorded frames: where they come from, one at a time, and the boxes that were marked on them.
//!
//! A [`FrameSource`] gives owned frames in order, from a [`folder`] or a [`bag`]; [`open`] finds the right one for a
//! path. What reads frames knows nothing of trackers, and a tracker nothing of files.

pub mod bag;
pub mod folder;
mod order;
mod other;
pub mod truth;

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use self::bag::{BagError, Picture};
use self::other::Other;
use self::truth::BoxError;
use crate::decode::DecodeError;
pub use crate::frame::FrameBuffer;
use crate::messages::Header;
use crate::params::Limits;

/// Why recorded frames or boxes cannot be read. Each message names the file.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum ReplayError {
    /// There is nothing at the path.
    #[error("{}: no such file or folder", .0.display())]
    Missing(PathBuf),
    /// The path holds something that frames cannot be read from.
    #[error("{}: {advice}", path.display())]
    Unsupported { path: PathBuf, advice: String },
    /// A topic was named where there are none.
    #[error("{}: a folder of images has no topic '{topic}'", path.display())]
    NoTopics { path: PathBuf, topic: String },
    /// A folder without a single image, and what there is instead.
    #[error("{}: {advice}", path.display())]
    NoImages { path: PathBuf, advice: String },
    /// The file system refuses.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    /// The file is no image that can be tracked on.
    #[error("{}: {source}", path.display())]
    Decode { path: PathBuf, source: DecodeError },
    /// The bag, or a message in it.
    #[error(transparent)]
    Bag(#[from] BagError),
    /// A row of a file of boxes that is none.
    #[error("{}, line {line}: '{text}' is not a box: {source}", path.display())]
    Box { path: PathBuf, line: usize, text: String, source: BoxError },
}

/// Frames in the order in which they were taken.
pub trait FrameSource: Send {
    /// The next frame, `None` after the last. After an error the source stands behind what it could not read.
    fn next_frame(&mut self) -> Result<Option<FrameBuffer>, ReplayError>;

    /// Passes over the next frame, which need not be looked at; `false` after the last.
    fn skip_frame(&mut self) -> Result<bool, ReplayError> {
        Ok(self.next_frame()?.is_some())
    }

    /// What the last frame was read from, so that it can be passed on as it was.
    fn origin(&self) -> Origin<'_>;

    /// How many frames are still to come, where that is known.
    fn remaining(&self) -> Option<usize>;

    /// Where a file of boxes for these frames may lie, first choice first.
    fn truth_candidates(&self) -> Vec<PathBuf>;

    /// What a user should know of how the source is read, a line each: what was chosen, mended or passed over.
    fn notes(&self) -> &[String] {
        &[]
    }
}

/// What a frame was read from.
#[derive(Clone, Copy, Debug)]
#[expect(missing_docs, reason = "its doc names the fields")]
pub enum Origin<'a> {
    /// The bytes of an image file.
    File(&'a [u8]),
    /// A message of a bag: its topic and type, when it was recorded (nanoseconds), and its bytes, header included.
    Message { topic: &'a str, picture: Picture, log_time: u64, header: &'a Header, bytes: &'a [u8] },
}

/// The frames at `path`: a folder of images, or one that has them in `img/`; or those of a topic of a bag, which may be
/// left out where there is but one with images. The `metadata.yaml` of a bag stands for its folder. What is read
/// and made of it is bounded by the limits.
pub fn open(path: &Path, topic: Option<&str>, limits: &Limits) -> Result<Box<dyn FrameSource>, ReplayError> {
    let kind = std::fs::metadata(path).map_err(|source| match source.kind() {
        ErrorKind::NotFound => ReplayError::Missing(path.to_owned()),
        _ => ReplayError::Io { path: path.to_owned(), source },
    })?;
    if kind.is_file() && path.ends_with(bag::metadata::FILE_NAME) {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        return open(folder.unwrap_or(Path::new(".")), topic, limits);
    }
    if bag::is_bag(path)? {
        return Ok(Box::new(bag::Bag::open(path, topic, limits)?));
    }
    if !kind.is_dir() {
        let other = Other::of(path).map_err(|source| ReplayError::Io { path: path.to_owned(), source })?;
        return Err(ReplayError::Unsupported { path: path.to_owned(), advice: other.advice(path) });
    }
    match topic {
        None => Ok(Box::new(folder::Folder::open(path, limits)?)),
        Some(topic) => Err(ReplayError::NoTopics { path: path.to_owned(), topic: topic.to_owned() }),
    }
}
