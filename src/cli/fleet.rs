//! `track --out`: many recordings at once, each with its own file of rows.
//!
//! A recording is finished when its file of rows is there. Rows are written to a temporary file, which gets the name
//! when it is whole, so a run that ends early leaves nothing that counts, and the next one goes on.

use std::fs;
use std::io::{self, BufWriter, Write};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};
use tempfile::NamedTempFile;

use super::following::{Following, Mark};
use super::rows::Rows;
use super::summary::{self, Entry, Outcome, Summary};
use super::timing::per_second;
use super::{Error, tell};
use crate::geometry::Rect;
use crate::loader::Loaded;
use crate::params::{self, NodeName, Params, Phase};
use crate::replay::{self, truth};
use crate::session::Session;

/// The parameters that the rows of a folder were made with.
const PARAMETERS_FILE: &str = "parameters.yaml";
/// What the names of unfinished files begin with.
const PARTIAL: &str = ".partial-";
/// Permissions of a new file, of which the umask takes its part.
const MODE: u32 = 0o666;

/// Recordings, and where their rows go.
#[derive(Debug)]
pub struct Fleet<'a> {
    /// Folders of images and bags.
    pub sources: &'a [PathBuf],
    /// The image topic of bags.
    pub topic: Option<&'a str>,
    /// The box in the first frame of every recording.
    pub init: Option<Rect>,
    /// The file of the boxes in the first frame of each.
    pub marks: Option<&'a Path>,
    /// The folder of rows.
    pub out: &'a Path,
    /// Recordings at once; `None` is the number of cores.
    pub threads: Option<NonZeroUsize>,
}

/// A recording and its file of rows.
struct Job<'a> {
    source: &'a Path,
    name: String,
    rows: PathBuf,
    /// From the command line or a file of marks.
    mark: Option<Mark>,
}

/// Tracks what is not finished, and writes the summary of all.
pub fn run(fleet: &Fleet, params: &Params) -> Result<(), Error> {
    let (jobs, outcomes) = begin(fleet, params)?;
    let pending: Vec<usize> = (0..jobs.len()).filter(|&i| outcomes[i].is_none()).collect();
    let skipped = outcomes.iter().flatten().filter(|outcome| !outcome.is_failure()).count();
    let threads = fleet.threads.or_else(|| std::thread::available_parallelism().ok()).map_or(1, NonZeroUsize::get);
    // Networks are loaded once per thread, and before anything is tracked.
    let threads = 0..threads.min(pending.len());
    let threads = threads.map(|_| Loaded::new(params)).collect::<Result<Vec<_>, _>>()?;

    let (begun, bar) = (Instant::now(), progress(pending.len()));
    let (next, frames) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let outcomes = Mutex::new(outcomes);
    std::thread::scope(|scope| {
        for loaded in &threads {
            scope.spawn(|| {
                while let Some(&i) = pending.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let outcome = match track(&jobs[i], fleet, params, loaded) {
                        Ok((outcome, count)) => {
                            frames.fetch_add(count, Ordering::Relaxed);
                            outcome
                        }
                        Err(error) => {
                            bar.suspend(|| tell(format_args!("error: {}: {error}", jobs[i].name)));
                            Outcome::Failed { error: error.to_string() }
                        }
                    };
                    outcomes.lock().unwrap_or_else(|e| e.into_inner())[i] = Some(outcome);
                    bar.inc(1);
                }
            });
        }
    });
    bar.finish_and_clear();

    let outcomes = outcomes.into_inner().unwrap_or_else(|e| e.into_inner());
    let entry = |(job, outcome): (&Job, Option<Outcome>)| Entry {
        name: job.name.clone(),
        source: job.source.display().to_string(),
        outcome: outcome.unwrap_or_else(|| Outcome::Failed { error: "it was not reached".to_owned() }),
    };
    let summary = Summary::new(jobs.iter().zip(outcomes).map(entry).collect());
    write_whole(&fleet.out.join(summary::FILE_NAME), &summary.json())?;
    let frames = frames.into_inner();
    let rate = per_second(frames, begun.elapsed());
    tell(format_args!(
        "{} recordings: {} finished, of which {skipped} before, {} failed; {frames} frames, {rate:.1} frames/s",
        jobs.len(),
        summary.finished,
        summary.failed
    ));
    match summary.failed {
        0 => Ok(()),
        failed => Err(Error::Recordings { failed, recordings: jobs.len() }),
    }
}

/// Prints the recordings that are not finished, a line each.
pub fn print_pending(fleet: &Fleet, params: &Params) -> Result<(), Error> {
    let (jobs, outcomes) = begin(fleet, params)?;
    let pending = jobs.iter().zip(&outcomes).filter(|(_, outcome)| outcome.is_none());
    let lines: String = pending.map(|(job, _)| format!("{}\n", job.source.display())).collect();
    let printed = io::stdout().write_all(lines.as_bytes());
    printed.map_err(|e| Error::Write { to: "standard output".to_owned(), why: e.to_string() })
}

/// The recordings, and what came of those that are finished, or cannot be. From here on, all rows in the folder are
/// those of these parameters.
fn begin<'a>(fleet: &Fleet<'a>, params: &Params) -> Result<(Vec<Job<'a>>, Vec<Option<Outcome>>), Error> {
    let jobs = jobs(fleet)?;
    fs::create_dir_all(fleet.out).map_err(|source| Error::Create { path: fleet.out.to_owned(), source })?;
    settle(fleet.out, params)?;
    let outcomes = jobs.iter().map(|job| finished(job, params)).collect();
    Ok((jobs, outcomes))
}

fn jobs<'a>(fleet: &Fleet<'a>) -> Result<Vec<Job<'a>>, Error> {
    let mut marks = fleet.marks.map(truth::read_named).transpose().map_err(Error::Truth)?.unwrap_or_default();
    let mut jobs: Vec<Job> = Vec::with_capacity(fleet.sources.len());
    for source in fleet.sources {
        let name = name(source).ok_or_else(|| Error::NoName(source.clone()))?;
        if let Some(other) = jobs.iter().find(|job| job.name == name) {
            let first = other.source.to_owned();
            return Err(Error::SameName { name, first, second: source.clone() });
        }
        let marked = marks.remove(&name).zip(fleet.marks).map(|(rect, file)| (rect, file.display().to_string()));
        let mark = fleet.init.map(|rect| (rect, "--init".to_owned())).or(marked);
        let rows = fleet.out.join(format!("{name}.csv"));
        jobs.push(Job { source, name, rows, mark: mark.map(|(rect, from)| Mark { rect, from }) });
    }
    Ok(jobs)
}

/// What a recording is called: the name of its file or folder.
fn name(source: &Path) -> Option<String> {
    let name = |path: &Path| path.file_name().map(|name| name.to_string_lossy().into_owned());
    name(source).or_else(|| name(&source.canonicalize().ok()?))
}

/// Notes the parameters that the rows of the folder are made with; or finds that those there were made with others.
fn settle(folder: &Path, params: &Params) -> Result<(), Error> {
    let path = folder.join(PARAMETERS_FILE);
    if !path.exists() {
        return write_whole(&path, &params::preset(params, "The parameters of the rows in this folder."));
    }
    let changes = params::file(&path, &NodeName::default())?;
    let changes = changes.iter().map(|(name, value)| (name.as_str(), value));
    let there = Params::default().with(changes, Phase::StartUp)?;
    let differs = params::descriptors().iter().find(|d| there.get(d.name) != params.get(d.name));
    let Some(name) = differs.map(|d| d.name) else { return Ok(()) };
    let [there, now] = [&there, params].map(|set| set.get(name).map_or(String::new(), |value| value.to_string()));
    Err(Error::OtherParameters { path, name: name.to_owned(), there, now })
}

/// What came of a recording in an earlier run. `None` if it is to be tracked: it has no rows, or those of another mark.
fn finished(job: &Job, params: &Params) -> Option<Outcome> {
    if !job.rows.exists() {
        return None;
    }
    match summary::read(&job.rows, params.general.algorithm) {
        Ok((_, Some(first))) if job.mark.as_ref().is_some_and(|mark| mark.rect != first) => {
            log::warn!("{}: its mark is not {first} any more, so it is tracked again", job.name);
            None
        }
        Ok((outcome, _)) => Some(outcome),
        Err(error) => {
            tell(format_args!("error: {}: {error}", job.name));
            Some(Outcome::Failed { error: error.to_string() })
        }
    }
}

/// Tracks a recording and files its rows; what came of it, and the number of frames.
fn track(job: &Job, fleet: &Fleet, params: &Params, loaded: &Loaded) -> Result<(Outcome, usize), Error> {
    let algorithm = params.general.algorithm;
    let source = replay::open(job.source, fleet.topic, &params.limits).map_err(Error::Source)?;
    source.notes().iter().for_each(|note| log::warn!("{note}"));
    let mark = match (&job.mark, Mark::beside(source.as_ref(), algorithm)) {
        (Some(mark), _) => Some(mark.clone()),
        (None, Err(Error::NoTarget(truth))) if let Some(marks) = fleet.marks => {
            return Err(Error::NoMark { name: job.name.clone(), marks: marks.to_owned(), truth });
        }
        (None, beside) => beside?,
    };
    let session = Session::with_networks(params.clone(), loaded.networks());
    let mut following = Following::new(source, session, mark);
    let failed = |why: &dyn ToString| Error::Write { to: job.rows.display().to_string(), why: why.to_string() };
    let mut file = partial(fleet.out).map_err(|e| failed(&e))?;
    let out = Box::new(BufWriter::new(file.as_file_mut()));
    let mut rows = Rows::to(out, job.rows.display().to_string(), algorithm)?;
    while following.step(&mut ())?.is_some() {
        rows.write(following.frames, following.output())?;
    }
    rows.finish()?;
    keep(file, &job.rows).map_err(|e| failed(&e))?;
    Ok((summary::read(&job.rows, algorithm)?.0, following.frames))
}

/// Writes a file that is there whole or not at all.
fn write_whole(path: &Path, text: &str) -> Result<(), Error> {
    let written = partial(path.parent().unwrap_or(Path::new("."))).and_then(|mut file| {
        file.write_all(text.as_bytes())?;
        keep(file, path)
    });
    written.map_err(|source| Error::Create { path: path.to_owned(), source })
}

/// A file without its name yet, removed unless it is kept.
fn partial(folder: &Path) -> io::Result<NamedTempFile> {
    use std::os::unix::fs::PermissionsExt as _;
    tempfile::Builder::new().prefix(PARTIAL).permissions(fs::Permissions::from_mode(MODE)).tempfile_in(folder)
}

/// Gives a file its name once its bytes are on the disk.
fn keep(file: NamedTempFile, path: &Path) -> io::Result<()> {
    file.as_file().sync_all()?;
    file.persist(path)?;
    Ok(())
}

fn progress(recordings: usize) -> ProgressBar {
    let bar = ProgressBar::new(recordings as u64).with_finish(ProgressFinish::AndClear);
    match ProgressStyle::with_template("{wide_bar} {pos}/{len} recordings, {eta} left") {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}
