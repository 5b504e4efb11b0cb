//! Marks and requests at any rate, and a process that hangs or grows.

#![cfg(feature = "ros")]

use std::path::Path;

use super::support::{Environment, Node, Peer, domain};

/// Runs a function of `tests/peer/abuse_marks.py`.
fn peer(domain: u32, function: &str, args: &[&str]) -> Peer {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peer/abuse_marks.py");
    Peer::spawn(&mut Environment::get().python(), domain, &script, &[&[function], args].concat())
}

#[test]
fn images_are_tracked_however_often_the_target_is_marked_and_a_signal_ends_it() {
    let domain = domain();
    let node = Node::start(domain, &[]);
    let beside = Node::start(domain, &["--ros-args", "-r", "__node:=beside"]);
    let ids = [node.id().to_string(), beside.id().to_string()];
    peer(domain, "rate", &[&ids[0], &ids[1]]).succeed(&node);
    for node in [node, beside] {
        let (code, log) = node.finish();
        assert_eq!(code, Some(0), "{log}");
        // A line of each kind at most once a second.
        assert!(log.lines().count() < 400, "{log}");
    }
}

#[test]
fn every_request_is_answered_and_a_stop_makes_the_marks_before_it_void() {
    let domain = domain();
    let node = Node::start(domain, &["--ros-args", "-p", "max_targets:=3"]);
    peer(domain, "requests", &[]).succeed(&node);
    node.end();
}

#[cfg(target_os = "linux")]
#[test]
fn a_thread_that_hangs_is_named_and_does_not_keep_the_process() {
    peer(domain(), "hung", &[env!("CARGO_BIN_EXE_tracker_node")]).succeed_alone();
}

#[cfg(target_os = "linux")]
#[test]
fn a_node_that_grows_past_its_memory_ends_itself_and_says_so() {
    let domain = domain();
    let node = Node::start(domain, &["--ros-args", "-p", "limits.memory_mb:=64"]);
    node.wait_for("waits for images");
    peer(domain, "big_images", &[&node.id().to_string()]).succeed(&node);
    let (code, log) = node.finish();
    assert_eq!(code, Some(1), "{log}");
    let told = log.lines().find(|line| line.starts_with("error: resident memory of ")).expect("the error line");
    assert!(told.contains("64 MB that parameter 'limits.memory_mb' allows"), "{told}");
}
