//! The node's parameters against rclpy's own client.

#![cfg(feature = "ros")]

mod support;

use support::scenario;

/// Sets of parameters while a target is followed. The demanded thousand take a few seconds.
const SETS: &str = "1000";

#[test]
fn the_services_serve_the_one_table() {
    let defaults = concat!(env!("CARGO_MANIFEST_DIR"), "/params/default.yaml");
    let log = scenario("parameters", &[defaults], &[]);
    assert!(log.contains("parameters refused: parameter 'debug.max_side' must be from 16 to 4096, got 5"), "{log}");
    assert!(!log.contains("ERROR"), "{log}");
}

#[test]
fn the_images_quality_of_service_is_what_the_parameters_say() {
    let mut file = tempfile::NamedTempFile::new().expect("a parameter file");
    let text = "/tracker: {ros__parameters: {qos_overrides: {/image: {subscription: {reliability: reliable, \
                durability: transient_local}}}}}";
    std::io::Write::write_all(&mut file, text.as_bytes()).expect("the file written");
    let path = file.path().to_str().expect("a path of text");
    let depth = "qos_overrides./image.subscription.depth:=3";
    scenario("overridden", &[], &["--ros-args", "--params-file", path, "-p", depth]);
}

#[test]
fn many_sets_tear_nothing_and_cost_no_frame() {
    // Without the network, which alone takes most of a frame's time on a small machine.
    scenario("many_sets", &[SETS], &["--ros-args", "--params-file", "params/fast.yaml"]);
}
