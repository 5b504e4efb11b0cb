//! `evaluate`: scores trackers on sequences with ground truth.

use std::fs::File;
use std::io::{BufWriter, ErrorKind, Write};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use clap::Parser;

use super::{Error, params, progress, rows};
use crate::eval::dataset::{self, Sequence};
use crate::eval::report::{Report, Table};
use crate::eval::run::{Run, Setup, run_all};
use crate::params::{Assignment, Value, assignment};

/// Score trackers on sequences with ground truth: one pass, no resets, by the rules of the object tracking
/// benchmark.
///
/// Prints a table for each algorithm and parameter file. precision: share of frames whose centres are at most 20 px
/// apart; AUC: area under the success curve of 21 overlaps; held: share with an overlap above 0.1; lost: frames
/// reported lost; recovered: losses that ended on the target (overlap above 0.3 within 10 frames); fps: frames a
/// second of the tracker's processor time (where several sequences run at a time, without what a network computes in
/// threads of its own). Exit codes: 0 done, 1 a sequence failed, 2 unusable arguments.
#[derive(Debug, Parser)]
#[command(name = "evaluate", version)]
pub struct Args {
    /// A folder of sequences: each a folder with images, in img/ or not, and a groundtruth_rect.txt (x,y,w,h a row,
    /// NaN = not in view).
    dataset: PathBuf,
    /// A tracker to score; may be given several times.
    #[arg(long, value_name = "NAME")]
    algorithm: Vec<String>,
    /// A ROS parameter file; each is scored by itself.
    #[arg(long, value_name = "FILE.yaml")]
    params: Vec<PathBuf>,
    /// Sets a parameter for all; wins over files.
    #[arg(short = 'p', long = "param", value_name = "NAME:=VALUE", value_parser = assignment)]
    set: Vec<Assignment>,
    /// Only these sequences, in this order.
    #[arg(long, value_name = "A,B,...", value_delimiter = ',')]
    sequences: Vec<String>,
    /// At most so many frames of each sequence.
    #[arg(long, value_name = "N")]
    frames: Option<NonZeroUsize>,
    /// Sequences that are run at a time; by default as many as there are cores.
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    /// Writes the figures as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Writes the boxes as DIR/SEQUENCE.csv, or DIR/SETUP/SEQUENCE.csv where there are several tables: the columns of
    /// track and the overlap with the true box.
    #[arg(long, value_name = "DIR")]
    boxes: Option<PathBuf>,
}

/// Runs the command; the tables go to `out`.
pub fn run(args: &Args, out: &mut dyn Write) -> Result<(), Error> {
    let setups = setups(args)?;
    let sequences = dataset::load(&args.dataset, &args.sequences)?;
    let json = args.json.as_deref().map(create).transpose()?;
    let folders = folders(args, &setups)?;

    let limit = args.frames.map_or(usize::MAX, NonZeroUsize::get);
    let threads = args.threads.or_else(|| std::thread::available_parallelism().ok()).map_or(1, NonZeroUsize::get);
    let total: usize = sequences.iter().map(|s| s.truth.len().min(limit)).sum();
    let bar = progress(Some(total * setups.len()));
    let results = run_all(&setups, &sequences, limit, threads, || bar.inc(1));
    bar.finish_and_clear();

    let mut failed = 0;
    let mut tables = Vec::new();
    for ((setup, folder), results) in setups.iter().zip(&folders).zip(&results) {
        let mut done = Vec::new();
        for (sequence, result) in sequences.iter().zip(results) {
            match result {
                Ok(run) => done.push((sequence, run)),
                Err(error) => {
                    failed += 1;
                    eprintln!("error: {}, {}: {error}", setup.name, sequence.name);
                }
            }
        }
        if let Some(folder) = folder {
            done.iter().try_for_each(|(sequence, run)| write_boxes(folder, sequence, run))?;
        }
        tables.push(Table::new(setup, done));
    }
    let report = Report { dataset: args.dataset.display().to_string(), setups: tables };
    if let (Some(file), Some(path)) = (json, &args.json) {
        write_json(file, &report).map_err(|why| Error::Write { to: path.display().to_string(), why })?;
    }
    match write!(out, "{report}").and_then(|()| out.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => {
            return Err(Error::Write { to: "standard output".to_owned(), why: e.to_string() });
        }
        _ => {}
    }
    let runs = sequences.len() * setups.len();
    if failed > 0 { Err(Error::Sequences { failed, runs }) } else { Ok(()) }
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
        match std::fs::create_dir_all(&path) {
            Ok(()) => Ok(Some(path)),
            Err(source) => Err(Error::Create { path, source }),
        }
    };
    setups.iter().map(folder).collect()
}

fn create(path: &Path) -> Result<File, Error> {
    File::create(path).map_err(|source| Error::Create { path: path.to_owned(), source })
}

fn write_json(file: File, report: &Report) -> Result<(), String> {
    let mut out = BufWriter::new(file);
    serde_json::to_writer_pretty(&mut out, report).map_err(|e| e.to_string())?;
    writeln!(out).and_then(|()| out.flush()).map_err(|e| e.to_string())
}

fn write_boxes(folder: &Path, sequence: &Sequence, run: &Run) -> Result<(), Error> {
    let path = folder.join(format!("{}.csv", sequence.name));
    let write = || {
        let mut out = BufWriter::new(File::create(&path)?);
        writeln!(out, "{},overlap", rows::HEADER)?;
        for ((output, row), truth) in run.outputs.iter().zip(run.rows()).zip(&sequence.truth) {
            rows::write(&mut out, output)?;
            writeln!(out, ",{:.3}", truth.map_or(f64::NAN, |t| t.iou(&row.1)))?;
        }
        out.flush()
    };
    write().map_err(|e: std::io::Error| Error::Write { to: path.display().to_string(), why: e.to_string() })
}
