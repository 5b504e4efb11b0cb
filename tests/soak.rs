//! The node over a long time, with its default parameters: `SOAK_FRAMES=10000 cargo test --release --test soak -- --nocapture`.

#![cfg(feature = "ros")]

mod support;

use std::time::Duration;

use support::{Node, Peer, domain};

/// Without `SOAK_FRAMES`.
const FRAMES: u64 = 600;
/// Far more than a frame takes.
const PER_FRAME: Duration = Duration::from_millis(200);

#[test]
fn memory_stays_as_it_is_and_the_first_track_comes_at_once() {
    let frames = std::env::var("SOAK_FRAMES").map_or(FRAMES, |n| n.parse().expect("SOAK_FRAMES is a number"));
    let domain = domain();
    let node = Node::start(domain, &[]);
    let peer = Peer::start(domain, "endurance", &[&node.id().to_string(), &frames.to_string()]);
    peer.succeed_within(Duration::from_secs(60) + PER_FRAME * u32::try_from(frames).expect("fewer frames"), &node);
    node.signal("INT");
    let (code, log) = node.finish();
    assert_eq!(code, Some(0), "{log}");
}
