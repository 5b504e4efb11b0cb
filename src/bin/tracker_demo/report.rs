//! What a run leaves: annotated frames, a contact sheet, a moving picture, and the figures.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use image::{RgbImage, imageops};
use long_term_tracker::draw::{self, Scene};
use long_term_tracker::eval::trajectory::median;
use long_term_tracker::ros::messages::{Track, TrackArray};
use long_term_tracker::{Encoding, Frame, Output, Rect, State, Target};

use super::animation;
use super::clip::{self, Mark};
use super::link::Run;

/// Frames on the contact sheet, in rows of [`COLUMNS`].
const SHOWN: usize = 12;
const COLUMNS: u32 = 3;
/// Between the frames, in pixels.
const GAP: u32 = 4;

/// The files that [`draw()`] writes beside the frames.
pub struct Pictures {
    pub sheet: PathBuf,
    pub animation: PathBuf,
}

/// Draws what was said of each frame and writes `NNN.png`, `contact_sheet.png` and the moving picture `demo.png`.
pub fn draw(
    frames: &[RgbImage],
    tracks: &[Option<TrackArray>],
    folder: &Path,
) -> Result<Pictures, Box<dyn std::error::Error>> {
    std::fs::create_dir_all(folder)?;
    let states: Vec<Option<State>> = tracks.iter().map(|t| t.as_ref()?.tracks.first().map(state)).collect();
    let shown = chosen(&states);
    let mut drawn = Vec::new();
    for (index, (frame, message)) in frames.iter().zip(tracks).enumerate() {
        let image = annotated(frame, message.as_ref(), index);
        image.save(folder.join(format!("{index:03}.png")))?;
        drawn.push(image);
    }
    let pictures = Pictures { sheet: folder.join("contact_sheet.png"), animation: folder.join("demo.png") };
    sheet(&shown.into_iter().map(|i| &drawn[i]).collect::<Vec<_>>()).save(&pictures.sheet)?;
    animation::write(&drawn, clip::RATE as u16, &pictures.animation)?;
    Ok(pictures)
}

/// What a track says of its target.
pub fn state(track: &Track) -> State {
    match track.state {
        Track::TRACKING => State::Tracking,
        Track::UNCERTAIN => State::Uncertain,
        _ => State::Lost,
    }
}

fn rect(track: &Track) -> Rect {
    Rect::around([track.center_x, track.center_y], [track.size_x, track.size_y])
}

fn annotated(image: &RgbImage, message: Option<&TrackArray>, index: usize) -> RgbImage {
    let target = |t: &Track| Target {
        id: t.id.as_str().into(),
        rect: rect(t),
        velocity: [t.velocity_x, t.velocity_y],
        confidence: t.confidence,
        response: t.response,
        state: state(t),
        reacquired: t.reacquired,
        age: t.age,
        lost_for: t.lost_for,
    };
    let targets = message.iter().flat_map(|m| &m.tracks).map(target).collect();
    let (width, height) = image.dimensions();
    let frame = Frame::new(image, width, height, 3 * width as usize, Encoding::Rgb8, None)
        .expect("a decoded image holds its pixels");
    let mut drawn = draw::annotated(&frame, &Output { targets }, &Scene::default(), u32::MAX);
    draw::heading(&mut drawn, &format!("frame {index}"));
    drawn
}

/// The frames to show: the first, the last, those where the state changes, and between them what fills the largest
/// gaps.
fn chosen(states: &[Option<State>]) -> BTreeSet<usize> {
    let changes: Vec<usize> = (1..states.len()).filter(|&i| states[i] != states[i - 1]).collect();
    let room = SHOWN - 2;
    let stride = changes.len().div_ceil(room).max(1);
    let mut chosen: BTreeSet<usize> = changes.into_iter().step_by(stride).collect();
    chosen.extend([0, states.len() - 1]);
    while chosen.len() < SHOWN.min(states.len()) {
        let sorted: Vec<usize> = chosen.iter().copied().collect();
        let widest = sorted.windows(2).max_by_key(|pair| pair[1] - pair[0]);
        let Some(pair) = widest else { break };
        chosen.insert(pair[0].midpoint(pair[1]));
    }
    chosen
}

fn sheet(tiles: &[&RgbImage]) -> RgbImage {
    let Some(first) = tiles.first() else { return RgbImage::new(1, 1) };
    let (width, height) = (first.width() + GAP, first.height() + GAP);
    let rows = (tiles.len() as u32).div_ceil(COLUMNS);
    let mut sheet = RgbImage::new(COLUMNS * width - GAP, rows * height - GAP);
    for (index, tile) in (0..).zip(tiles) {
        let (column, row) = (index % COLUMNS, index / COLUMNS);
        imageops::replace(&mut sheet, *tile, i64::from(column * width), i64::from(row * height));
    }
    sheet
}

/// How many frames were tracked, lost and re-acquired, how fast, and whether it is the right person.
pub fn summary(run: &Run, marks: &[Mark]) -> String {
    let track = |index: usize| run.tracks[index].as_ref()?.tracks.first();
    let all: Vec<&Track> = (0..run.tracks.len()).filter_map(track).collect();
    let count = |wanted: State| all.iter().filter(|t| state(t) == wanted).count();
    let found: Vec<String> =
        (0..run.tracks.len()).filter(|&i| track(i).is_some_and(|t| t.reacquired)).map(|i| i.to_string()).collect();
    let overlaps: Vec<f64> = marks.iter().filter_map(|m| Some(rect(track(m.frame)?).iou(&m.rect?))).collect();
    let processing = run.tracks.iter().flatten().map(|m| &m.processing_time);
    let processing = median(processing.map(|d| f64::from(d.sec) + f64::from(d.nanosec) * 1e-9).collect());
    let latency = median(run.latencies.clone());

    let mut text = String::new();
    let _ = writeln!(text, "frames: {} shown, {} answered, in {:.1} s", run.tracks.len(), all.len(), run.seconds);
    let _ = writeln!(
        text,
        "states: {} tracking, {} uncertain, {} lost",
        count(State::Tracking),
        count(State::Uncertain),
        count(State::Lost)
    );
    let _ = match found.as_slice() {
        [] => writeln!(text, "re-acquired: never"),
        at => writeln!(text, "re-acquired: {} x, on frame {}", at.len(), at.join(", ")),
    };
    let _ = writeln!(
        text,
        "the right person: on {} of {} frames with a box drawn by hand, mean overlap {:.2}",
        overlaps.iter().filter(|&&o| o > 0.4).count(),
        overlaps.len(),
        overlaps.iter().sum::<f64>() / overlaps.len().max(1) as f64
    );
    let _ = writeln!(
        text,
        "speed: {:.1} ms a frame in the tracker ({:.0} frames a second), {:.1} ms from image to tracks",
        processing * 1e3,
        1.0 / processing,
        latency * 1e3
    );
    text
}
