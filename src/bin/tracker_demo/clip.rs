//! The clip that the package ships: a person walks behind a passer-by and a sign, and comes back. Used by the demo and
//! by the test of the tracker on it.

use std::path::{Path, PathBuf};

use image::RgbImage;
use long_term_tracker::Rect;

/// Frames a second at which it was taken.
#[allow(dead_code, reason = "the test runs it as fast as it can")]
pub const RATE: f64 = 10.0;

/// The person is hidden for half a second, which are few frames at this rate: a target that is missing for more than
/// two is to be called lost.
pub const PARAMETER: &str = "lcmht.confidence.patience:=2";

/// A frame of which it was told by eye where the person is.
pub struct Mark {
    /// Number of the frame, from 0.
    pub frame: usize,
    /// Where the person is; `None` where nothing but her legs can be seen.
    pub rect: Option<Rect>,
}

/// The frames, in order.
pub fn frames() -> Vec<RgbImage> {
    let folder = folder().join("img");
    let entries = std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.expect("the folder can be read").path()).collect();
    files.sort();
    let read = |path: &PathBuf| image::open(path).unwrap_or_else(|e| panic!("{}: {e}", path.display())).into_rgb8();
    files.iter().map(read).collect()
}

/// The boxes drawn by hand, in the order of their frames; the first is that of frame 0.
pub fn marks() -> Vec<Mark> {
    let text = std::fs::read_to_string(folder().join("marks.csv")).expect("the clip has its marks");
    let row = |line: &str| {
        let (frame, place) = line.split_once(',').expect("a row is FRAME,X,Y,W,H or FRAME,hidden");
        let rect = (place != "hidden").then(|| {
            let sides: Vec<f64> = place.split(',').map(|v| v.parse().expect("sides are numbers")).collect();
            Rect::new(sides[0], sides[1], sides[2], sides[3])
        });
        Mark { frame: frame.parse().expect("frames are numbered"), rect }
    };
    text.lines().skip(1).map(row).collect()
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/demo")
}
