//! What may come into the node, sent by a real rclpy process. Each test has a ROS domain of its own.

#![cfg(feature = "ros")]

mod support;

use support::{Node, Peer, domain};

/// Runs a function of `tests/peer/input.py` against a node, then ends the node; gives what it wrote.
fn scenario(name: &str, args: &[&str]) -> String {
    let domain = domain();
    let mut all = vec!["--ros-args", "-p", "lcmht.cnn.enabled:=false"];
    all.extend(args);
    let node = Node::start(domain, &all);
    Peer::start(domain, name, &[]).succeed(&node);
    node.signal("INT");
    let (code, log) = node.finish();
    assert_eq!(code, Some(0), "{log}");
    log
}

#[test]
fn every_encoding_is_tracked_and_shown() {
    let log = scenario("encodings", &[]);
    assert!(!log.contains("ERROR"), "{log}");
}

#[test]
fn compressed_images_of_each_format_are_tracked() {
    let log = scenario("compressed", &["-p", "image_transport:=compressed", "-r", "image:=/camera/image_raw"]);
    assert!(log.contains("waits for images on /camera/image_raw/compressed"), "{log}");
    assert!(log.contains("first image on /camera/image_raw/compressed: 320 x 240 rgb8"), "{log}");
    assert!(!log.contains(" 0 rejected"), "{log}");
}

#[test]
fn a_mark_starts_on_the_frame_that_it_names() {
    scenario("named_marks", &["-p", "history.frames:=12"]);
}

#[test]
fn what_changes_in_mid_stream_does_not_end_the_track() {
    scenario("changing_stream", &[]);
}
