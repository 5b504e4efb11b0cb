//! What parameters may name and ask for, lines that peers can cause, and outputs that cannot be written.

use std::process::Command;

use image::ImageFormat;

#[cfg(feature = "ros")]
use super::fifo;
use super::{INIT, Ran, run, scene};
#[cfg(feature = "ros")]
use crate::support::{Node, scenario};

/// The network is a file, and of a size that may be.
#[cfg(feature = "ros")]
#[test]
fn a_network_is_a_regular_file_of_at_most_so_much() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).display().to_string();
    fifo(&dir.path().join("fifo"));
    std::fs::write(dir.path().join("large"), vec![0; 2_000_000]).unwrap();
    for (file, why) in [
        (path("fifo"), "it is a FIFO, expected a regular file"),
        ("/dev/zero".to_owned(), "it is a device, expected a regular file"),
        (path(""), "it is a folder, expected a regular file"),
        (path("large"), "2000000 bytes, limits.file_mb allows 1000000"),
    ] {
        let file_arg = format!("lcmht.cnn.file:={file}");
        let args = ["--ros-args", "-p", &file_arg, "-p", "limits.file_mb:=1", "-p", "lcmht.cnn.inference:=builtin"];
        let (code, log) = Node::start(1, &args).finish();
        let line = log.lines().find(|line| line.contains(&format!("network {file}")));
        assert!(code == Some(2) && line.is_some_and(|line| line.contains(why)), "{code:?}: {log}");
    }
}

/// The log of a node whose peers ask for what cannot be, again and again.
#[cfg(feature = "ros")]
#[test]
fn lines_that_peers_cause_are_held_back() {
    const SECONDS: &str = "3.5";
    let log = scenario("nagging", &[SECONDS], &["--ros-args", "-p", "lcmht.cnn.enabled:=false"]);
    for what in [
        "parameters refused: ",
        "mark refused: box",
        "mark refused: its id has 100000 bytes",
        "parameter debug.max_side is now ",
    ] {
        let lines: Vec<_> = log.lines().filter(|line| line.contains(what)).collect();
        let stamp = |line: &&str| line.split(['[', ']']).nth(3).and_then(|s| s.parse::<f64>().ok()).expect("a time");
        let all: Vec<f64> = lines.iter().map(stamp).collect();
        assert!(!all.is_empty(), "no line of '{what}' in:\n{log}");
        assert!(all.windows(2).all(|pair| pair[1] - pair[0] > 0.95), "{what}: {all:?}");
    }
    assert!(log.contains("more like it since the last one"), "{log}");
}

fn sequence() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let img = dir.path().join("one/img");
    std::fs::create_dir_all(&img).unwrap();
    for n in 0..200 {
        scene(n % 20).save_with_format(img.join(format!("{n:03}.png")), ImageFormat::Png).unwrap();
    }
    std::fs::write(dir.path().join("one/groundtruth_rect.txt"), "30,20,24,32\n".repeat(20)).unwrap();
    dir
}

fn shell(line: &str, program: &str, args: &[&str]) -> Ran {
    run(Command::new("sh").args(["-c", line, "sh", program]).args(args))
}

#[test]
fn outputs_that_cannot_be_written_end_a_command_in_order() {
    let dir = sequence();
    let (one, all) = (dir.path().join("one"), dir.path().display().to_string());
    let one = one.display().to_string();
    let track = [&[&one[..]], &INIT[..]].concat();
    let evaluate = [&all[..], "-p", "lcmht.cnn.enabled:=false"];
    for (program, args) in [(env!("CARGO_BIN_EXE_track"), &track[..]), (env!("CARGO_BIN_EXE_evaluate"), &evaluate)] {
        let ran = shell("\"$@\" 2>/dev/full", program, args);
        assert!(ran.code == Some(0) && !ran.out.is_empty(), "{program}: {:?}", ran.code);
        let ran = shell("\"$@\" >/dev/full", program, args);
        assert_eq!(ran.code, Some(1), "{program}: {}", ran.err);
        assert!(ran.err.contains("standard output: cannot be written: No space left"), "{program}: {}", ran.err);
        let ran = shell("\"$@\" >/dev/full 2>/dev/full", program, args);
        assert_eq!(ran.code, Some(1), "{program}");
        let ran = shell("\"$@\" 2>&1 >&3 3>&- | head -c 0; exec 3>&-", program, args);
        assert!(!ran.err.contains("panicked"), "{program}: {}", ran.err);
        let ran = shell("\"$@\" | head -n 1", program, args);
        assert!(ran.code == Some(0) && !ran.err.contains("error") && !ran.err.contains("panicked"), "{}", ran.err);
        let ran = shell("\"$@\" --no-such 2>/dev/full", program, args);
        assert_eq!(ran.code, Some(2), "{program}");
    }
}

#[cfg(feature = "ros")]
#[test]
fn a_node_that_cannot_write_ends_in_order() {
    let node = env!("CARGO_BIN_EXE_tracker_node");
    let ran = shell("\"$@\" 2>/dev/full", node, &["--ros-args", "-p", "seed:=x"]);
    assert_eq!(ran.code, Some(2));
    let ran = shell("\"$@\" >/dev/full", node, &["--help"]);
    assert!(!ran.err.contains("panicked"), "{}", ran.err);
}
