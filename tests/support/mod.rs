//! A real ROS 2 peer for the tests: rclpy in a virtual environment, and the node as a process of its own.

#![allow(dead_code, unused_imports, reason = "each test binary uses its own part")]

#[cfg(feature = "ros")]
#[path = "../../src/bin/tracker_demo/domain.rs"]
mod domain;
mod environment;
mod machine;
#[cfg(feature = "ros")]
mod process;
mod sequences;

pub use environment::Environment;
pub use machine::{free_port, slowness};
#[cfg(feature = "ros")]
pub use process::{Node, Peer, domain, scenario};
pub use sequences::sequence;
