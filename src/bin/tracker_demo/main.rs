//! The package at work: a camera plays a clip over ROS 2, the node follows the person that is marked in it, and what
//! it publishes is drawn on the frames.
//!
//! The node runs in a process of its own, as `tracker_node` would. Everything shown comes from its `~/tracks`
//! messages, matched with the frames by their stamps.

#![forbid(unsafe_code)]

mod animation;
mod clip;
mod domain;
mod link;
mod report;

use std::error::Error;
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::{Child, Command, ExitCode};
use std::time::{Duration, Instant};

use clap::Parser;
use domain::Domain;
use link::Pace;

/// The first argument of the process that is the node.
const NODE: &str = "run-node";
/// How long the node may take to leave.
const GRACE: Duration = Duration::from_secs(20);

/// Plays a clip to the node over ROS 2, marks a person, and shows how she is followed.
///
/// The clip is read from assets/demo in the source tree that this program was built from.
#[derive(Parser)]
#[command(name = "tracker_demo", version = env!("PACKAGE_VERSION"))]
struct Options {
    /// Folder for the annotated frames, the contact sheet and the moving picture.
    #[arg(long, default_value = "target/demo")]
    output: PathBuf,
    /// Frames per second.
    #[arg(long, default_value_t = clip::RATE, value_parser = rate)]
    rate: f64,
    /// Sends each frame only after the last has been answered, so that a slow machine skips none.
    #[arg(long)]
    in_step: bool,
    /// ROS domain, on this machine only. By default one that nobody uses.
    #[arg(long)]
    domain: Option<u16>,
}

fn rate(text: &str) -> Result<f64, String> {
    let rate: f64 = text.parse().map_err(|_| format!("'{text}' is not a number"))?;
    if (1.0..=1000.0).contains(&rate) { Ok(rate) } else { Err("must be from 1 to 1000".to_owned()) }
}

fn main() -> ExitCode {
    let mut args: Vec<OsString> = std::env::args_os().collect();
    if args.get(1).is_some_and(|a| a == NODE) {
        args.remove(1);
        return long_term_tracker::ros::run(args);
    }
    match show(&Options::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("error: {why}");
            ExitCode::FAILURE
        }
    }
}

fn show(options: &Options) -> Result<(), Box<dyn Error>> {
    println!("reading the clip");
    let frames = clip::frames();
    let marks = clip::marks();
    let mark = marks.first().and_then(|m| m.rect).ok_or("the first frame has no mark")?;

    // Held until the end.
    let own;
    let domain = match options.domain {
        Some(domain) => domain,
        None => {
            own = Domain::take();
            own.number
        }
    };
    println!("starting the node in ROS domain {domain}, on this machine only");
    let node = Node::start(domain)?;
    let pace = Pace { rate: options.rate, in_step: options.in_step };
    let run = link::play(&frames, mark, pace, domain)?;
    node.stop()?;

    println!("drawing the frames and the moving picture");
    let pictures = report::draw(&frames, &run.tracks, &options.output)?;
    print!("{}", report::summary(&run, &marks));
    println!("annotated frames: {}", options.output.display());
    println!("contact sheet:    {}", pictures.sheet.display());
    println!("moving picture:   {}", pictures.animation.display());
    Ok(())
}

/// The process of the node.
struct Node(Child);

impl Node {
    fn start(domain: u16) -> std::io::Result<Self> {
        let child = Command::new(std::env::current_exe()?)
            .args([NODE, "--ros-args", "-p", clip::PARAMETER])
            .env("ROS_DOMAIN_ID", domain.to_string())
            .env("ROS_LOCALHOST_ONLY", "1")
            .spawn()?;
        Ok(Self(child))
    }

    /// Asks the node to leave as a launch file would, and waits until it has.
    fn stop(mut self) -> Result<(), Box<dyn Error>> {
        Command::new("sh").args(["-c", "kill -TERM $0", &self.0.id().to_string()]).status()?;
        let begin = Instant::now();
        while begin.elapsed() < GRACE {
            if let Some(status) = self.0.try_wait()? {
                return if status.success() { Ok(()) } else { Err(format!("the node ended with {status}").into()) };
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        Err("the node does not exit".into())
    }
}

impl Drop for Node {
    fn drop(&mut self) {
        // It is gone already unless something failed.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
