//! The offline commands as a user runs them: the real binaries on folders of images made here.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use image::{Rgb, RgbImage};
use long_term_tracker::Rect;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tempfile::TempDir;

const SIZE: (u32, u32) = (160, 120);
const FRAMES: usize = 10;

/// The target's true box on a frame.
fn target(frame: usize) -> Rect {
    Rect::new(30.0 + 3.0 * frame as f64, 40.0 + frame as f64, 24.0, 32.0)
}

fn noise(seed: u64, width: u32, height: u32, dark: bool) -> RgbImage {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let range = if dark { 20..90 } else { 60..250 };
    // Blocks of 4 px, so that features of 4 px cells have something to hold on to.
    let (cols, rows) = (width.div_ceil(4), height.div_ceil(4));
    let cells: Vec<[u8; 3]> =
        (0..cols * rows).map(|_| std::array::from_fn(|_| rng.random_range(range.clone()))).collect();
    RgbImage::from_fn(width, height, |x, y| Rgb(cells[(y / 4 * cols + x / 4) as usize]))
}

/// Writes a sequence of a textured target on a textured ground: `img/1.png` to `img/10.png`, and the true boxes,
/// none on the fourth frame.
fn write_sequence(folder: &Path) {
    let (ground, figure) = (noise(1, SIZE.0, SIZE.1, true), noise(2, 24, 32, false));
    let img = folder.join("img");
    std::fs::create_dir_all(&img).unwrap();
    let mut truth = String::new();
    for frame in 0..FRAMES {
        let t = target(frame);
        let mut image = ground.clone();
        image::imageops::replace(&mut image, &figure, t.x as i64, t.y as i64);
        image.save(img.join(format!("{}.png", frame + 1))).unwrap();
        let row = format!("{}\t{}\t{}\t{}\n", t.x, t.y, t.w, t.h);
        truth += if frame == 3 { "NaN\tNaN\tNaN\tNaN\n" } else { &row };
    }
    std::fs::write(folder.join("groundtruth_rect.txt"), truth).unwrap();
}

fn sequence() -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    write_sequence(dir.path());
    dir
}

fn track(source: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_track")).arg(source).args(args).output().unwrap()
}

fn evaluate(dataset: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_evaluate")).arg(dataset).args(args).output().unwrap()
}

fn stdout(output: &Output) -> &str {
    std::str::from_utf8(&output.stdout).unwrap()
}

fn stderr(output: &Output) -> &str {
    std::str::from_utf8(&output.stderr).unwrap()
}

/// The box, confidence and state of each row, after a check of the header.
fn rows(csv: &str) -> Vec<(Rect, f64, String)> {
    let mut lines = csv.lines();
    assert_eq!(lines.next(), Some("x,y,w,h,confidence,state"));
    lines
        .map(|line| {
            let words: Vec<&str> = line.split(',').collect();
            let &[x, y, w, h, confidence, state] = words.as_slice() else { panic!("{line}") };
            let number = |word: &str| word.parse::<f64>().unwrap();
            (Rect::new(number(x), number(y), number(w), number(h)), number(confidence), state.to_owned())
        })
        .collect()
}

#[track_caller]
fn assert_refused(output: &Output, code: i32, message: &str) {
    assert_eq!(output.status.code(), Some(code), "{}", stderr(output));
    assert!(stderr(output).contains(message), "{}", stderr(output));
    assert!(!stderr(output).contains("panicked"), "{}", stderr(output));
}

#[test]
fn a_row_a_frame_goes_to_standard_output_and_the_speed_to_standard_error() {
    let dir = sequence();
    let output = track(dir.path(), &[]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let rows = rows(stdout(&output));
    assert_eq!(rows.len(), FRAMES);
    assert_eq!((rows[0].0, rows[0].2.as_str()), (target(0), "tracking"));
    assert!(rows[0].1 > 0.7 && rows[0].1 <= 1.0, "{}", rows[0].1);
    for (frame, (rect, confidence, state)) in rows.iter().enumerate() {
        assert!(rect.iou(&target(frame)) > 0.5, "frame {frame}: {rect}");
        assert!(*confidence >= 0.0 && ["tracking", "uncertain", "lost"].contains(&state.as_str()));
    }
    let line = stderr(&output);
    assert_eq!(line.lines().count(), 1, "no bar where there is no terminal: {line}");
    assert!(line.starts_with("10 frames, ") && line.contains(" frames/s (features "), "{line}");
}

/// The target moves over a still ground, and nobody marks it; with a mark it is the first from the first frame on.
#[test]
fn maptrack_needs_no_box_and_writes_rows_of_motchallenge() {
    let dir = sequence();
    std::fs::remove_file(dir.path().join("groundtruth_rect.txt")).unwrap();
    let args = ["--algorithm", "maptrack", "-p", "maptrack.find.start:=5.0"];
    for init in [None, Some("30,40,24,32")] {
        let marked: Vec<&str> = init.iter().flat_map(|init| ["--init", init]).collect();
        let output = track(dir.path(), &[&args[..], &marked].concat());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let rows: Vec<Vec<f64>> =
            stdout(&output).lines().map(|line| line.split(',').map(|word| word.parse().unwrap()).collect()).collect();
        assert!(!rows.is_empty() && rows.iter().all(|row| row.len() == 10 && row[7..] == [-1.0; 3]), "{rows:?}");
        let frames: Vec<usize> = rows.iter().map(|row| row[0] as usize).collect();
        assert!(frames.is_sorted() && frames[frames.len() - 1] == FRAMES, "{frames:?}");
        assert_eq!(frames[0] == 1, init.is_some(), "{frames:?}");
        let last = &rows[rows.len() - 1];
        let rect = Rect::new(last[2], last[3], last[4], last[5]);
        assert!(init.is_none() || rect.iou(&target(FRAMES - 1)) > 0.5, "{rect}");
    }
    assert_refused(&track(dir.path(), &[]), 2, "no target: give --init X,Y,W,H");
}

#[test]
fn a_folder_of_images_file_output_and_an_explicit_box_give_the_same_rows() {
    let dir = sequence();
    let csv = dir.path().join("boxes.csv");
    let output = track(&dir.path().join("img"), &["--output", csv.to_str().unwrap(), "--init", "30,40,24,32"]);
    assert_eq!((output.status.code(), stdout(&output)), (Some(0), ""));
    assert_eq!(std::fs::read_to_string(&csv).unwrap(), stdout(&track(dir.path(), &[])));
}

#[test]
fn unusable_arguments_end_with_2_and_the_reason() {
    let dir = sequence();
    let empty = tempfile::tempdir().unwrap();
    let missing = dir.path().join("missing");
    assert_refused(&track(&missing, &[]), 2, &format!("{}: no such file or folder", missing.display()));
    assert_refused(&track(empty.path(), &[]), 2, &format!("{}: no images", empty.path().display()));
    for (init, why) in [
        ("NaN,1,20,20", "--init: box 20 x 20 at (NaN, 1) is not finite"),
        ("900,5,20,20", "--init: box 20 x 20 at (900, 5) lies outside the image of 160 x 120"),
        ("5,5,0,0", "--init: box 0 x 0 at (5, 5) is too small"),
        ("5,5,500,3", "--init: box 500 x 3 at (5, 5) is too small"),
        ("5,5,20", "four numbers x,y,w,h"),
        ("5,5,20,x", "'x' is not a number"),
    ] {
        let output = track(dir.path(), &["--init", init]);
        assert_refused(&output, 2, why);
        assert_eq!(stdout(&output), "");
    }
    let csv = missing.join("boxes.csv");
    assert_refused(&track(dir.path(), &["--output", csv.to_str().unwrap()]), 2, &csv.display().to_string());
    assert_refused(&track(dir.path(), &["-p", "seed"]), 2, "NAME:=VALUE");
    assert_refused(&track(dir.path(), &["-p", "seed:=-1"]), 2, "'seed' must be from");
    assert_refused(&track(dir.path(), &["--algorithm", "guess"]), 2, "'algorithm' must be one of");
    assert_refused(&track(dir.path(), &["--params", missing.to_str().unwrap()]), 2, &missing.display().to_string());
    assert_refused(&track(dir.path(), &["--params", "fsat"]), 2, "presets are default, fast, ");
    assert_refused(&track(dir.path(), &["--colour"]), 2, "--colour");
}

#[test]
fn without_a_marked_box_the_target_must_be_given() {
    let dir = sequence();
    let truth = dir.path().join("groundtruth_rect.txt");
    std::fs::write(&truth, "NaN,NaN,NaN,NaN\n1,2,30,40\n").unwrap();
    let expected = format!("no target: give --init X,Y,W,H; there is no {}", truth.display());
    assert_refused(&track(dir.path(), &[]), 2, &expected);
    std::fs::write(&truth, "1,2,30\n").unwrap();
    assert_refused(&track(dir.path(), &[]), 2, &format!("{}, line 1: '1,2,30' is not a box", truth.display()));
    std::fs::remove_file(&truth).unwrap();
    assert_refused(&track(dir.path(), &[]), 2, &expected);
    assert_eq!(track(dir.path(), &["--init", "30,40,24,32"]).status.code(), Some(0));
}

#[test]
fn a_broken_image_ends_the_run_with_1_after_the_rows_before_it() {
    let dir = sequence();
    let image = dir.path().join("img/5.png");
    let bytes = std::fs::read(&image).unwrap();
    std::fs::write(&image, &bytes[..bytes.len() / 2]).unwrap();
    let output = track(dir.path(), &[]);
    assert_refused(&output, 1, &format!("{}: cannot be decoded", image.display()));
    assert_eq!(rows(stdout(&output)).len(), 4);
}

#[test]
fn a_closed_pipe_ends_the_run_quietly() {
    let dir = sequence();
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let mut command = Command::new(env!("CARGO_BIN_EXE_track"));
    let output = command.arg(dir.path()).stdout(writer).stderr(Stdio::piped()).output().unwrap();
    assert_eq!((output.status.code(), stderr(&output)), (Some(0), ""));
}

#[test]
fn annotated_frames_show_the_box_beside_the_response_map() {
    let dir = sequence();
    let folder = dir.path().join("annotated");
    let output = track(dir.path(), &["--annotate", folder.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let mut names: Vec<PathBuf> = std::fs::read_dir(&folder).unwrap().map(|e| e.unwrap().path()).collect();
    names.sort();
    assert_eq!(names.len(), FRAMES);
    assert!(names[0].ends_with("000001.png"));
    let bytes = std::fs::read(&names[FRAMES - 1]).unwrap();
    let picture = image::load_from_memory(&bytes).unwrap().into_rgb8();
    assert_eq!(picture.dimensions(), (2 * SIZE.0, SIZE.1));
    let rect = rows(stdout(&output))[FRAMES - 1].0;
    let on_side = picture.get_pixel(rect.x.round() as u32, rect.centre()[1] as u32);
    let state = &rows(stdout(&output))[FRAMES - 1].2;
    assert!(state != "tracking" || (on_side[1] > 180 && on_side[0] < 120), "green at the left side: {on_side:?}");
    // The map's dark violet covers the search window in the right half: more blue than green, over textured ground.
    let right = image::imageops::crop_imm(&picture, SIZE.0, 0, SIZE.0, SIZE.1).to_image();
    let violet = right.pixels().filter(|p| p[2] > p[1] + 25 && p[0] > p[1]).count();
    assert!(violet > (2.0 * target(0).area()) as usize, "{violet} px");
    let blocked = track(dir.path(), &["--annotate", names[0].to_str().unwrap()]);
    assert_refused(&blocked, 2, &names[0].display().to_string());
}

/// `walk` as [`write_sequence`] makes it, and `late`, whose target is not there on the first frame.
fn dataset() -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    for name in ["walk", "late"] {
        write_sequence(&dir.path().join(name));
    }
    let truth = dir.path().join("late/groundtruth_rect.txt");
    let text = std::fs::read_to_string(&truth).unwrap();
    std::fs::write(&truth, text.replacen("30\t40\t24\t32", "NaN\tNaN\tNaN\tNaN", 1)).unwrap();
    dir
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn evaluation_scores_what_it_can_and_reports_what_it_cannot() {
    let dir = dataset();
    let (report, boxes) = (dir.path().join("report.json"), dir.path().join("boxes"));
    let args = ["--json", report.to_str().unwrap(), "--boxes", boxes.to_str().unwrap(), "--threads", "1"];
    let output = evaluate(dir.path(), &args);
    assert_refused(&output, 1, "error: lcmht, late: the target is not in view in the first frame");
    assert!(stderr(&output).ends_with("error: 1 of 2 runs failed\n"), "{}", stderr(&output));
    let table = stdout(&output);
    assert!(table.starts_with("lcmht\n"), "{table}");
    let first_words: Vec<_> = table.lines().skip(2).filter_map(|l| l.split_whitespace().next()).collect();
    assert_eq!(first_words[..3], ["walk", "mean", "long-term:"]);

    let setup = &json(&report)["setups"][0];
    assert_eq!(setup["sequences"].as_array().unwrap().len(), 1);
    let walk = &setup["sequences"][0];
    assert_eq!((walk["name"].as_str(), walk["frames"].as_u64()), (Some("walk"), Some(FRAMES as u64)));
    assert_eq!((walk["precision"].as_f64(), walk["held"].as_f64()), (Some(1.0), Some(1.0)));
    assert_eq!(setup["mean"]["auc"], walk["auc"]);
    assert!(walk["auc"].as_f64().unwrap() > 0.5 && walk["fps"].as_f64().unwrap() > 0.0);

    // The same boxes as the other command gives, and the overlap with the truth, NaN where there is none.
    let csv = std::fs::read_to_string(boxes.join("walk.csv")).unwrap();
    let (start, overlaps): (Vec<_>, Vec<_>) = csv.lines().map(|l| l.rsplit_once(',').unwrap()).unzip();
    assert_eq!(start.join("\n") + "\n", stdout(&track(&dir.path().join("walk"), &[])));
    assert_eq!((overlaps[0], overlaps[1], overlaps[4]), ("overlap", "1.000", "NaN"));
}

#[test]
fn a_reader_of_rows_who_leaves_takes_no_pictures_away() {
    let dir = sequence();
    let pictures = dir.path().join("pictures");
    let mut track = Command::new(env!("CARGO_BIN_EXE_track"))
        .arg(dir.path())
        .args(["--annotate", pictures.to_str().unwrap()])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    drop(track.stdout.take());
    assert!(track.wait().unwrap().success());
    assert_eq!(std::fs::read_dir(&pictures).unwrap().count(), FRAMES);
}

/// A sequence that cannot be read takes nothing from the others.
#[test]
fn a_report_is_made_of_what_can_be_read() {
    let dir = dataset();
    let images = std::fs::read_dir(dir.path().join("late/img")).unwrap();
    images.for_each(|image| std::fs::write(image.unwrap().path(), "no image").unwrap());
    let report = dir.path().join("report");
    let output = evaluate(dir.path(), &["--report", report.to_str().unwrap()]);
    assert_refused(&output, 1, "error: late: ");
    assert!(stdout(&output).starts_with("lcmht\n"), "{}", stdout(&output));
    let sequences = json(&report.join("results.json"))["setups"][0]["sequences"].clone();
    assert_eq!(sequences.as_array().unwrap().len(), 1);
    assert_eq!(sequences[0]["name"], "walk");
    let page = std::fs::read_to_string(report.join("index.html")).unwrap();
    assert!(page.contains("walk") && page.ends_with("</html>\n"), "{}", page.len());
}

#[test]
fn each_parameter_file_is_scored_by_itself_and_single_values_win() {
    let dir = dataset();
    let write = |name: &str, values: &str| {
        let path = dir.path().join(name);
        std::fs::write(&path, format!("/**:\n  ros__parameters: {{{values}}}\n")).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let (a, b) = (write("a.yaml", "seed: 1, debug.max_side: 100"), write("b.yaml", "seed: 2"));
    let (report, boxes) = (dir.path().join("report.json"), dir.path().join("boxes"));
    let output = evaluate(
        dir.path(),
        &[
            "--params",
            &a,
            "--params",
            &b,
            "-p",
            "seed:=7",
            "--sequences",
            "walk",
            "--frames",
            "4",
            "--threads",
            "1",
            "--json",
            report.to_str().unwrap(),
            "--boxes",
            boxes.to_str().unwrap(),
        ],
    );
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let report = json(&report);
    let setups: Vec<_> = report["setups"].as_array().unwrap().iter().collect();
    let names: Vec<_> = setups.iter().map(|s| s["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["lcmht-a", "lcmht-b"]);
    assert_eq!(setups[0]["parameters"], serde_json::json!({"seed": "7", "debug.max_side": "100"}));
    assert_eq!(setups[1]["parameters"], serde_json::json!({"seed": "7"}));
    for (setup, name) in setups.iter().zip(names) {
        assert_eq!(setup["mean"]["frames"], 4);
        let csv = std::fs::read_to_string(boxes.join(name).join("walk.csv")).unwrap();
        assert_eq!(csv.lines().count(), 5);
    }
    assert_eq!(stdout(&output).matches("mean").count(), 2);
}

/// Whether two values are the same but for the last digits of their numbers: confidences are written in single
/// precision.
fn alike(a: &serde_json::Value, b: &serde_json::Value) -> bool {
    use serde_json::Value;
    match (a, b) {
        (Value::Number(a), Value::Number(b)) => (a.as_f64().unwrap() - b.as_f64().unwrap()).abs() < 1e-5,
        (Value::Array(a), Value::Array(b)) => a.len() == b.len() && a.iter().zip(b).all(|(a, b)| alike(a, b)),
        (Value::Object(a), Value::Object(b)) => {
            a.len() == b.len() && a.iter().all(|(key, value)| b.get(key).is_some_and(|other| alike(value, other)))
        }
        _ => a == b,
    }
}

#[test]
fn other_trackers_are_scored_beside_ours_and_our_own_boxes_read_back() {
    let dir = dataset();
    let (boxes, other) = (dir.path().join("boxes"), dir.path().join("other"));
    let walk = ["--sequences", "walk"];
    let page = dir.path().join("page");
    let own = page.join("results.json");
    let args = ["--boxes", boxes.to_str().unwrap(), "--report", page.to_str().unwrap()];
    assert_eq!(evaluate(dir.path(), &[&walk[..], &args].concat()).status.code(), Some(0));

    // Follows the target for five frames and then says that it is lost.
    std::fs::create_dir(&other).unwrap();
    let row =
        |k: usize| if k < 5 { format!("{},{},24,32\n", target(k).x, target(k).y) } else { "NaN,NaN,NaN,NaN\n".into() };
    std::fs::write(other.join("walk.txt"), (0..FRAMES).map(row).collect::<String>()).unwrap();
    std::fs::write(other.join("times.csv"), "sequence,frames,seconds\nwalk,10,0.5\n").unwrap();
    let both = dir.path().join("both.json");
    let (a, b) = (format!("ours={}", boxes.display()), format!("other={}", other.display()));
    let args = ["--peers-only", "--peer", &a, "--peer", &b, "--json", both.to_str().unwrap()];
    let output = evaluate(dir.path(), &args);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let html = std::fs::read_to_string(page.join("index.html")).unwrap();
    assert!(html.contains("<h1>lcmht on 1 sequence</h1>") && html.contains("data:image/jpeg;base64,"));
    let (own, both) = (json(&own), json(&both));
    let [ours, others] = &both["setups"].as_array().unwrap()[..] else { panic!("{both}") };
    for figure in ["precision", "auc", "held", "long_term", "absences", "calibration", "curves"] {
        let (read, told) = (&ours["mean"][figure], &own["setups"][0]["mean"][figure]);
        assert!(alike(read, told), "{figure}: {read} for {told}");
    }
    assert_eq!(ours["peer"], true);
    // Nine frames have truth; boxes of the four that count among the first five are exact, and one is of nothing.
    let mean = &others["mean"];
    assert_eq!((mean["lost_frames"].as_u64(), mean["fps"].as_f64()), (Some(5), Some(20.0)));
    assert_eq!((&mean["absences"]["right"], &mean["absences"]["wrong"]), (&0.into(), &5.into()));
    let close = |value: &serde_json::Value, expected: f64| assert!((value.as_f64().unwrap() - expected).abs() < 1e-12);
    close(&mean["long_term"]["precision"], 0.8);
    close(&mean["long_term"]["recall"], 4.0 / 9.0);
    assert!(mean["calibration"].is_null() && mean["long_term"]["threshold"].is_null());
    let last = stdout(&output).lines().last().unwrap();
    assert!(last.starts_with("other ") && last.trim_end().ends_with("20"), "{last}");
}

#[test]
fn halves_tell_what_holds_on_video_that_it_was_not_chosen_on() {
    let dir = dataset();
    let [boxes, worlds, report] = ["boxes", "kinds.csv", "report.json"].map(|name| dir.path().join(name));
    std::fs::write(&worlds, "wa*,crowd\n").unwrap();
    let args = ["--sequences", "walk", "--starts", "2", "--boxes", boxes.to_str().unwrap()];
    assert_eq!(evaluate(dir.path(), &args).status.code(), Some(0));
    let peer = format!("before={}", boxes.display());
    let args = ["--peers-only", "--peer", &peer, "--peer", &peer, "--halves"];
    let more = ["--worlds", worlds.to_str().unwrap(), "--json", report.to_str().unwrap()];
    let output = evaluate(dir.path(), &[&args[..], &more].concat());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = stdout(&output);
    let line = text.lines().find(|line| line.trim_start().starts_with("crowd ")).expect("a line of the world");
    assert!(line.contains("AUC 0."), "{line}");
    // The sequences are late and walk: the only one that was run is in the second half.
    assert!(text.contains("halves: A 1 sequences, B 1;") && text.contains("p 1.000"), "{text}");
    let halves = &json(&report)["halves"];
    assert_eq!(halves["halves"], serde_json::json!([["late"], ["walk"]]));
    let group = &halves["setups"][1]["groups"][0];
    assert_eq!((&group["name"], &group["summary"]["sequences"]), (&"B".into(), &1.into()));
    assert_eq!(group["against_first"]["interval"]["mean"], 0.0, "the same boxes");
    std::fs::write(&worlds, "walk\n").unwrap();
    let output = evaluate(dir.path(), &[&args[..], &more].concat());
    assert_refused(&output, 2, "kinds.csv, line 1: 'walk' is not sequence,world");
    assert_refused(&evaluate(dir.path(), &["--worlds", "x"]), 2, "--halves");
}

#[test]
fn several_starts_tell_how_much_hangs_on_luck() {
    let dir = dataset();
    let report = dir.path().join("report.json");
    let args = ["--sequences", "walk", "--starts", "3", "--json", report.to_str().unwrap()];
    let output = evaluate(dir.path(), &args);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let report = json(&report);
    let setup = &report["setups"][0];
    let runs: Vec<f64> =
        setup["spread"]["auc"]["runs"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    assert_eq!((report["starts"].as_u64(), runs.len()), (Some(3), 3));
    assert_eq!(Some(runs[0]), setup["mean"]["auc"].as_f64(), "the plain start comes first");
    assert!(runs[1..].iter().all(|v| *v != runs[0]), "a pixel off is another run: {runs:?}");
    assert!(stdout(&output).contains("3 starts:\n  precision mean 1.000, spread 0.000"), "{}", stdout(&output));
}

#[test]
fn unusable_datasets_end_with_2_and_the_reason() {
    let dir = dataset();
    let missing = dir.path().join("missing");
    assert_refused(&evaluate(&missing, &[]), 2, &format!("{}: ", missing.display()));
    let walk = dir.path().join("walk");
    assert_refused(&evaluate(&walk, &[]), 2, &format!("{}: no sequences", walk.display()));
    assert_refused(&evaluate(dir.path(), &["--sequences", "walk,run"]), 2, "no sequence 'run'; there are late, walk");
    assert_refused(&evaluate(dir.path(), &["--algorithm", "guess"]), 2, "'algorithm' must be one of");
    assert_refused(&evaluate(dir.path(), &["--threads", "0"]), 2, "--threads");
    assert_refused(&evaluate(dir.path(), &["--peer", "other"]), 2, "it must be NAME=DIR");
    let peer = format!("other={}", missing.display());
    assert_refused(&evaluate(dir.path(), &["--peer", &peer]), 2, "no file of boxes");
    assert_refused(&evaluate(dir.path(), &["--peers-only"]), 2, "nothing to score");
    let json = missing.join("report.json");
    assert_refused(&evaluate(dir.path(), &["--json", json.to_str().unwrap()]), 2, &json.display().to_string());
}
