//! What moves in recorded frames: the blobs that MAPTrack sees before it knows of any target, as detections in the
//! format of MOTChallenge (frame, -1, x, y, w, h, confidence and three fields that are not used). Another tracker can
//! be given the same; `benches/peers/many.py` does.
//!
//! `cargo run --release --example blobs -- SOURCE [--params FILE.yaml]... [-p NAME:=VALUE]...`

#![forbid(unsafe_code)]

use std::io::{BufWriter, Write};
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use long_term_tracker::params::{Assignment, assignment};
use long_term_tracker::trace::{Event, Proposal};
use long_term_tracker::{Session, Trace, cli, replay};

/// Blobs of recorded frames, as detections in the format of MOTChallenge.
#[derive(Parser)]
struct Args {
    /// A folder of images or a bag, as `track` reads them.
    source: PathBuf,
    /// A ROS parameter file. May be given several times; later files override earlier ones.
    #[arg(long, value_name = "FILE.yaml")]
    params: Vec<PathBuf>,
    /// Sets a parameter; overrides files.
    #[arg(short = 'p', value_name = "NAME:=VALUE", value_parser = assignment)]
    set: Vec<Assignment>,
}

/// The blobs of the last frame.
#[derive(Default)]
struct Blobs(Vec<Proposal>);

impl Trace for Blobs {
    fn event(&mut self, event: Event) {
        if let Event::Proposals(proposals) = event {
            self.0.extend(proposals);
        }
    }
}

fn run(args: &Args) -> Result<(), Box<dyn std::error::Error>> {
    let params = cli::params(&args.params, Some("maptrack"), &args.set)?;
    let mut source = replay::open(&args.source, None, &Default::default())?;
    let mut session = Session::new(params)?;
    let mut out = BufWriter::new(std::io::stdout().lock());
    let mut blobs = Blobs::default();
    for frame in 1.. {
        let Some(buffer) = source.next_frame()? else { break };
        blobs.0.clear();
        session.step(&buffer.frame(), &mut blobs);
        for Proposal { rect: r, score } in &blobs.0 {
            writeln!(out, "{frame},-1,{},{},{},{},{score},-1,-1,-1", r.x, r.y, r.w, r.h)?;
        }
    }
    Ok(out.flush()?)
}

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
