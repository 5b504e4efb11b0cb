//! Either side is killed and comes back, and the other side goes on as if nothing had been.
//!
//! `RESTARTS` in the environment says how often; ten and more for a thorough run.

#![cfg(feature = "ros")]

mod support;

use support::{Node, Peer, domain};

/// How often where the environment does not say.
const RESTARTS: &str = "3";
/// What the node may grow by in kB: the library remembers dead peers for as long as their leases run.
const MOST_GROWTH: usize = 8 << 10;

fn restarts() -> String {
    std::env::var("RESTARTS").unwrap_or_else(|_| RESTARTS.to_owned())
}

#[test]
fn a_killed_node_comes_back() {
    let domain = domain();
    Peer::start(domain, "killed_node", &[env!("CARGO_BIN_EXE_tracker_node"), &restarts()]).succeed_alone();
}

#[test]
fn a_killed_peer_comes_back_and_leaves_nothing_behind() {
    let domain = domain();
    let node = Node::start(domain, &[]);
    let run = || Peer::start(domain, "killed_peer", &[]).be_killed(&node);
    run();
    let before = node.resources();
    (1..restarts().parse().expect("a number of restarts")).for_each(|_| run());
    let after = node.resources();
    println!("{before:?} before, {after:?} after");
    assert_eq!((after.threads, after.files), (before.threads, before.files));
    assert!(after.resident < before.resident + MOST_GROWTH, "{before:?} before, {after:?} after");
    node.signal("INT");
    let (code, log) = node.finish();
    assert_eq!(code, Some(0), "{log}");
}
