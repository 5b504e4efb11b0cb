//! What the offline commands do: their arguments, their runs, their messages and exit codes. A binary only parses,
//! runs and exits.

pub mod evaluate;
pub mod fleet;
pub mod following;
#[cfg(feature = "viewer")]
pub mod player;
pub mod rows;
pub mod summary;
pub mod timing;
pub mod track;
#[cfg(feature = "viewer")]
pub mod view;

use std::fmt::Display;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Arg, ArgAction, Parser};
use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};

use crate::error::{NetworkError, ParamsError, StartError};
use crate::eval::dataset::DatasetError;
use crate::eval::page::PageError;
use crate::eval::peers::PeerError;
use crate::eval::worlds::WorldsError;
use crate::params::{Assignment, NodeName, Params, Phase, Value, preset_list, preset_or_file};
use crate::record::RecordError;
use crate::replay::ReplayError;
use crate::viewer::ListenError;

/// Why a command did not do what it was asked for.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum Error {
    /// A parameter, or a file of them.
    #[error(transparent)]
    Params(#[from] ParamsError),
    /// The network that the parameters name cannot be used.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// Where there ought to be frames are none.
    #[error(transparent)]
    Source(ReplayError),
    /// The file of marked boxes cannot be used.
    #[error(transparent)]
    Truth(ReplayError),
    /// Nothing tells where the target is.
    #[error("no target: give --init X,Y,W,H; there is no {} with a box in its first row", .0.display())]
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
    /// The boxes of another tracker cannot be used.
    #[error(transparent)]
    Peer(#[from] PeerError),
    /// The worlds of the sequences cannot be read.
    #[error(transparent)]
    Worlds(#[from] WorldsError),
    /// The report cannot be made.
    #[error(transparent)]
    Page(#[from] PageError),
    /// Nothing is left to score.
    #[error("nothing to score: --peers-only needs --peer NAME=DIR")]
    NoSetup,
    /// A frame cannot be read.
    #[error(transparent)]
    Read(ReplayError),
    /// A result cannot be written.
    #[error("{to}: cannot be written: {why}")]
    Write { to: String, why: String },
    /// The live page cannot be served.
    #[error(transparent)]
    Viewer(ListenError),
    /// Several recordings, and nowhere for the rows of each.
    #[error("{0} recordings: give --out DIR, a folder for the rows of each")]
    NeedsFolder(usize),
    /// The path of a recording ends in no name.
    #[error("{}: it has no name to file its rows under", .0.display())]
    NoName(PathBuf),
    /// Nothing tells where the target of a recording is.
    #[error("no target: no row '{name}' in {}, nor {} with a box in its first row", marks.display(), truth.display())]
    NoMark { name: String, marks: PathBuf, truth: PathBuf },
    /// The rows of two recordings would go to the same file.
    #[error("{} and {} have the same name '{name}' for their rows", first.display(), second.display())]
    SameName { name: String, first: PathBuf, second: PathBuf },
    /// The folder holds the rows of another set of parameters.
    #[error("{}: the rows there were made with {name} = {there}, not {now}; choose another --out", path.display())]
    OtherParameters { path: PathBuf, name: String, there: String, now: String },
    /// What stands where the rows of a recording belong is something else.
    #[error("{}, line {line}: '{text}' is not a row of track; move the file away", path.display())]
    NotRows { path: PathBuf, line: usize, text: String },
    /// Not every recording was tracked to its end; each was reported.
    #[error("{failed} of {recordings} recordings failed")]
    Recordings { failed: usize, recordings: usize },
    /// Not every sequence was run to its end; each was reported.
    #[error("{failed} of {runs} runs failed")]
    Sequences { failed: usize, runs: usize },
}

impl From<RecordError> for Error {
    fn from(error: RecordError) -> Self {
        match error {
            RecordError::Create { path, source } => Self::Create { path, source },
            RecordError::Write { path, why } => Self::Write { to: path.display().to_string(), why },
        }
    }
}

impl Error {
    /// 2 for arguments that cannot be used, known before the first frame is tracked; 1 for what fails later.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Read(_) | Self::Write { .. } | Self::Page(_) => 1,
            Self::Recordings { .. } | Self::Sequences { .. } => 1,
            _ => 2,
        }
    }
}

/// The arguments of the process. `--list-presets` is answered at once, as `--help` is.
pub fn arguments<A: Parser>() -> A {
    const LIST: &str = "list-presets";
    let list = Arg::new(LIST).long(LIST).exclusive(true).action(ArgAction::SetTrue);
    let matches = A::command().arg(list.help("Lists the presets that --params knows")).get_matches();
    if matches.get_flag(LIST) {
        // A closed pipe is a reader who has seen enough.
        let _ = io::stdout().write_all(preset_list().as_bytes());
        std::process::exit(0);
    }
    A::from_arg_matches(&matches).unwrap_or_else(|error| error.exit())
}

/// Says on standard error why a command failed; the code to exit with.
pub fn exit(result: Result<(), Error>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            tell(format_args!("error: {error}"));
            ExitCode::from(error.exit_code())
        }
    }
}

/// Writes a line to standard error. Where that cannot be written to, nobody is there to be told.
pub fn tell(line: impl Display) {
    let _ = writeln!(io::stderr(), "{line}");
}

/// The default parameters with the changes of the presets and files in order, then the algorithm, then single values:
/// what comes later wins.
pub fn params(files: &[impl AsRef<Path>], algorithm: Option<&str>, set: &[Assignment]) -> Result<Params, ParamsError> {
    let node = NodeName::default();
    let mut changes = Vec::new();
    for path in files.iter().map(AsRef::as_ref) {
        let read = preset_or_file(path, &node)?;
        if read.is_empty() {
            log::warn!("parameter file {}: it holds nothing for {}", path.display(), node.full());
        }
        // By itself first, so that the message can name the file.
        match changed(&read) {
            Ok(_) | Err(ParamsError::Conflict(_)) => {}
            Err(error) => {
                return Err(ParamsError::InFile { path: path.to_owned(), place: None, source: Box::new(error) });
            }
        }
        changes.extend(read);
    }
    changes.extend(algorithm.map(|name| ("algorithm".to_owned(), Value::String(name.to_owned()))));
    changes.extend_from_slice(set);
    changed(&changes)
}

fn changed(changes: &[Assignment]) -> Result<Params, ParamsError> {
    Params::default().with(changes.iter().map(|(name, value)| (name.as_str(), value)), Phase::StartUp)
}

/// A bar on standard error for so many frames; nothing where that is no terminal.
fn progress(frames: Option<usize>) -> ProgressBar {
    let bar = frames.map_or_else(ProgressBar::new_spinner, |n| ProgressBar::new(n as u64));
    let bar = bar.with_finish(ProgressFinish::AndClear);
    match ProgressStyle::with_template("{wide_bar} {pos}/{len} frames, {per_sec}, {eta} left") {
        Ok(style) if frames.is_some() => bar.with_style(style),
        _ => bar,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn later_files_win_over_earlier_ones_and_single_values_over_all() {
        let dir = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = dir.path().join(name);
            std::fs::write(&path, format!("/**:\n  ros__parameters:\n    {text}\n")).unwrap();
            path
        };
        let a = write("a.yaml", "{seed: 1, debug.max_side: 100, debug.jpeg_quality: 10}");
        let b = write("b.yaml", "{seed: 2, debug.max_side: 200}");
        let set = [("seed".to_owned(), Value::Integer(3))];
        let both = params(&[&a, &b], Some("lcmht"), &set).unwrap();
        assert_eq!((both.general.seed, both.debug.max_side, both.debug.jpeg_quality), (3, 200, 10));
        assert_eq!(params(&[&b, &a], None, &[]).unwrap().general.seed, 1);
        assert_eq!(params(&[] as &[&Path], None, &[]).unwrap(), Params::default());
    }

    #[test]
    fn a_wrong_value_is_named_with_its_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.yaml");
        std::fs::write(&path, "/**:\n  ros__parameters: {debug.max_side: 3}\n").unwrap();
        let message = params(&[&path], None, &[]).unwrap_err().to_string();
        let why = "parameter 'debug.max_side' must be from 16 to 4096, got 3";
        assert_eq!(message, format!("parameter file {}: {why}", path.display()));
    }
}
