//! How many debug images arrive: a target of its own, for nothing else may run beside it.

#![cfg(feature = "ros")]

mod support;

use support::{Node, Peer, domain};

/// Seconds that images are sent, and the least share of them that must come back.
const SECONDS: &str = "5";
const LEAST: &str = "0.95";

#[test]
fn debug_images_come_at_the_frame_rate() {
    let domain = domain();
    let node = Node::start(domain, &["--ros-args", "-p", "lcmht.cnn.enabled:=false"]);
    Peer::start(domain, "debug_rate", &[SECONDS, LEAST]).succeed(&node);
}
