//! A real ROS 2 peer for the tests: rclpy in a virtual environment, and the node as a process of its own.

#![allow(dead_code, unused_imports, reason = "each test binary uses its own part")]

mod environment;
#[cfg(feature = "ros")]
mod process;

pub use environment::Environment;
#[cfg(feature = "ros")]
pub use process::{Node, Peer, domain, scenario};
