//! `track`: follows a target through recorded frames. See [`long_term_tracker::cli::track`].

#![forbid(unsafe_code)]

use std::process::ExitCode;

use long_term_tracker::cli::{arguments, exit, track};

fn main() -> ExitCode {
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or("warn")).init();
    exit(track::run(&arguments()))
}
