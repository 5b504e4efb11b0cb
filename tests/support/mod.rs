//! A real ROS 2 peer for the tests: rclpy in a virtual environment, and the node as a process of its own.

#![allow(dead_code, reason = "each test binary uses its own part")]

mod environment;
mod process;

pub use environment::Environment;
pub use process::{Node, Peer, domain};
