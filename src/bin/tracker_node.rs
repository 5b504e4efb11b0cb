//! The ROS 2 node; see [`long_term_tracker::ros`].

#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    long_term_tracker::ros::run(std::env::args_os())
}
