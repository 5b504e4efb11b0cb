//! What comes through at a camera's rate, and how long it takes: a real rclpy camera of 30 Hz against the node, for ten
//! seconds each.
//!
//! * At 1280 x 720: what was sent, received and skipped, the time between `publish` in rclpy and the track message in
//!   rclpy without the tracker's own, and the node's own count: from the arrival of an image's last part to its
//!   message.
//! * At 1280 x 720: how many debug images a default subscriber sees of raw ones, of compressed ones, and a subscriber
//!   of sensor data of compressed ones.
//! * At 1920 x 1080: what was lost on the way, and the node's memory.

#[path = "../tests/support/mod.rs"]
mod support;

use support::{Node, Peer, domain};

/// How long images are sent, and how many that are.
const SECONDS: &str = "10";
const FRAMES: &str = "300";

fn main() {
    at_the_cameras_rate(&[], |_| ("measure", vec![SECONDS.to_owned()]));
    at_the_cameras_rate(&["--ros-args", "-p", "lcmht.cnn.enabled:=false"], |_| {
        ("debug_rate", vec![SECONDS.to_owned()])
    });
    at_the_cameras_rate(&[], |node| ("full_hd", vec![node.id().to_string(), FRAMES.to_owned(), "1".to_owned()]));
}

/// Runs a function of `tests/peer/scenarios.py`, then prints what the node has counted.
fn at_the_cameras_rate(args: &[&str], camera: impl Fn(&Node) -> (&'static str, Vec<String>)) {
    let domain = domain();
    let node = Node::start(domain, args);
    let (scenario, told) = camera(&node);
    Peer::start(domain, scenario, &told.iter().map(String::as_str).collect::<Vec<_>>()).succeed(&node);
    let log = node.end();
    log.lines().filter(|line| line.contains(" received, ")).for_each(|line| println!("{line}"));
}
