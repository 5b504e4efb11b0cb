//! ETEPF beside its two halves, on the sequence of its paper: root mean square errors over many seeds, when the target
//! is held again, and curves of its path.
//!
//! `cargo run --release --example etepf -- SEQUENCES [--figure docs/etepf-girl.svg] [--seeds 20] [-p NAME:=VALUE]`

#![forbid(unsafe_code)]

mod figure;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use long_term_tracker::Rect;
use long_term_tracker::eval::dataset::{self, Sequence};
use long_term_tracker::eval::run::{Setup, Start, run};
use long_term_tracker::eval::trajectory::{held_from, median, rmse};
use long_term_tracker::params::{Assignment, Params, Phase, Value, assignment};

/// The paper's sequence, and in it, counted from 1: the frame in which she turns back, and the one in which the head of
/// the man is gone from hers for the first time.
const SEQUENCE: &str = "Girl";
const TURNED_BACK: usize = 113;
const UNCOVERED: usize = 441;

/// ETEPF, ET and PF as the paper compares them, with the parameters of each. Ensemble tracking updates its ensemble,
/// colour particles keep to the colours of the first frame.
const METHODS: [(&str, &[(&str, &str)]); 3] = [
    ("ET", &[("etepf.particles.method", "mean_shift")]),
    (
        "PF",
        &[("etepf.particles.method", "particles"), ("etepf.particles.count", "100"), ("etepf.update.enabled", "false")],
    ),
    ("ETEPF", &[]),
];

#[derive(Parser)]
struct Args {
    /// A folder of sequences that contains Girl.
    sequences: PathBuf,
    /// Writes the paths as an SVG picture.
    #[arg(long, value_name = "FILE.svg")]
    figure: Option<PathBuf>,
    /// Number of seeds.
    #[arg(long, default_value_t = 20)]
    seeds: i64,
    /// Sets a parameter for all three.
    #[arg(short = 'p', value_name = "NAME:=VALUE", value_parser = assignment)]
    set: Vec<Assignment>,
}

/// What one method did.
struct Result {
    name: &'static str,
    /// Root mean square errors of each seed, across and down.
    errors: Vec<[f64; 2]>,
    /// The boxes of the seed whose errors are in the middle.
    typical: Vec<Rect>,
}

fn main() -> ExitCode {
    match compare(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn compare(args: &Args) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let sequence = dataset::load(&args.sequences, &[SEQUENCE.to_owned()])?.swap_remove(0);
    println!("root mean square error, px: median (minimum to maximum) of {} seeds", args.seeds);
    println!("method           u                    v            held again after {TURNED_BACK}, after {UNCOVERED}");
    let mut results = Vec::new();
    for (name, changes) in METHODS {
        let runs: Vec<Vec<Rect>> = (0..args.seeds)
            .map(|seed| boxes(&sequence, changes, &args.set, seed))
            .collect::<std::result::Result<_, _>>()?;
        let result = summary(name, &runs, &sequence);
        print_row(&result, &runs, &sequence);
        results.push(result);
    }
    if let Some(path) = &args.figure {
        let paths: Vec<_> = results.iter().map(|r| (r.name, r.typical.as_slice())).collect();
        figure::draw(path, &paths, &sequence.truth)?;
    }
    Ok(())
}

/// The boxes of one run.
fn boxes(
    sequence: &Sequence,
    changes: &[(&str, &str)],
    set: &[Assignment],
    seed: i64,
) -> std::result::Result<Vec<Rect>, Box<dyn std::error::Error>> {
    let mut all =
        vec![("algorithm".to_owned(), Value::String("etepf".to_owned())), ("seed".to_owned(), Value::Integer(seed))];
    for (name, value) in changes {
        all.push(assignment(&format!("{name}:={value}"))?);
    }
    all.extend_from_slice(set);
    let params = Params::default().with(all.iter().map(|(n, v)| (n.as_str(), v)), Phase::StartUp)?;
    let setup = Setup { name: String::new(), params };
    let run = run(&setup, sequence, Start::default(), usize::MAX, false, || ())?;
    Ok(run.answers.iter().map(|answer| answer.rect).collect())
}

fn summary(name: &'static str, runs: &[Vec<Rect>], sequence: &Sequence) -> Result {
    let errors: Vec<[f64; 2]> =
        runs.iter().map(|boxes| rmse(boxes, &sequence.truth).unwrap_or([f64::NAN; 2])).collect();
    let mut order: Vec<usize> = (0..runs.len()).collect();
    order.sort_by(|&a, &b| errors[a][0].hypot(errors[a][1]).total_cmp(&errors[b][0].hypot(errors[b][1])));
    let typical = order.get(runs.len() / 2).map(|&i| runs[i].clone()).unwrap_or_default();
    Result { name, errors, typical }
}

fn print_row(result: &Result, runs: &[Vec<Rect>], sequence: &Sequence) {
    let axis = |i: usize| {
        let values: Vec<f64> = result.errors.iter().map(|e| e[i]).collect();
        let (least, most) = values.iter().fold((f64::MAX, 0.0f64), |(a, b), v| (a.min(*v), b.max(*v)));
        format!("{:5.2} ({least:5.2} to {most:5.2})", median(values))
    };
    let held = |from: usize| {
        let frames: Vec<f64> = runs
            .iter()
            .filter_map(|boxes| held_from(boxes, &sequence.truth, from - 1))
            .map(|i| i as f64 + 1.0)
            .collect();
        format!("{:2} of {} at {:3}", frames.len(), runs.len(), median(frames))
    };
    let [after_turn, after_man] = [held(TURNED_BACK), held(UNCOVERED)];
    println!("{:6} {} {}   {after_turn}, {after_man}", result.name, axis(0), axis(1));
}
