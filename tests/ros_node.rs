//! The node against a real rclpy process. Each test has a ROS domain of its own, on the loopback interface.

#![cfg(feature = "ros")]

mod support;

use std::io::Write as _;
use std::process::Command;
use std::time::Instant;

use support::{Node, Peer, domain, scenario, slowness};

#[test]
fn a_target_is_marked_followed_stopped_and_taken_up_again() {
    whole_life("lcmht");
}

#[test]
fn the_other_tracker_is_told_and_shown_alike() {
    whole_life("etepf");
}

#[test]
fn what_moves_is_found_told_and_shown_without_a_mark() {
    let log = scenario("found", &[], &["--params", "maptrack"]);
    assert!(!log.contains("ERROR") && !log.contains("rustdds"), "{log}");
}

fn whole_life(algorithm: &str) {
    let domain = domain();
    let node = Node::start(domain, &["--ros-args", "-p", &format!("algorithm:={algorithm}")]);
    Peer::start(domain, "whole_life", &[&node.id().to_string(), algorithm]).succeed(&node);
    let (code, log) = node.finish();
    assert_eq!(code, Some(0), "{log}");
    for part in
        ["first image on /image: 320 x 240 rgb8", "target 0 marked", "restarted", "parameter debug.max_side is now 64"]
    {
        assert!(log.contains(part), "no '{part}' in:\n{log}");
    }
    assert!(!log.contains("ERROR") && !log.contains("rustdds"), "{log}");
}

#[test]
fn bad_input_is_told_and_changes_nothing() {
    let log = scenario("bad_input", &[], &[]);
    assert!(
        log.contains("image refused: step of 959 bytes is shorter than a row of 320 rgb8 pixels (960 bytes)"),
        "{log}"
    );
    assert!(log.contains("mark refused: box 500 x 3 at (10, 10) is too small"), "{log}");
}

#[test]
fn the_node_tells_of_its_health() {
    scenario("diagnostics", &[], &[]);
}

#[test]
fn a_subscriber_that_stands_still_holds_up_nothing() {
    let domain = domain();
    let node = Node::start(domain, &[]);
    Peer::start(domain, "stuck_looker", &[&node.id().to_string()]).succeed(&node);
}

#[test]
fn the_node_and_the_offline_command_give_the_same_boxes() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().to_str().expect("a path of text");
    let domain = domain();
    let node = Node::start(domain, &[]);
    Peer::start(domain, "offline", &[path]).succeed(&node);
    let said = std::fs::read_to_string(folder.path().join("node.txt")).expect("what the node said");
    let said: Vec<[f64; 5]> = said.lines().map(|line| numbers(line.split(' '))).collect();

    let rows = offline(path, corner(&said[0]));
    assert_eq!(rows.len(), said.len());
    for (frame, (row, said)) in rows.iter().zip(&said).enumerate() {
        assert_eq!(row, said, "frame {frame}");
    }
}

#[test]
fn a_recording_played_to_the_node_gives_the_boxes_of_the_offline_command() {
    for hurried in [0, 12] {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name).to_str().expect("a path of text").to_owned();
        let domain = domain();
        let node = Node::start(domain, &[]);
        Peer::start(domain, "replay", &[&path(""), &hurried.to_string()]).succeed(&node);
        let said = std::fs::read_to_string(path("node.txt")).expect("what the node said");
        let said: Vec<[f64; 6]> = said.lines().map(|line| numbers(line.split(' '))).collect();
        let said: Vec<(usize, [f64; 5])> = said.iter().map(|&[n, ref x @ ..]| (n as usize, *x)).collect();
        // Those that are not hurried are waited for; one or two may be lost on the way.
        assert!(said.len() + hurried + 2 >= 90, "of 90 images the node looked at {}", said.len());

        // On what both saw they agree, whatever was skipped.
        let init = corner(&said[0].1);
        let seen = offline(&path("seen"), init);
        assert_eq!(seen, said.iter().map(|(_, said)| *said).collect::<Vec<_>>(), "hurried: {hurried}");
        // The whole recording teaches the offline command what the node could not know, from the first gap on.
        let all = offline(&path("recorded"), init);
        for (n, said) in said.iter().enumerate().take_while(|(n, (number, _))| n == number).map(|(n, (_, s))| (n, s)) {
            assert_eq!(all[n], *said, "frame {n}, hurried: {hurried}");
        }
    }
}

/// The box on the first image, as an argument.
fn corner(&[x, y, w, h, _]: &[f64; 5]) -> [f64; 4] {
    [x - w / 2.0, y - h / 2.0, w, h]
}

/// What `track` says of each frame, in the terms of the messages: centre, size, number of the state.
fn offline(source: &str, init: [f64; 4]) -> Vec<[f64; 5]> {
    let init = init.map(|v| v.to_string()).join(",");
    let output = Command::new(env!("CARGO_BIN_EXE_track")).args([source, "--init", &init]).output().expect("track ran");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let csv = String::from_utf8(output.stdout).expect("text");
    let row = |row: &str| {
        let words: Vec<_> = row.split(',').collect();
        let [x, y, w, h] = numbers(words[..4].iter().copied());
        let state = ["tracking", "uncertain", "lost"].iter().position(|s| *s == words[5]).expect("a state") as f64;
        // The message holds the centre, computed from the same corner in the same way.
        [x + w / 2.0, y + h / 2.0, w, h, state]
    };
    csv.lines().skip(1).map(row).collect()
}

fn numbers<'a, const N: usize>(texts: impl Iterator<Item = &'a str>) -> [f64; N] {
    let all: Vec<f64> = texts.map(|t| t.parse().expect("a number")).collect();
    all.try_into().expect("as many numbers as there should be")
}

#[test]
fn names_and_parameters_are_what_the_arguments_say() {
    let mut file = tempfile::NamedTempFile::new().expect("a parameter file");
    let text = "/robot/front/eye: {ros__parameters: {seed: 11, debug: {max_side: 99, jpeg_quality: 77}}}\n\
                /tracker: {ros__parameters: {seed: 12}}\n\
                /**: {ros__parameters: {a_parameter_of_another_node: 1}}\n";
    file.write_all(text.as_bytes()).expect("the file written");
    let path = file.path().to_str().expect("a path of text");
    let args = [
        "--ros-args",
        "-r",
        "__ns:=/robot/front",
        "-r",
        "__node:=eye",
        "-r",
        "image:=/camera/image_raw",
        "--",
        "--ros-args",
        "-r",
        "~/tracks:=/robot/boxes",
        "-r",
        "rosservice://~/stop:=/robot/halt",
        "--params-file",
        path,
        "-p",
        "debug.max_side:=100",
        "--log-level",
        "debug",
    ];
    let log = scenario("renamed", &[], &args);
    assert!(log.contains("[robot.front.eye]: /robot/front/eye waits for images on /camera/image_raw"), "{log}");
    assert!(log.contains("unknown parameter 'a_parameter_of_another_node'"), "{log}");
    assert!(log.contains("[DEBUG]"), "{log}");
}

/// On an idle machine; on another it is asked for in one of three trials.
#[test]
fn signals_end_the_node_within_a_second() {
    let seconds = |signal| {
        let node = Node::start(domain(), &[]);
        node.wait_for("waits for images");
        let sent = Instant::now();
        node.signal(signal);
        let (code, log) = node.finish();
        let took = sent.elapsed().as_secs_f64();
        assert_eq!(code, Some(0), "{log}");
        took / slowness()
    };
    for signal in ["INT", "TERM"] {
        let least = (0..3).map(|_| seconds(signal)).fold(f64::INFINITY, f64::min);
        assert!(least < 1.0, "{signal}: {least} s");
    }
}

#[test]
fn what_is_waited_for_is_told_when_no_image_comes() {
    let node = Node::start(domain(), &[]);
    node.wait_for("no image on /image after 5 s (best_effort, volatile); publishers there: none");
    let log =
        scenario("mismatched", &[], &["--ros-args", "-p", "qos_overrides./image.subscription.reliability:=reliable"]);
    for part in [
        "one that does not match: it is best_effort, reliable is requested",
        "other topics with images: /camera/image_raw",
    ] {
        assert!(log.contains(part), "no '{part}' in:\n{log}");
    }
}

#[test]
fn a_start_that_cannot_be_is_one_line_and_an_exit_code() {
    let mut file = tempfile::NamedTempFile::new().expect("a file");
    file.write_all(b"a: [no: yaml").expect("the file written");
    let path = file.path().to_str().expect("a path of text");
    let node = |args: &[&str], variables: &[(&str, &str)]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tracker_node"));
        command.env("ROS_LOG_DIR", concat!(env!("CARGO_TARGET_TMPDIR"), "/log"));
        let output = command.args(args).envs(variables.iter().copied()).output().expect("the node ran");
        let text = String::from_utf8(output.stderr).expect("text") + &String::from_utf8_lossy(&output.stdout);
        (output.status.code(), text)
    };
    for (args, variables, part) in [
        (&["--ros-args", "--params-file", path][..], &[][..], path),
        (&["--ros-args", "--params-file", "/no/such/file.yaml"], &[], "/no/such/file.yaml"),
        (&["--ros-args", "-p", "debug.max_side:=5"], &[], "'debug.max_side' must be from 16 to 4096, got 5"),
        (&["--ros-args", "-p", "debug.max_side:=wide"], &[], "'debug.max_side' is of type integer, got string"),
        (
            &["--ros-args", "-p", "lcmht.cnn.enabled:=true", "-p", "lcmht.cnn.file:=/no/such.onnx"],
            &[],
            "network /no/such.onnx cannot be read",
        ),
        (&["--ros-args", "--frobnicate"], &[], "'--frobnicate'"),
        (&["--ros-args", "-r", "__node:=a/b"], &[], "'a/b'"),
        (&[], &[("ROS_DOMAIN_ID", "many")], "ROS_DOMAIN_ID=many"),
    ] {
        let (code, text) = node(args, variables);
        assert_eq!(code, Some(2), "{args:?}: {text}");
        assert!(text.lines().count() == 1 && text.contains(part), "{args:?}: {text}");
    }
    let (code, text) = node(&["--help"], &[]);
    assert!(code == Some(0) && text.contains("--params-file"), "{text}");
    let (code, text) = node(&["--version"], &[]);
    assert!(code == Some(0) && text.contains(env!("CARGO_PKG_VERSION")), "{text}");
    let (code, text) = node(&["--list-presets"], &[]);
    assert!(code == Some(0) && text.starts_with("default ") && text.contains("\nfast "), "{text}");
    let (code, text) = node(&["--params", "fsat"], &[]);
    assert!(code == Some(2) && text.contains("presets are default, fast, "), "{text}");
    let (code, _) = node(&["--nonsense"], &[]);
    assert_eq!(code, Some(2));
}
