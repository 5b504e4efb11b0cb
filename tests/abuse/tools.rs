//! What ROS's own tools bring along: launch, log files, clocks.

#![cfg(feature = "ros")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::support::{Environment, Peer, domain};

/// Until something that must happen has to have happened.
const DEADLINE: Duration = Duration::from_secs(60);

/// Runs a function of `tests/peer/tools.py`.
fn peer(function: &str) {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peer/tools.py");
    Peer::spawn(&mut Environment::get().python(), domain(), &script, &[function]).succeed_alone();
}

#[test]
fn the_follower_stops_when_it_should_and_keeps_its_limits() {
    peer("follow");
}

#[test]
fn launch_offers_the_presets_there_are_and_hands_the_file_to_the_node() {
    peer("launch");
}

/// The node with variables of its own, which it is started with.
struct Logging {
    child: Child,
    folder: tempfile::TempDir,
}

impl Logging {
    /// Starts it with these arguments; `FOLDER` in a variable stands for a new folder.
    fn start(variables: &[(&str, &str)], args: &[&str]) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().to_str().expect("a path of text");
        let mut command = Command::new(env!("CARGO_BIN_EXE_tracker_node"));
        for name in ["ROS_LOG_DIR", "ROS_HOME", "RUST_LOG", "ROS_LOCALHOST_ONLY"] {
            command.env_remove(name);
        }
        command.env("ROS_DOMAIN_ID", domain().to_string()).env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST");
        command.envs(variables.iter().map(|(name, value)| (name, value.replace("FOLDER", path))));
        command.args(["--ros-args", "-p", "lcmht.cnn.enabled:=off", "-r", "__ns:=/robot"]).args(args);
        let errors = fs::File::create(folder.path().join("stderr")).expect("a file for standard error");
        let child = command.stderr(errors).stdout(Stdio::null()).spawn().expect("the node started");
        Self { child, folder }
    }

    fn terminal(&self) -> String {
        fs::read_to_string(self.folder.path().join("stderr")).expect("standard error")
    }

    /// Waits until `text` holds the part.
    fn wait_for(&mut self, part: &str, text: impl Fn(&Self) -> String) {
        let end = Instant::now() + DEADLINE;
        while !text(self).contains(part) {
            let ended = self.child.try_wait().expect("the status of a child");
            assert!(Instant::now() < end && ended.is_none(), "no '{part}' in:\n{}", text(self));
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Ends it as a user does; its exit code.
    fn end(&mut self) -> Option<i32> {
        let sent = Command::new("kill").arg("-INT").arg(self.child.id().to_string()).status();
        assert!(sent.expect("kill").success());
        self.child.wait().expect("the status of a child").code()
    }

    /// The log files below the folder, with paths from there.
    fn files(&self) -> Vec<PathBuf> {
        let mut found = Vec::new();
        let mut folders = vec![self.folder.path().to_owned()];
        while let Some(folder) = folders.pop() {
            for path in fs::read_dir(folder).expect("a folder").flatten().map(|entry| entry.path()) {
                if path.is_dir() {
                    folders.push(path);
                } else if path.extension().is_some_and(|e| e == "log") {
                    found.push(path.strip_prefix(self.folder.path()).expect("below it").to_owned());
                }
            }
        }
        found
    }

    /// What the one log file holds.
    fn text(&self) -> String {
        let files = self.files();
        files.first().map(|file| fs::read_to_string(self.folder.path().join(file)).expect("text")).unwrap_or_default()
    }
}

impl Drop for Logging {
    fn drop(&mut self) {
        // It may be gone already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Level and text of each line.
fn without_times(log: &str) -> Vec<(&str, &str)> {
    log.lines()
        .filter_map(|line| line.split_once("] ["))
        .filter_map(|(level, rest)| Some((level, rest.split_once(']')?.1)))
        .collect()
}

#[test]
fn log_lines_go_to_a_file_where_those_of_other_nodes_lie() {
    for (variables, args, place) in [
        (&[("ROS_LOG_DIR", "FOLDER/logs")][..], &[][..], "logs/tracker_node_"),
        (&[("HOME", "FOLDER"), ("ROS_LOG_DIR", "~/logs")], &["--disable-stdout-logs"], "logs/tracker_node_"),
        (&[("HOME", "/"), ("ROS_HOME", "FOLDER/ros")], &[], "ros/log/tracker_node_"),
        (&[("HOME", "FOLDER")], &["--log-file-name", "eye"], ".ros/log/eye_"),
    ] {
        let mut node = Logging::start(variables, args);
        node.wait_for("waits for images", Logging::text);
        let process = node.child.id().to_string();
        assert_eq!(node.end(), Some(0), "{}", node.terminal());
        let files = node.files();
        let [file] = files.as_slice() else { panic!("{files:?}") };
        let rest = file.to_str().and_then(|file| file.strip_prefix(place)).expect("the place and the name");
        let numbers = rest.strip_suffix(".log").and_then(|rest| rest.split_once('_')).expect("two numbers");
        assert!(numbers.0 == process && numbers.1.parse::<u64>().is_ok_and(|ms| ms > 1_700_000_000_000), "{rest}");
        let text = node.text();
        assert!(text.lines().all(|line| line.starts_with('[')), "colours or broken lines in:\n{text}");
        assert!(text.contains("] [robot.tracker]: /robot/tracker waits for images on /robot/image\n"), "{text}");
        // The last line as the node ends is there too, and the terminal has what it has unless it is not to.
        let silent = args == ["--disable-stdout-logs"];
        assert_eq!(without_times(&node.terminal()), without_times(if silent { "" } else { &text }));
    }
}

#[test]
fn no_log_file_is_made_where_none_is_wanted_or_none_can_be() {
    let mut node = Logging::start(&[("ROS_LOG_DIR", "FOLDER/logs")], &["--disable-external-lib-logs"]);
    node.wait_for("waits for images", Logging::terminal);
    assert_eq!(node.end(), Some(0));
    assert!(node.files().is_empty(), "{:?}", node.files());

    let mut node = Logging::start(&[("ROS_LOG_DIR", "/proc/no/such")], &[]);
    node.wait_for("waits for images", Logging::terminal);
    assert_eq!(node.end(), Some(0));
    let terminal = node.terminal();
    assert_eq!(terminal.matches("no log file is written: /proc/no/such/tracker_node_").count(), 1, "{terminal}");
}

#[test]
fn why_the_node_did_not_start_is_in_its_log_file() {
    let mut node = Logging::start(&[("ROS_LOG_DIR", "FOLDER")], &["--params-file", "/no/such.yaml"]);
    assert_eq!(node.child.wait().expect("the status of a child").code(), Some(2));
    assert!(node.terminal().contains("error: parameter file /no/such.yaml: "), "{}", node.terminal());
    assert!(
        node.text().contains("[ERROR]") && node.text().contains("parameter file /no/such.yaml: "),
        "{}",
        node.text()
    );
}
