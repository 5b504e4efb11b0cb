//! What the offline commands do: their arguments, their runs, their messages and exit codes. A binary only parses,
//! runs and exits.

pub mod evaluate;
pub mod rows;
pub mod timing;
pub mod track;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use indicatif::{ProgressBar, ProgressStyle};

use crate::error::{ParamsError, StartError};
use crate::eval::dataset::DatasetError;
use crate::params::{Assignment, NodeName, Params, Phase, Value, file};
use crate::replay::ReplayError;

/// Why a command did not do what it was asked for.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A parameter, or a file of them.
    #[error(transparent)]
    Params(#[from] ParamsError),
    /// Where there ought to be frames are none.
    #[error(transparent)]
    Source(ReplayError),
    /// The file of marked boxes cannot be used.
    #[error(transparent)]
    Truth(ReplayError),
    /// Nothing tells where the target is.
    #[error("no target: give --init X,Y,W,H, for there is no {} with a box in its first row", .0.display())]
    NoTarget(PathBuf),
    /// The target cannot be followed.
    #[error("{from}: {source}")]
    Start { from: String, source: StartError },
    /// A file or folder for results cannot be made.
    #[error("{}: cannot be written: {source}", path.display())]
    Create { path: PathBuf, source: std::io::Error },
    /// The dataset cannot be used.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// A frame cannot be read.
    #[error(transparent)]
    Read(ReplayError),
    /// A result cannot be written.
    #[error("{to}: cannot be written: {why}")]
    Write { to: String, why: String },
    /// Not every sequence was run to its end; each was reported.
    #[error("{failed} of {runs} runs failed")]
    Sequences { failed: usize, runs: usize },
}

impl Error {
    /// 2 for arguments that cannot be used, known before the first frame is tracked; 1 for what fails later.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Read(_) | Self::Write { .. } | Self::Sequences { .. } => 1,
            _ => 2,
        }
    }
}

/// Says on standard error why a command failed; the code to exit with.
pub fn exit(result: Result<(), Error>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

/// The default parameters with the changes of the files in order, then the algorithm, then single values: what
/// comes later wins.
pub fn params(files: &[impl AsRef<Path>], algorithm: Option<&str>, set: &[Assignment]) -> Result<Params, ParamsError> {
    let node = NodeName::default();
    let mut changes = Vec::new();
    for path in files {
        let path = path.as_ref();
        let read = file(path, &node)?;
        if read.is_empty() {
            log::warn!("parameter file {}: nothing in it is for {}", path.display(), node.full());
        }
        changes.extend(read);
    }
    changes.extend(algorithm.map(|name| ("algorithm".to_owned(), Value::String(name.to_owned()))));
    changes.extend_from_slice(set);
    Params::default().with(changes.iter().map(|(name, value)| (name.as_str(), value)), Phase::StartUp)
}

/// A bar on standard error for so many frames; nothing where that is no terminal.
fn progress(frames: Option<usize>) -> ProgressBar {
    let bar = frames.map_or_else(ProgressBar::new_spinner, |n| ProgressBar::new(n as u64));
    match ProgressStyle::with_template("{wide_bar} {pos}/{len} frames, {per_sec}, {eta} left") {
        Ok(style) if frames.is_some() => bar.with_style(style),
        _ => bar,
    }
}
