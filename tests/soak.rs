//! The node over a long time, with its default parameters, and with as many pixels as cameras commonly send:
//! `SOAK_FRAMES=10000 SOAK_SECONDS=60 cargo test --release --test soak -- --nocapture`.

#![cfg(feature = "ros")]

mod support;

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use support::{Node, Peer, domain};

/// Without `SOAK_FRAMES`.
const FRAMES: u64 = 600;
/// Without `SOAK_SECONDS`.
const SECONDS: u64 = 5;
/// Of the images that are sent at 1920 x 1080 and 30 Hz, at most so many are lost on the way, best effort as they are.
const LOST: f64 = 0.005;
/// So many more may be: one that is lost in a few seconds, when the machine does something else, is no rate.
const LOST_BY_CHANCE: f64 = 2.0;
/// Far more than a frame takes.
const PER_FRAME: Duration = Duration::from_millis(200);

/// Who measures holds this, for two nodes at once would take each other's time.
static MACHINE: Mutex<()> = Mutex::new(());

#[test]
fn memory_stays_as_it_is_and_the_first_track_comes_at_once() {
    let _alone = MACHINE.lock().unwrap_or_else(PoisonError::into_inner);
    let frames = std::env::var("SOAK_FRAMES").map_or(FRAMES, |n| n.parse().expect("SOAK_FRAMES is a number"));
    let domain = domain();
    let node = Node::start(domain, &[]);
    let peer = Peer::start(domain, "endurance", &[&node.id().to_string(), &frames.to_string()]);
    peer.succeed_within(Duration::from_secs(60) + PER_FRAME * u32::try_from(frames).expect("fewer frames"), &node);
    node.end();
}

#[test]
fn full_hd_at_30_hz_is_received_in_constant_memory() {
    let _alone = MACHINE.lock().unwrap_or_else(PoisonError::into_inner);
    let seconds = std::env::var("SOAK_SECONDS").map_or(SECONDS, |n| n.parse().expect("SOAK_SECONDS is a number"));
    let domain = domain();
    let node = Node::start(domain, &[]);
    let peer = Peer::start(domain, "full_hd", &[&node.id().to_string(), &seconds.to_string()]);
    peer.succeed_within(Duration::from_secs(60 + 2 * seconds), &node);
    let log = node.end();
    let counts = log.lines().find(|line| line.contains("images: ")).expect("the node's counts");
    println!("{counts}");
    let number = |unit: &str| -> f64 {
        let word = counts.split(unit).next().and_then(|before| before.rsplit(' ').next()).expect("a number before it");
        word.parse().unwrap_or_else(|e| panic!("'{word}' before '{unit}': {e}"))
    };
    let [received, missed] = [" received", " missed"].map(number);
    let sent = (received + missed).max(30.0 * seconds as f64);
    assert!(sent - received <= LOST * sent + LOST_BY_CHANCE, "{counts}");
}
