//! Recorded frames: where they come from, one at a time, and the boxes that were marked on them.
//!
//! A [`FrameSource`] gives owned frames in order; [`open`] finds the right one for a path. What reads frames knows
//! nothing of trackers, and a tracker nothing of files.

pub mod folder;
pub mod truth;

use std::path::{Path, PathBuf};

use crate::error::FrameError;
use crate::frame::{Encoding, Frame, Stamp};

/// Why recorded frames or boxes cannot be read. Each message names the file.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// There is nothing at the path.
    #[error("{}: no such file or folder", .0.display())]
    Missing(PathBuf),
    /// The path holds something that frames cannot be read from.
    #[error("{}: no folder of images", .0.display())]
    Unsupported(PathBuf),
    /// A folder without a single image.
    #[error("{}: no images ({known}) in the folder", path.display(), known = folder::EXTENSIONS.join(", "))]
    NoImages { path: PathBuf },
    /// The file system refuses.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    /// The file is no image, or a broken one.
    #[error("{}: cannot be decoded: {why}", path.display())]
    Decode { path: PathBuf, why: String },
    /// The image was decoded but cannot be tracked on.
    #[error("{}: {source}", path.display())]
    Frame { path: PathBuf, source: FrameError },
    /// A row of a file of boxes that is none.
    #[error("{}, line {line}: '{text}' is no box: {why}", path.display())]
    Box { path: PathBuf, line: usize, text: String, why: String },
}

/// An image that owns its bytes. Its layout has been checked.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameBuffer {
    data: Vec<u8>,
    width: u32,
    height: u32,
    step: usize,
    encoding: Encoding,
    stamp: Stamp,
}

impl FrameBuffer {
    /// Takes the bytes; the layout is as in [`Frame::new`], and so are the errors.
    pub fn new(
        data: Vec<u8>,
        width: u32,
        height: u32,
        step: usize,
        encoding: Encoding,
        stamp: Stamp,
    ) -> Result<Self, FrameError> {
        Frame::new(&data, width, height, step, encoding, stamp)?;
        Ok(Self { data, width, height, step, encoding, stamp })
    }

    /// The image, borrowed.
    pub fn frame(&self) -> Frame<'_> {
        Frame::new(&self.data, self.width, self.height, self.step, self.encoding, self.stamp)
            .expect("the layout was checked when the buffer was made")
    }
}

/// Frames in the order in which they were taken.
pub trait FrameSource: Send {
    /// The next frame, `None` after the last. After an error the source stands behind what it could not read.
    fn next_frame(&mut self) -> Result<Option<FrameBuffer>, ReplayError>;

    /// How many frames are still to come, where that is known.
    fn remaining(&self) -> Option<usize>;

    /// Where a file of boxes for these frames may lie, first choice first.
    fn truth_candidates(&self) -> Vec<PathBuf>;
}

/// The frames at `path`: a folder of images, or one that has them in `img/`.
pub fn open(path: &Path) -> Result<Box<dyn FrameSource>, ReplayError> {
    if path.is_dir() {
        Ok(Box::new(folder::Folder::open(path)?))
    } else if path.exists() {
        Err(ReplayError::Unsupported(path.to_owned()))
    } else {
        Err(ReplayError::Missing(path.to_owned()))
    }
}
