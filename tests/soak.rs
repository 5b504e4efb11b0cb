//! The node over a long time, with its default parameters, and with as many pixels as cameras commonly send:
//! `SOAK_FRAMES=10000 SOAK_FULL_HD=2000 cargo test --release --test soak -- --nocapture`.

#![cfg(feature = "ros")]

mod support;

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use support::{Node, Peer, domain};

/// Without `SOAK_FRAMES`, and without `SOAK_FULL_HD`.
const FRAMES: u32 = 600;
const FULL_HD: u32 = 150;
/// Seconds of an idle machine within which the first track comes after the first image, in one of so many trials: the
/// machine may be busier for a while than it is found to be.
const AT_ONCE: f64 = 1.0;
const TRIALS: usize = 3;
/// Of the images that are sent at 1920 x 1080, each when the last is answered, at most so many are lost on the way,
/// best effort as they are.
const LOST: f64 = 0.005;
/// So many more may be: one that is lost in a few seconds, when the machine does something else, is no rate.
const LOST_BY_CHANCE: f64 = 2.0;
/// Far more than a frame takes, and than it takes to begin.
const PER_FRAME: Duration = Duration::from_secs(1);
const BEGIN: Duration = Duration::from_secs(300);

/// Who measures holds this, for two nodes at once would take each other's time.
static MACHINE: Mutex<()> = Mutex::new(());

/// The number that the variable holds.
fn number(variable: &str, otherwise: u32) -> u32 {
    std::env::var(variable).map_or(otherwise, |n| n.parse().unwrap_or_else(|_| panic!("{variable} is a number")))
}

#[test]
fn the_first_track_comes_at_once() {
    let _alone = MACHINE.lock().unwrap_or_else(PoisonError::into_inner);
    let times = tempfile::NamedTempFile::new().expect("a file");
    let path = times.path().to_str().expect("a path of text");
    let took = || -> f64 {
        let domain = domain();
        let node = Node::start(domain, &[]);
        Peer::start(domain, "first_track", &[path]).succeed(&node);
        node.end();
        let told = std::fs::read_to_string(path).expect("what the peer wrote");
        told.lines().last().expect("a line").parse().expect("seconds")
    };
    let took: Vec<f64> = (0..TRIALS).map(|_| took()).collect();
    println!("first track after {took:.2?} s");
    assert!(took.iter().any(|&seconds| seconds < AT_ONCE), "{took:?}");
}

#[test]
fn memory_stays_as_it_is() {
    let _alone = MACHINE.lock().unwrap_or_else(PoisonError::into_inner);
    let frames = number("SOAK_FRAMES", FRAMES);
    let domain = domain();
    let node = Node::start(domain, &[]);
    let peer = Peer::start(domain, "endurance", &[&node.id().to_string(), &frames.to_string()]);
    peer.succeed_within(BEGIN + PER_FRAME * frames, &node);
    node.end();
}

#[test]
fn full_hd_is_received_in_constant_memory() {
    let _alone = MACHINE.lock().unwrap_or_else(PoisonError::into_inner);
    let frames = number("SOAK_FULL_HD", FULL_HD);
    let domain = domain();
    let node = Node::start(domain, &[]);
    let peer = Peer::start(domain, "full_hd", &[&node.id().to_string(), &frames.to_string(), "0"]);
    peer.succeed_within(BEGIN + PER_FRAME * frames, &node);
    let log = node.end();
    let counts = log.lines().find(|line| line.contains(" received, ")).expect("the node's counts");
    println!("{counts}");
    let number = |unit: &str| -> f64 {
        let word = counts.split(unit).next().and_then(|before| before.rsplit(' ').next()).expect("a number before it");
        word.parse().unwrap_or_else(|e| panic!("'{word}' before '{unit}': {e}"))
    };
    let [received, missed] = [" received", " missed"].map(number);
    let sent = (received + missed).max(frames.into());
    assert!(sent - received <= LOST * sent + LOST_BY_CHANCE, "{counts}");
}
