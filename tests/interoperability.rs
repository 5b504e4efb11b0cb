//! The node against peers that are not ROS 2 Jazzy's: rclpy of ROS 2 Kilted, and Cyclone DDS without ROS.

#![cfg(feature = "ros")]

mod support;

use std::path::Path;

use support::{Environment, Node, Peer, domain};

fn kilted(scenario: &str, args: &[&str], domain: u32, node: &Node) {
    Peer::of(Environment::kilted(), domain, scenario, args).succeed(node);
}

#[test]
fn kilted_marks_follows_sees_debug_images_sets_a_parameter_stops_and_restarts() {
    let domain = domain();
    let node = Node::start(domain, &[]);
    kilted("whole_life", &[&node.id().to_string(), "lcmht"], domain, &node);
    let (code, log) = node.finish();
    assert_eq!(code, Some(0), "{log}");
    assert!(!log.contains("ERROR") && !log.contains("rustdds"), "{log}");
}

#[test]
fn kilted_reads_and_writes_every_parameter() {
    let domain = domain();
    let node = Node::start(domain, &[]);
    let defaults = concat!(env!("CARGO_MANIFEST_DIR"), "/params/default.yaml");
    kilted("parameters", &[defaults], domain, &node);
}

#[test]
fn cyclone_dds_marks_a_target_and_receives_tracks_and_detections() {
    let domain = domain();
    let node = Node::start(domain, &[]);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peer/cyclone.py");
    Peer::spawn(&mut Environment::get().python(), domain, &script, &[]).succeed(&node);
    node.end();
}
