//! How long a track message takes: a real rclpy camera of 1280 x 720 at 30 Hz against the node, for ten seconds.
//!
//! It prints what was sent, received and skipped, the time between `publish` in rclpy and the track message in rclpy
//! without the tracker's own, and the node's own count: from the arrival of an image's last part to its message.

#[path = "../tests/support/mod.rs"]
mod support;

use support::{Node, Peer, domain};

/// How long images are sent.
const SECONDS: &str = "10";

fn main() {
    let domain = domain();
    let node = Node::start(domain, &[]);
    Peer::start(domain, "measure", &[SECONDS]).succeed(&node);
    node.signal("INT");
    let (_, log) = node.finish();
    log.lines().filter(|line| line.contains("images:")).for_each(|line| println!("{line}"));
}
