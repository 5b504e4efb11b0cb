//! `evaluate`: scores trackers on sequences with ground truth.

use std::fs::File;
use std::io::{BufWriter, ErrorKind, Write};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use clap::Parser;

use super::{Error, params, progress, rows, tell};
use crate::eval::attributes;
use crate::eval::dataset::{self, Sequence};
use crate::eval::halves::Halves;
use crate::eval::page;
use crate::eval::peers::{Peer, TIMES_FILE, start_folder};
use crate::eval::report::Report;
use crate::eval::run::{Run, Runs, Setup, Start, run_all};
use crate::eval::table::{Hard, Table};
use crate::eval::worlds::{self, Worlds};
use crate::params::{Assignment, Value, assignment};

/// Score trackers on sequences with ground truth: one pass without resets, by the rules of the object tracking
/// benchmark (OTB) and of long-term tracking (VOT-LT).
///
/// Prints a table for each algorithm and parameter file, and for each other tracker. prec: share of frames in which the
/// centres are at most 20 px apart; AUC: area under the success curve over 21 overlap thresholds; held: share of frames
/// with an overlap above 0.1; F: harmonic mean of long-term precision and recall, at the best confidence threshold;
/// first loss: frames before the target is first lost, reported or with a box that does not touch it (all frames, if it
/// never is); lost: frames reported lost; right, wrong: of these, frames in which the target was out of view or fully
/// occluded, and in view; astray: frames in view, not reported lost, and not held; recovered: losses that ended on the
/// target (overlap above 0.3 within 10 frames); fps: frames per second of the tracker's processor time, if sequences
/// run one after the other (`--threads 1`). Exit codes: 0 done, 1 a sequence failed, 2 unusable arguments.
#[derive(Debug, Parser)]
#[command(name = "evaluate", version = env!("PACKAGE_VERSION"))]
pub struct Args {
    /// A folder of sequences. Each is a folder with images, in img/ or not, a groundtruth_rect.txt (x,y,w,h per row,
    /// NaN = not in view) and, if known, an occlusion.txt (the occluded share of the box, one row per frame).
    dataset: PathBuf,
    /// A tracker to score. May be given several times.
    #[arg(long, value_name = "NAME")]
    algorithm: Vec<String>,
    /// A preset's name, or a ROS parameter file. May be given several times; each is scored separately.
    #[arg(long, value_name = "PRESET|FILE.yaml")]
    params: Vec<PathBuf>,
    /// Sets a parameter for all setups; overrides files.
    #[arg(short = 'p', long = "param", value_name = "NAME:=VALUE", value_parser = assignment)]
    set: Vec<Assignment>,
    /// Another tracker, whose boxes are read from DIR/SEQUENCE.txt or .csv: x,y,w,h per row, NaN = reported lost, and
    /// optionally its confidence in a fifth column. DIR/times.csv may hold sequence,frames,seconds; DIR/start-1,
    /// DIR/start-2 and so on hold the same for other starts. May be given several times.
    #[arg(long = "peer", value_name = "NAME=DIR")]
    peers: Vec<Peer>,
    /// Scores only the peers, and runs no tracker.
    #[arg(long)]
    peers_only: bool,
    /// Number of runs per sequence: the first from the true box, the others one pixel off in different directions and
    /// with other seeds. The tables show the first run; the spread follows below them.
    #[arg(long, value_name = "N", default_value = "1")]
    starts: NonZeroUsize,
    /// Also checks whether a gain holds on video that it was not chosen on. Every second sequence by name is one half,
    /// the rest the other; the best setup on each half is scored on the other. Means come with 95 % intervals
    /// (bootstrap over sequences and starts), differences from the first setup with p values. Setups that do not differ
    /// significantly from the best (p of 0.05 or more) count as equal; of these, the one given first is chosen.
    #[arg(long)]
    halves: bool,
    /// The kind of video of each sequence, for --halves: rows of sequence,world, where a sequence may end in *.
    /// Default: the dataset's worlds.csv, if there is one.
    #[arg(long, value_name = "FILE", requires = "halves")]
    worlds: Option<PathBuf>,
    /// Only these sequences, in this order.
    #[arg(long, value_name = "A,B,...", value_delimiter = ',')]
    sequences: Vec<String>,
    /// Maximum number of frames per sequence.
    #[arg(long, value_name = "N")]
    frames: Option<NonZeroUsize>,
    /// Number of sequences to run at once. Default: the number of cores.
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    /// Writes all figures as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Writes DIR/index.html, a page with diagrams, tables by sequence and by attribute, and pictures of the worst
    /// moments of the first table; and all figures as DIR/results.json.
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Writes the boxes to DIR/SEQUENCE.csv, or DIR/SETUP/SEQUENCE.csv if there are several algorithms or parameter
    /// files: the columns of track and the overlap with the true box; and a times.csv, so that --peer can read them.
    /// Other starts go to folders start-1, start-2 and so on.
    #[arg(long, value_name = "DIR")]
    boxes: Option<PathBuf>,
}

/// Runs the command; the tables go to `out`.
pub fn run(args: &Args, out: &mut dyn Write) -> Result<(), Error> {
    let setups = if args.peers_only { Vec::new() } else { setups(args)? };
    if setups.is_empty() && args.peers.is_empty() {
        return Err(Error::NoSetup);
    }
    let limit = args.frames.map_or(usize::MAX, NonZeroUsize::get);
    let sequences = dataset::load(&args.dataset, &args.sequences)?;
    let worlds = worlds(args)?;
    let peers = args.peers.iter().map(|peer| peer.load(&sequences, limit)).collect::<Result<Vec<_>, _>>()?;
    let json = args.json.as_deref().map(create).transpose()?;
    let folders = folders(args, &setups)?;
    args.report.as_deref().map(create_folder).transpose()?;

    let starts = Start::variants(args.starts.get());
    let threads = args.threads.or_else(|| std::thread::available_parallelism().ok()).map_or(1, NonZeroUsize::get);
    let total: usize = sequences.iter().map(|s| s.truth.len().min(limit)).sum();
    let bar = progress(Some(total * setups.len() * starts.len()));
    let results = run_all(&setups, &sequences, &starts, limit, threads, || bar.inc(1));
    bar.finish_and_clear();

    let ours: Vec<Done> = setups.iter().zip(&results).map(|(setup, runs)| finished(setup, &sequences, runs)).collect();
    let done: usize = ours.iter().map(Vec::len).sum();
    for (folder, done) in folders.iter().zip(&ours).filter_map(|(folder, done)| Some((folder.as_ref()?, done))) {
        write_boxes(folder, done)?;
    }
    let theirs: Vec<Done> = peers.iter().map(|runs| given(&sequences, runs)).collect();
    let hard = if args.report.is_some() { hard(&sequences, limit) } else { Vec::new() };
    let tables = setups.iter().zip(&ours).map(|(s, done)| Table::new(&s.name, Some(&s.params), done, &hard));
    let peers = args.peers.iter().zip(&theirs).map(|(peer, done)| Table::new(&peer.name, None, done, &hard));
    let setups: Vec<Table> = tables.chain(peers).collect();
    let dataset = args.dataset.display().to_string();
    let halves = worlds.map(|worlds| {
        let mut names: Vec<String> = sequences.iter().map(|sequence| sequence.name.clone()).collect();
        alphanumeric_sort::sort_str_slice(&mut names);
        Halves::new(&names, &setups, &worlds)
    });
    let report = Report { dataset, starts: starts.len(), attributes: hard, setups, halves };

    if let (Some(file), Some(path)) = (json, &args.json) {
        write_json(file, &report).map_err(|e| Error::Write { to: path.display().to_string(), why: e.to_string() })?;
    }
    match write!(out, "{report}").and_then(|()| out.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => {
            return Err(Error::Write { to: "standard output".to_owned(), why: e.to_string() });
        }
        _ => {}
    }
    if let Some(folder) = &args.report {
        let first = ours.first().or(theirs.first()).into_iter().flatten();
        page::write(folder, &report, &first.map(|(sequence, runs)| (*sequence, runs[0])).collect::<Vec<_>>())?;
    }
    match sequences.len() * report.setups.iter().filter(|t| !t.peer).count() {
        runs if runs > done => Err(Error::Sequences { failed: runs - done, runs }),
        _ => Ok(()),
    }
}

/// The sequences that a setup was run over to their ends, each with its runs by start.
type Done<'a> = Vec<(&'a Sequence, Vec<&'a Run>)>;

/// Those of one of our setups; what kept it from the end of the others is told.
fn finished<'a>(setup: &Setup, sequences: &'a [Sequence], runs: &'a Runs) -> Done<'a> {
    let mut done = Vec::new();
    for (i, sequence) in sequences.iter().enumerate() {
        // What keeps one start from its end keeps them all.
        match runs.iter().map(|run| run[i].as_ref()).collect::<Result<Vec<_>, _>>() {
            Ok(runs) => done.push((sequence, runs)),
            Err(error) => tell(format_args!("error: {}, {}: {error}", setup.name, sequence.name)),
        }
    }
    done
}

/// Those of which there are boxes of another tracker.
fn given<'a>(sequences: &'a [Sequence], runs: &'a [Vec<Run>]) -> Done<'a> {
    let all = sequences.iter().zip(runs).map(|(sequence, runs)| (sequence, runs.iter().collect::<Vec<_>>()));
    all.filter(|(_, runs)| !runs.is_empty()).collect()
}

/// The worlds of the sequences, where halves are asked for.
fn worlds(args: &Args) -> Result<Option<Worlds>, Error> {
    let beside = args.dataset.join(worlds::FILE_NAME);
    Ok(match &args.worlds {
        _ if !args.halves => None,
        Some(path) => Some(Worlds::read(path)?),
        None if beside.exists() => Some(Worlds::read(&beside)?),
        None => Some(Worlds::default()),
    })
}

/// What makes the sequences hard. Of one that cannot be read that is not known, which is told.
fn hard(sequences: &[Sequence], limit: usize) -> Vec<Hard> {
    let of = |sequence| match attributes::of(sequence, limit) {
        Ok(attributes) => Some((sequence, attributes)),
        Err(error) => {
            tell(format_args!("error: {}: {error}", sequence.name));
            None
        }
    };
    Hard::sort(&sequences.iter().filter_map(of).collect::<Vec<_>>())
}

/// Every algorithm with every file.
fn setups(args: &Args) -> Result<Vec<Setup>, Error> {
    let algorithms: Vec<Option<&str>> = optional(&args.algorithm).map(|a| a.map(String::as_str)).collect();
    let mut setups: Vec<Setup> = Vec::new();
    for file in optional(&args.params) {
        for algorithm in &algorithms {
            let params = params(file.map_or(&[][..], std::slice::from_ref), *algorithm, &args.set)?;
            let algorithm = match params.get("algorithm") {
                Some(Value::String(name)) => name,
                _ => String::new(),
            };
            let stem = file.and_then(|f| f.file_stem()).map(|s| format!("-{}", s.to_string_lossy()));
            let mut name = algorithm + &stem.unwrap_or_default();
            while setups.iter().any(|s| s.name == name) {
                name.push('\'');
            }
            setups.push(Setup { name, params });
        }
    }
    Ok(setups)
}

/// Each item, or `None` once where there is none.
fn optional<T>(items: &[T]) -> impl Iterator<Item = Option<&T>> {
    items.iter().map(Some).chain(items.is_empty().then_some(None))
}

/// The folder of boxes of each set, where boxes are asked for.
fn folders(args: &Args, setups: &[Setup]) -> Result<Vec<Option<PathBuf>>, Error> {
    let folder = |setup: &Setup| {
        let Some(root) = &args.boxes else { return Ok(None) };
        let path = if setups.len() > 1 { root.join(&setup.name) } else { root.clone() };
        create_folder(&path)?;
        Ok(Some(path))
    };
    setups.iter().map(folder).collect()
}

fn create_folder(path: &Path) -> Result<(), Error> {
    std::fs::create_dir_all(path).map_err(|source| Error::Create { path: path.to_owned(), source })
}

fn create(path: &Path) -> Result<File, Error> {
    File::create(path).map_err(|source| Error::Create { path: path.to_owned(), source })
}

fn write_json(file: File, report: &Report) -> std::io::Result<()> {
    let mut out = BufWriter::new(file);
    serde_json::to_writer_pretty(&mut out, report)?;
    writeln!(out)?;
    out.flush()
}

/// Writes the boxes of the runs over each sequence, and how long they took: a folder a start.
fn write_boxes(folder: &Path, done: &[(&Sequence, Vec<&Run>)]) -> Result<(), Error> {
    let failed = |path: &Path, e: std::io::Error| Error::Write { to: path.display().to_string(), why: e.to_string() };
    let starts = done.iter().map(|(_, runs)| runs.len()).max().unwrap_or_default();
    for start in 0..starts {
        let folder = start_folder(folder, start);
        create_folder(&folder)?;
        let mut times = "sequence,frames,seconds\n".to_owned();
        for (sequence, run) in done.iter().filter_map(|(sequence, runs)| Some((sequence, runs.get(start)?))) {
            let path = folder.join(format!("{}.csv", sequence.name));
            write_rows(&path, sequence, run).map_err(|e| failed(&path, e))?;
            let seconds = run.processor_time.unwrap_or_default().as_secs_f64();
            times += &format!("{},{},{seconds:.3}\n", sequence.name, run.answers.len());
        }
        let path = folder.join(TIMES_FILE);
        std::fs::write(&path, times).map_err(|e| failed(&path, e))?;
    }
    Ok(())
}

fn write_rows(path: &Path, sequence: &Sequence, run: &Run) -> std::io::Result<()> {
    let mut out = BufWriter::new(File::create(path)?);
    writeln!(out, "{},overlap", rows::HEADER)?;
    for (answer, truth) in run.answers.iter().zip(&sequence.truth) {
        rows::write_box(&mut out, &answer.rect, answer.confidence.unwrap_or_default() as f32, answer.state)?;
        writeln!(out, ",{:.3}", truth.map_or(f64::NAN, |t| t.iou(&answer.rect)))?;
    }
    out.flush()
}
