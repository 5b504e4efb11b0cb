//! How many debug images arrive: a target of its own, for nothing else may run beside it.

#![cfg(feature = "ros")]

mod support;

use support::{Node, Peer, domain};

/// Images that are sent, and the least share of them that must come back.
const FRAMES: &str = "150";
const LEAST: &str = "0.95";

#[test]
fn nearly_all_debug_images_come() {
    let domain = domain();
    let node = Node::start(domain, &["--ros-args", "-p", "lcmht.cnn.enabled:=false"]);
    Peer::start(domain, "debug_share", &[FRAMES, LEAST]).succeed(&node);
}
