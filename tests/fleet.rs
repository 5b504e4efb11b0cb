//! Many recordings at once: `track --out`, and `examples/fleet.py`, which spreads it over machines.

#[path = "support/venv.rs"]
mod venv;

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::{MetadataExt as _, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use serde_json::{Value, json};
use tempfile::TempDir;

const TRACK: &str = env!("CARGO_BIN_EXE_track");
/// Frames of a recording of the tests here; the clip of the demo has more.
const FRAMES: usize = 12;
/// The target on the first frame of the clip, and others that can be followed there.
const MARK: &str = "528,182,31,101";
const MARKS: [&str; 4] = [MARK, "529,183,30,100", "526,184,32,98", "528.5,190.25,30,80"];
/// Without the network, which says nothing of fleets.
const FAST: [&str; 2] = ["-p", "lcmht.cnn.enabled:=false"];

fn clip() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/demo/img")
}

/// A folder with a recording of each name: the first frames of the clip, and a mark beside them.
fn recordings(names: &[&str]) -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    let mut images: Vec<PathBuf> = fs::read_dir(clip()).unwrap().map(|entry| entry.unwrap().path()).collect();
    images.sort();
    for (name, mark) in names.iter().zip(MARKS) {
        let img = dir.path().join(name).join("img");
        fs::create_dir_all(&img).unwrap();
        images[..FRAMES].iter().for_each(|image| symlink(image, img.join(image.file_name().unwrap())).unwrap());
        fs::write(img.parent().unwrap().join("groundtruth_rect.txt"), format!("{mark}\n")).unwrap();
    }
    dir
}

fn command(dir: &Path, names: &[&str], args: &[&str]) -> Command {
    let mut command = Command::new(TRACK);
    command.current_dir(dir).args(names).args(FAST).args(args);
    command
}

fn track(dir: &Path, names: &[&str], args: &[&str]) -> Output {
    command(dir, names, args).output().unwrap()
}

#[track_caller]
fn assert_ends(output: &Output, code: i32, message: &str) {
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{told}");
    assert!(told.contains(message), "{message} in:\n{told}");
}

/// The files of a folder with their bytes.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    entries.map(|e| (e.file_name().into_string().unwrap(), fs::read(e.path()).unwrap())).collect()
}

fn names(folder: &Path) -> Vec<String> {
    files(folder).into_keys().collect()
}

fn summary(folder: &Path) -> Value {
    serde_json::from_slice(&fs::read(folder.join("summary.json")).unwrap()).unwrap()
}

#[test]
fn each_recording_gets_the_rows_that_it_gets_alone_and_is_tracked_once() {
    let all = ["a", "b", "c"];
    let dir = recordings(&all);
    let out = dir.path().join("out");
    let output = track(dir.path(), &all, &["--out", "out", "--threads", "2"]);
    assert_ends(&output, 0, "3 recordings: 3 finished, of which 0 before, 0 failed; 36 frames, ");
    assert_eq!(names(&out), ["a.csv", "b.csv", "c.csv", "parameters.yaml", "summary.json"]);
    for name in all {
        let alone = track(dir.path(), &[name], &[]);
        assert_ends(&alone, 0, "12 frames");
        assert_eq!(files(&out)[&format!("{name}.csv")], alone.stdout, "{name}");
    }
    let told = summary(&out);
    assert_eq!((&told["finished"], &told["failed"]), (&json!(3), &json!(0)));
    let b = &told["recordings"][1];
    assert_eq!(
        (&b["name"], &b["source"], &b["frames"], &b["losses"]),
        (&json!("b"), &json!("b"), &json!(12), &json!(0))
    );
    assert!(b["tracking"].as_u64().unwrap() > 6, "{b}");

    let inode = |name: &str| fs::metadata(out.join(name)).unwrap().ino();
    let (before, inodes) = (files(&out), ["a.csv", "c.csv"].map(inode));
    fs::remove_file(out.join("b.csv")).unwrap();
    assert_eq!(track(dir.path(), &all, &["--out", "out", "--pending"]).stdout, b"b\n");
    assert_ends(&track(dir.path(), &all, &["--out", "out"]), 0, "3 finished, of which 2 before, 0 failed; 12 frames");
    assert!((files(&out), ["a.csv", "c.csv"].map(inode)) == (before, inodes), "the summary is that of one run");
}

#[test]
fn a_recording_that_fails_is_told_and_the_others_go_on() {
    let all = ["a", "broken", "unmarked", "missing"];
    let dir = recordings(&all[..3]);
    let images = dir.path().join("broken/img");
    let image = images.join(&names(&images)[5]);
    let target = fs::read_link(&image).unwrap();
    fs::remove_file(&image).unwrap();
    fs::write(&image, "no image").unwrap();
    fs::remove_file(dir.path().join("unmarked/groundtruth_rect.txt")).unwrap();
    let output = track(dir.path(), &all, &["--out", "out"]);
    assert_ends(&output, 1, "error: 3 of 4 recordings failed");
    let out = dir.path().join("out");
    assert_eq!(names(&out), ["a.csv", "parameters.yaml", "summary.json"], "nothing of what failed");
    let told = summary(&out);
    for (i, reason) in [(1, "cannot be decoded"), (2, "no target: give --init"), (3, "no such file or folder")] {
        let error = told["recordings"][i]["error"].as_str().unwrap();
        assert!(error.contains(reason), "{error}");
        assert_ends(&output, 1, &format!("error: {}: {error}", all[i]));
    }

    fs::remove_file(&image).unwrap();
    symlink(target, &image).unwrap();
    fs::write(dir.path().join("marks.csv"), format!("name,x,y,w,h\nunmarked,{MARK}\n")).unwrap();
    let again = track(dir.path(), &all[..3], &["--out", "out", "--marks", "marks.csv"]);
    assert_ends(&again, 0, "3 finished, of which 1 before, 0 failed; 24 frames");
}

#[test]
fn a_run_that_is_killed_leaves_nothing_that_counts() {
    let all = ["a", "b", "c", "d"];
    let dir = recordings(&all);
    assert_ends(&track(dir.path(), &all, &["--out", "whole"]), 0, "4 finished");
    let out = dir.path().join("out");
    let mut run = command(dir.path(), &all, &["--out", "out", "--threads", "1"]).stderr(Stdio::null()).spawn().unwrap();
    // Whatever it is at when it ends.
    while run.try_wait().unwrap().is_none() && !(out.join("a.csv").exists()) {
        std::thread::sleep(Duration::from_millis(1));
    }
    run.kill().unwrap();
    run.wait().unwrap();
    let whole = files(&dir.path().join("whole"));
    let left = files(&out);
    assert!(left.contains_key("a.csv"), "{:?}", left.keys());
    assert!(left.iter().filter(|(name, _)| name.ends_with(".csv")).all(|(name, rows)| whole[name] == *rows));
    assert_ends(&track(dir.path(), &all, &["--out", "out"]), 0, "4 finished");
    let mut now = files(&out);
    now.retain(|name, _| !name.starts_with(".partial-"));
    assert!(now == whole, "{:?}", now.keys());
}

#[test]
fn rows_of_other_parameters_or_marks_do_not_count() {
    let dir = recordings(&["a", "b"]);
    let marks = |text: &str| fs::write(dir.path().join("marks.csv"), text).unwrap();
    let run = |args: &[&str]| track(dir.path(), &["a", "b"], &[&["--out", "out"], args].concat());
    marks(&format!("a,{MARK}\n"));
    assert_ends(&run(&["--marks", "marks.csv"]), 0, "2 finished");
    assert_ends(&run(&["--marks", "marks.csv"]), 0, "2 finished, of which 2 before");
    marks(&format!("a,{}\n", MARKS[3]));
    assert_ends(&run(&["--marks", "marks.csv"]), 0, "2 finished, of which 1 before");
    assert_ends(&run(&["--marks", "marks.csv"]), 0, "2 finished, of which 2 before");
    assert_ends(&run(&["-p", "seed:=7"]), 2, "out/parameters.yaml: the rows there were made with seed = 0, not 7");

    fs::write(dir.path().join("out/a.csv"), "mine\n").unwrap();
    assert_ends(&run(&[]), 1, "error: a: out/a.csv, line 1: 'mine' is not a row of track");
    assert_eq!(fs::read(dir.path().join("out/a.csv")).unwrap(), b"mine\n");
}

#[test]
fn what_cannot_be_meant_is_refused() {
    let dir = recordings(&["a", "b"]);
    fs::create_dir(dir.path().join("c")).unwrap();
    fs::rename(dir.path().join("b"), dir.path().join("c/a")).unwrap();
    fs::write(dir.path().join("marks.csv"), "a,1,2,3\n").unwrap();
    let refused = |names: &[&str], args: &[&str], why| assert_ends(&track(dir.path(), names, args), 2, why);
    refused(&["a", "c/a"], &[], "2 recordings: give --out DIR");
    refused(&["a", "c/a"], &["--out", "out"], "a and c/a have the same name 'a'");
    refused(
        &["a"],
        &["--out", "out", "--marks", "marks.csv"],
        "marks.csv, line 1: 'a,1,2,3' is not a box: it must hold",
    );
    refused(&["a"], &["--out", "out", "--marks", "none.csv"], "none.csv: No such file");
    refused(&["a"], &["--marks", "marks.csv"], "--out");
    refused(&["a"], &["--out", "out", "--output", "rows.csv"], "--output");
    refused(&["a"], &["--out", "marks.csv"], "marks.csv: cannot be written");
    assert!(!dir.path().join("out").exists());
}

/// One box for all, other trackers, and a name for `.`.
#[test]
fn every_tracker_follows_fleets() {
    let dir = recordings(&["a", "b"]);
    for (algorithm, b) in [("etepf", "tracking"), ("maptrack", "targets")] {
        let args = ["--out", algorithm, "--algorithm", algorithm, "--init", MARKS[3]];
        assert_ends(&track(dir.path(), &["a", "b"], &args), 0, "2 finished, of which 0 before");
        assert!(summary(&dir.path().join(algorithm))["recordings"][1][b].as_u64().unwrap() > 0);
        assert_ends(&track(dir.path(), &["a", "b"], &args), 0, "2 finished, of which 2 before");
        let rows = files(&dir.path().join(algorithm));
        assert_eq!(rows["a.csv"], rows["b.csv"], "the box is the same");
    }
    let here = dir.path().join("a");
    assert_ends(&track(&here, &["."], &["--out", "out"]), 0, "1 finished");
    assert!(here.join("out/a.csv").exists());
}

/// Two Ray nodes on loopback, one of which is killed while it tracks.
#[test]
fn the_rows_of_machines_are_those_of_one_though_another_is_lost() {
    let python = venv::python("ray", "tests/peer/requirements-ray.txt", None);
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let all: Vec<String> = (0..8).map(|i| format!("r{i}")).collect();
    let mut marks = String::new();
    for (i, name) in all.iter().enumerate() {
        symlink(clip(), path(name)).unwrap();
        marks += &format!("{name},{},{},30,{}\n", 528 + i % 2, 182 + i / 2, 92 + i);
    }
    fs::create_dir(path("empty")).unwrap();
    fs::write(path("marks.csv"), marks).unwrap();
    let all: Vec<&str> = all.iter().map(String::as_str).chain(["empty"]).collect();
    let options = ["-p", "lcmht.cnn.enabled:=false", "--marks", "marks.csv"];

    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut fleet = Command::new("unshare");
    fleet.args(["--map-root-user", "--net", "--pid", "--fork", "--kill-child", "--mount-proc"]).arg(python);
    fleet.arg("-B").arg(root.join("tests/peer/fleet.py")).arg(TRACK).arg("spread").arg(path("ray"));
    let fleet = fleet.current_dir(dir.path()).args(&all).arg("--").args(options).output().unwrap();
    assert_ends(&fleet, 1, "error: 1 of 9 recordings failed");
    let told = String::from_utf8_lossy(&fleet.stdout);
    assert!(told.contains("killed the node that had tracked r"), "{told}");

    assert_ends(&track(dir.path(), &all, &[&["--out", "single"], &options[2..]].concat()), 1, "8 finished");
    let (spread, single) = (files(&path("spread")), files(&path("single")));
    assert_eq!(spread.keys().collect::<Vec<_>>(), single.keys().collect::<Vec<_>>());
    assert!(spread == single, "the same bytes");
    let rows: Vec<_> = all[..8].iter().map(|name| &single[&format!("{name}.csv")]).collect();
    assert!(rows.windows(2).all(|pair| pair[0] != pair[1]), "the marks differ, and so do the rows");
}
