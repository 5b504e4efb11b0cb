//! The live page in a real Chromium, with a real rclpy camera.

#![cfg(all(feature = "ros", feature = "viewer"))]

mod support;
#[path = "support/venv.rs"]
mod venv;

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use support::{Environment, Node, Peer, domain, free_port};

/// Python that has rclpy and drives a browser.
fn python() -> Command {
    let browser = venv::python("browser", "tests/peer/requirements-browser.txt", None);
    let packages = Command::new(browser).args(["-c", "import site; print(site.getsitepackages()[0])"]).output();
    let packages = String::from_utf8(packages.expect("python").stdout).expect("a path");
    let mut python = Environment::get().python();
    let known = python.get_envs().find(|(name, _)| *name == "PYTHONPATH").and_then(|(_, path)| path);
    let path = format!("{}:{}", known.expect("the messages").display(), packages.trim());
    python.env("PYTHONPATH", path);
    python
}

/// Where screenshots are left for people to look at.
fn pictures() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("live-page");
    fs::create_dir_all(&folder).expect("a folder for pictures");
    folder
}

fn browse(domain: u32, scenario: &str, link: &str) -> Peer {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peer/browser.py");
    let pictures = pictures();
    Peer::spawn(&mut python(), domain, &script, &[scenario, link, pictures.to_str().expect("a path of text")])
}

/// A process that is ended with the test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // It may be gone already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_recording_is_marked_played_tuned_and_run_again_on_the_page() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a path of text").to_owned();
    fs::create_dir(path("frames")).expect("a folder for frames");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peer/browser.py");
    Peer::spawn(&mut python(), 0, &script, &["frames", &path("frames"), "60"]).succeed_alone();
    let mut track = Command::new(env!("CARGO_BIN_EXE_track"));
    track.args([&path("frames"), "--view", "--bag", &path("run.mcap"), "-p", "lcmht.cnn.enabled:=false"]);
    let mut track = Running(track.stderr(Stdio::piped()).spawn().expect("track started"));
    let mut told = BufReader::new(track.0.stderr.take().expect("standard error is piped")).lines();
    let link = told.find_map(|line| Some(line.ok()?.strip_prefix("live page: ")?.to_owned())).expect("a link");
    let pictures = pictures();
    // What an earlier run has saved.
    let _ = fs::remove_file(pictures.join("tracks.csv"));
    let pictures = pictures.to_str().expect("a path of text");
    Peer::spawn(&mut python(), 0, &script, &["recording", &link, pictures, &path("run.mcap")]).succeed_alone();
    let saved = fs::read_to_string(Path::new(pictures).join("tracks.csv")).expect("the rows");

    // The page's rows are those of the command with the same mark and parameters.
    let first: Vec<&str> = saved.lines().nth(1).expect("a row").split(',').collect();
    let mut again = Command::new(env!("CARGO_BIN_EXE_track"));
    again.args([&path("frames"), "--init", &first[..4].join(","), "-p", "lcmht.cnn.enabled:=false"]);
    let rows = again.args(["-p", "lcmht.filter.learning_rate:=0.05"]).output().expect("track");
    assert_eq!(saved, String::from_utf8(rows.stdout).expect("text"));
}

#[test]
fn a_target_is_marked_watched_tuned_and_stopped_on_the_page() {
    let domain = domain();
    let port = free_port();
    let args = ["--ros-args", "-p", "lcmht.cnn.enabled:=false", "-p", &format!("viewer.port:={port}")];
    let node = Node::start(domain, &args);
    node.wait_for("live page: http://127.0.0.1:");
    browse(domain, "live", &format!("http://127.0.0.1:{port}/")).succeed(&node);
    let log = node.end();
    assert!(log.contains("images ago"), "the mark was late:\n{log}");
}
