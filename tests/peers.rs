//! OpenCV's trackers, run by `benches/peers/opencv.py`, and their boxes scored by `evaluate --peer`.

#[path = "support/venv.rs"]
mod venv;

use std::fs;
use std::path::Path;
use std::process::Command;

use image::{Rgb, RgbImage};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const FRAMES: usize = 12;
const SIZE: u32 = 160;
/// The target is hidden from this frame on.
const HIDDEN: usize = 9;

fn texture(seed: u64, width: u32, height: u32) -> RgbImage {
    const GRAIN: u32 = 4;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let cols = width / GRAIN;
    let cells: Vec<[u8; 3]> = (0..cols * (height / GRAIN)).map(|_| rng.random()).collect();
    RgbImage::from_fn(width, height, |x, y| Rgb(cells[(y / GRAIN * cols + x / GRAIN) as usize]))
}

/// A textured target that moves by two pixels a frame over a textured ground and then is not there any more. The images
/// of odd frames are small files that hold the path of the image.
fn write_sequence(folder: &Path) {
    let (img, elsewhere) = (folder.join("img"), folder.parent().unwrap().join("_frames"));
    fs::create_dir_all(&img).unwrap();
    fs::create_dir_all(&elsewhere).unwrap();
    let (ground, figure) = (texture(1, SIZE, SIZE), texture(2, 32, 40));
    let mut truth = String::new();
    for k in 0..FRAMES {
        let (x, y) = (40 + 2 * k, 50 + k);
        let mut image = ground.clone();
        if k < HIDDEN {
            image::imageops::replace(&mut image, &figure, x as i64, y as i64);
            truth += &format!("{x},{y},32,40\n");
        } else {
            truth += "NaN,NaN,NaN,NaN\n";
        }
        let name = format!("{}.png", k + 1);
        if k % 2 == 0 {
            image.save(img.join(name)).unwrap();
        } else {
            image.save(elsewhere.join(&name)).unwrap();
            fs::write(img.join(&name), format!("../../_frames/{name}")).unwrap();
        }
    }
    fs::write(folder.join("groundtruth_rect.txt"), truth).unwrap();
}

#[test]
fn boxes_and_times_of_other_trackers_are_scored() {
    let python = venv::python("peers", "benches/peers/requirements.txt");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers/opencv.py");
    let dir = tempfile::tempdir().unwrap();
    write_sequence(&dir.path().join("walk"));
    let output = dir.path().join("boxes");
    let mut opencv = Command::new(python);
    opencv.arg("-B").arg(script).args([dir.path(), &output]).args(["--trackers", "CSRT,MOSSE"]);
    let first = venv::run(&mut opencv);
    assert_eq!(first.lines().count(), 2, "{first}");
    assert_eq!(venv::run(&mut opencv), "", "what is there is kept");

    let json = dir.path().join("figures.json");
    let mut evaluate = Command::new(env!("CARGO_BIN_EXE_evaluate"));
    evaluate.arg(dir.path()).arg("--peers-only").arg("--json").arg(&json);
    for name in ["CSRT", "MOSSE"] {
        evaluate.arg("--peer").arg(format!("{name}={}", output.join(name).display()));
    }
    let table = venv::run(&mut evaluate);
    let report: serde_json::Value = serde_json::from_str(&fs::read_to_string(json).unwrap()).unwrap();
    for setup in report["setups"].as_array().unwrap() {
        let mean = &setup["mean"];
        assert_eq!(mean["frames"], FRAMES, "{table}");
        assert!(mean["fps"].as_f64().unwrap() > 0.0, "{table}");
        assert!(mean["long_term"]["threshold"].is_null(), "{table}");
    }
    let csrt = &report["setups"][0]["mean"];
    assert!(csrt["precision"].as_f64().unwrap() > 0.99, "the links must lead to the right images\n{table}");
    let mosse = &report["setups"][1]["mean"];
    assert!(
        mosse["absences"]["right"].as_u64().unwrap() > 0,
        "it says that it has lost a target that is gone\n{table}"
    );
}
