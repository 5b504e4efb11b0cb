//! What may come into the node, sent by a real rclpy process. Each test has a ROS domain of its own.

#![cfg(feature = "ros")]

mod support;

use support::scenario;

/// Runs a scenario without the network, whose features are not what is tested here.
fn input(name: &str, args: &[&str]) -> String {
    scenario(name, &[], &[&["--ros-args", "-p", "lcmht.cnn.enabled:=false"], args].concat())
}

#[test]
fn every_encoding_is_tracked_and_shown() {
    let log = input("encodings", &[]);
    assert!(!log.contains("ERROR"), "{log}");
}

#[test]
fn compressed_images_of_each_format_are_tracked() {
    let log = input("compressed", &["-p", "image_transport:=compressed", "-r", "image:=/camera/image_raw"]);
    assert!(log.contains("waits for images on /camera/image_raw/compressed"), "{log}");
    assert!(log.contains("first image on /camera/image_raw/compressed: 320 x 240 rgb8"), "{log}");
    assert!(!log.contains(" 0 rejected"), "{log}");
}

#[test]
fn a_mark_starts_on_the_frame_that_it_names() {
    input("named_marks", &["-p", "history.frames:=12"]);
}

#[test]
fn what_changes_in_mid_stream_does_not_end_the_track() {
    input("changing_stream", &[]);
}
