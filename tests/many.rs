//! MAPTrack and SORT on sequences with many targets, run and scored by `benches/peers/many.py`.

#[path = "support/venv.rs"]
mod venv;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use image::{Rgb, RgbImage, imageops};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const FRAMES: usize = 40;
const SIZE: [u32; 2] = [320, 240];
const FIGURE: [u32; 2] = [24, 50];

fn texture(rng: &mut ChaCha8Rng, [width, height]: [u32; 2], colours: std::ops::Range<u8>) -> RgbImage {
    RgbImage::from_fn(width, height, |_, _| Rgb([(); 3].map(|()| rng.random_range(colours.clone()))))
}

/// Two bright figures that pass each other well apart over dark ground, the first frame without them.
fn write_sequence(folder: &Path) {
    let (images, link) = (folder.join("../_frames"), folder.join("img"));
    fs::create_dir_all(folder).unwrap();
    fs::create_dir_all(&images).unwrap();
    // A file that names the folder, as sequences share theirs.
    fs::write(link, "../_frames").unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let ground = texture(&mut rng, SIZE, 60..64);
    let figures = [texture(&mut rng, FIGURE, 180..200), texture(&mut rng, FIGURE, 220..255)];
    let mut truth = String::new();
    for k in 0..FRAMES {
        let mut image = ground.clone();
        for (id, figure) in figures.iter().enumerate().filter(|_| k > 0) {
            let (x, y) = ([10 + 6 * k, 280 - 6 * k][id], [30, 140][id]);
            imageops::replace(&mut image, figure, x as i64, y as i64);
            truth += &format!("{},{},{x},{y},{},{},1,-1,-1,-1\n", k + 1, id + 1, FIGURE[0], FIGURE[1]);
        }
        image.save(images.join(format!("{}.png", k + 1))).unwrap();
    }
    fs::write(folder.join("gt.txt"), truth).unwrap();
}

/// The example, built as these tests are.
fn blobs() -> PathBuf {
    let mut build = Command::new(env!("CARGO"));
    build.current_dir(env!("CARGO_MANIFEST_DIR")).args(["build", "--quiet", "--example", "blobs"]);
    if !cfg!(debug_assertions) {
        build.arg("--release");
    }
    if !cfg!(feature = "ros") {
        build.arg("--no-default-features");
    }
    venv::run(&mut build);
    Path::new(env!("CARGO_BIN_EXE_track")).with_file_name("examples").join("blobs")
}

#[test]
fn maptrack_and_sort_are_scored_on_the_same_blobs_by_one_command() {
    let python = venv::python("many", "benches/peers/requirements-many.txt", None);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers/many.py");
    let dir = tempfile::tempdir().unwrap();
    write_sequence(&dir.path().join("mot/pair"));
    let output = dir.path().join("many");
    let mut many = Command::new(python);
    many.arg("-B").arg(script).arg(dir.path().join("mot")).arg("--output").arg(&output);
    many.arg("--track").arg(env!("CARGO_BIN_EXE_track")).arg("--blobs").arg(blobs());
    // The truth itself, as the rows of one who knows.
    let oracle = dir.path().join("oracle");
    fs::create_dir(&oracle).unwrap();
    fs::copy(dir.path().join("mot/pair/gt.txt"), oracle.join("pair.txt")).unwrap();
    many.arg("--rows").arg(format!("oracle={}", oracle.display()));
    many.args(["--", "-p", "maptrack.background.window:=100"]);
    let table = venv::run(&mut many);

    let results = fs::read_to_string(output.join("results.json")).unwrap();
    let results: serde_json::Value = serde_json::from_str(&results).unwrap();
    let of = |tracker: &str, figure: &str| results["pair"][tracker][figure].as_f64().unwrap_or(f64::NAN);
    for tracker in ["maptrack", "SORT", "SORT-published", "oracle"] {
        assert!(table.lines().any(|line| line.starts_with("pair") && line.contains(tracker)), "{table}");
        assert!(of(tracker, "MOTA") > 50.0 && of(tracker, "IDF1") > 50.0, "{tracker}\n{table}");
        assert_eq!((of(tracker, "switches"), of(tracker, "tracks")), (0.0, 2.0), "{tracker}\n{table}");
    }
    for figure in ["HOTA", "MOTA", "IDF1"] {
        assert_eq!(of("oracle", figure), 100.0, "{figure}\n{table}");
    }
    let counts = &results["pair"]["oracle"]["table2"];
    let boxes = 2 * (FRAMES - 1);
    assert_eq!((&counts["boxes"], &counts["correct"]), (&boxes.into(), &boxes.into()), "{table}");
    assert_eq!((&counts["false_boxes"], &counts["false_tracks"]), (&0.into(), &0.into()), "{table}");
}
