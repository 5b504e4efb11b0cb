//! `evaluate`: scores trackers on sequences with ground truth. See [`long_term_tracker::cli::evaluate`].

#![forbid(unsafe_code)]

use std::process::ExitCode;

use long_term_tracker::cli::{arguments, evaluate, exit};

fn main() -> ExitCode {
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or("warn")).init();
    exit(evaluate::run(&arguments(), &mut std::io::stdout().lock()))
}
