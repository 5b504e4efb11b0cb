//! OpenCV's trackers and this one, run and compared by `benches/peers/compare.py`.

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
fn other_trackers_are_compared_with_this_one_by_one_command() {
    let python = venv::python("peers", "benches/peers/requirements.txt", None);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers/compare.py");
    let dir = tempfile::tempdir().unwrap();
    write_sequence(&dir.path().join("walk"));
    let output = dir.path().join("peers");
    let mut compare = Command::new(python);
    compare.arg("-B").arg(script).arg(dir.path()).arg("--output").arg(&output).args(["--trackers", "CSRT,MOSSE"]);
    compare.args(["--evaluate", env!("CARGO_BIN_EXE_evaluate"), "--", "--starts", "2"]);
    // `CSRT walk 12 frames ...`
    let runs = |told: &str| told.lines().filter(|l| l.split_whitespace().nth(1) == Some("walk")).count();
    let table = venv::run(&mut compare);
    assert_eq!(runs(&table), 2, "{table}");
    assert_eq!(runs(&venv::run(&mut compare)), 0, "what is there is kept");

    let report = fs::read_to_string(output.join("report/results.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    let setups = report["setups"].as_array().unwrap();
    let names: Vec<_> = setups.iter().map(|s| s["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["lcmht-default", "lcmht-fast", "CSRT", "MOSSE"], "{table}");
    for setup in setups {
        let mean = &setup["mean"];
        assert_eq!(mean["frames"], FRAMES, "{table}");
        assert!(mean["fps"].as_f64().unwrap() > 0.0, "{table}");
        assert_eq!(setup["spread"].is_null(), setup["peer"].as_bool().unwrap(), "{table}");
    }
    let [_, fast, csrt, mosse] = &setups[..] else { panic!("{table}") };
    for setup in [fast, csrt] {
        let precision = setup["mean"]["precision"].as_f64().unwrap();
        assert!(precision > 0.99, "the links must lead to the right images\n{table}");
    }
    let right = mosse["mean"]["absences"]["right"].as_u64().unwrap();
    assert!(right > 0, "it says that it has lost a target that is gone\n{table}");
}
