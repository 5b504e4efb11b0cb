//! A frame as the message that pages draw: the picture as JPEG, and in numbers what the tracker says of that very
//! frame and what it did there.
//!
//! The message is `length (u32, little-endian) | header (JSON) | JPEG | maps`. The header gives the length of the JPEG
//! and of each map, a byte a cell. Boxes are in pixels of the frame, whatever the size of the picture.

use image::RgbImage;
use jpeg_encoder::{ColorType, Encoder, EncodingError, SamplingFactor};
use serde::Serialize;

use crate::draw::{self, Scene};
use crate::frame::{Frame, Stamp};
use crate::geometry::Rect;
use crate::tracker::{Output, State, Target};

/// Sides that pictures come in, so that pages of about the same size share one.
const SIDES: [u32; 6] = [320, 640, 960, 1280, 1920, 3840];
/// Boxes, and particles, of which a page is told.
const MOST_BOXES: usize = 100;
const MOST_PARTICLES: usize = 300;
/// A byte of a map is a share of its peak, or of this much where the peak is lower: a map without a target stays dark.
const LEAST_SPAN: f32 = 0.3;
/// Of pictures of moments: width and height, what they show in units of the target's longer side, and the quality.
const MOMENT: [u32; 2] = [192, 144];
const AROUND: f64 = 3.0;
const MOMENT_QUALITY: u8 = 75;

/// A frame, and what is known of it.
#[derive(Clone, Copy)]
pub struct View<'a> {
    /// The frame, read as the tracker reads it.
    pub frame: Frame<'a>,
    /// What marks name it by.
    pub stamp: Stamp,
    /// What was said of it.
    pub output: &'a Output,
    /// What the step showed.
    pub scene: &'a Scene,
    /// JPEG quality.
    pub quality: u8,
}

#[derive(Serialize)]
struct Header<'a> {
    stamp: Option<String>,
    at: u64,
    number: u64,
    /// Of the frame: width and height.
    size: [u32; 2],
    jpeg: usize,
    targets: Vec<Seen<'a>>,
    windows: Vec<[f64; 4]>,
    predictions: Vec<[f64; 4]>,
    neighbours: Vec<[f64; 4]>,
    proposals: Vec<[f64; 4]>,
    /// Centre and weight, the weight in units of the heaviest.
    particles: Vec<[f64; 3]>,
    modes: Vec<(&'static str, [f64; 4])>,
    maps: Vec<Map>,
}

#[derive(Serialize)]
struct Seen<'a> {
    id: &'a str,
    rect: [f64; 4],
    velocity: [f64; 2],
    confidence: f32,
    response: f32,
    state: &'static str,
    reacquired: bool,
    age: u32,
    lost_for: u32,
}

#[derive(Serialize)]
struct Map {
    rows: usize,
    cols: usize,
    window: [f64; 4],
    peak: f32,
}

fn sides(rect: &Rect) -> [f64; 4] {
    [rect.x, rect.y, rect.w, rect.h]
}

fn boxes<'a>(rects: impl Iterator<Item = &'a Rect>) -> Vec<[f64; 4]> {
    rects.take(MOST_BOXES).map(sides).collect()
}

impl<'a> Seen<'a> {
    fn of(t: &'a Target) -> Self {
        Self {
            id: &t.id,
            rect: sides(&t.rect),
            velocity: t.velocity,
            confidence: t.confidence,
            response: t.response,
            state: t.state.name(),
            reacquired: t.reacquired,
            age: t.age,
            lost_for: t.lost_for,
        }
    }
}

/// The longer side of the picture of a frame for a page that asks for so many pixels.
pub(super) fn side(asked: u32, frame: &Frame) -> u32 {
    let longest = frame.width().max(frame.height());
    let round = SIDES.into_iter().find(|side| *side >= asked).unwrap_or(SIDES[SIDES.len() - 1]);
    round.min(longest)
}

/// The message for a picture whose longer side is `side`, of the `number`th frame that was shown, `at` milliseconds
/// after the start.
pub(super) fn message(view: &View, side: u32, number: u64, at: u64) -> Result<Vec<u8>, EncodingError> {
    let View { frame, stamp, output, scene, quality } = view;
    let jpeg = jpeg(&draw::picture(frame, side), *quality)?;
    let (mut maps, mut cells) = (Vec::new(), Vec::new());
    for map in scene.maps() {
        let peak = map.values.iter().copied().fold(0.0, f32::max);
        let span = peak.max(LEAST_SPAN);
        // Casts of floats saturate, and make 0 of NaN.
        cells.extend(map.values.iter().map(|value| (value / span * 255.0).round() as u8));
        maps.push(Map { rows: map.rows, cols: map.cols, window: sides(&map.window), peak });
    }
    let heaviest = scene.particles.iter().map(|p| p.1).fold(f64::MIN_POSITIVE, f64::max);
    let particle = |(rect, weight): &(Rect, f64)| {
        let [x, y] = rect.centre();
        [x, y, weight / heaviest]
    };
    let header = Header {
        stamp: stamp.map(|stamp| stamp.to_string()),
        at,
        number,
        size: [frame.width(), frame.height()],
        jpeg: jpeg.len(),
        targets: output.targets.iter().take(MOST_BOXES).map(Seen::of).collect(),
        windows: boxes(scene.search_windows.iter()),
        predictions: boxes(scene.predictions.iter()),
        neighbours: boxes(scene.neighbours.iter()),
        proposals: boxes(scene.proposals.iter().map(|proposal| &proposal.rect)),
        particles: scene.particles.iter().take(MOST_PARTICLES).map(particle).collect(),
        modes: scene.modes.iter().take(MOST_BOXES).map(|(name, window)| (*name, sides(window))).collect(),
        maps,
    };
    let header = serde_json::to_vec(&header).map_err(|why| EncodingError::IoError(why.into()))?;
    let mut message = Vec::with_capacity(4 + header.len() + jpeg.len() + cells.len());
    message.extend_from_slice(&(header.len() as u32).to_le_bytes());
    message.extend_from_slice(&header);
    message.extend_from_slice(&jpeg);
    message.extend_from_slice(&cells);
    Ok(message)
}

/// A small picture of what is around a target, with its box.
pub(super) fn moment(frame: &Frame, rect: &Rect, state: State) -> Result<Vec<u8>, EncodingError> {
    let height = AROUND * rect.w.max(rect.h);
    let window = Rect::around(rect.centre(), [height * f64::from(MOMENT[0]) / f64::from(MOMENT[1]), height]);
    jpeg(&draw::moment(frame, &window, MOMENT, None, rect, state), MOMENT_QUALITY)
}

/// The colours in half the detail, as cameras and browsers do.
fn jpeg(picture: &RgbImage, quality: u8) -> Result<Vec<u8>, EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, quality);
    encoder.set_sampling_factor(SamplingFactor::F_2_2);
    // No frame has a side that does not fit.
    encoder.encode(picture, picture.width() as u16, picture.height() as u16, ColorType::Rgb)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Encoding;
    use crate::trace::{Event, ResponseMap, Trace as _};

    #[test]
    fn the_message_holds_picture_numbers_and_maps_of_one_frame() {
        let data = vec![120; 3 * 640 * 48];
        let frame = Frame::new(&data, 640, 48, 3 * 640, Encoding::Rgb8, Some(1 << 60)).unwrap();
        let mut scene = Scene::default();
        let window = Rect::new(8.0, 4.0, 16.0, 16.0);
        scene.event(Event::Response(&ResponseMap { values: &[0.5, 1.0, f32::NAN, -1.0], rows: 2, cols: 2, window }));
        let view = View { frame, stamp: frame.stamp(), output: &Output::default(), scene: &scene, quality: 80 };
        assert_eq!([100, 320, 321, 9999].map(|asked| side(asked, &frame)), [320, 320, 640, 640]);
        let message = message(&view, 320, 7, 99).unwrap();
        let (length, rest) = message.split_at(4);
        let (header, rest) = rest.split_at(u32::from_le_bytes(length.try_into().unwrap()) as usize);
        let header: serde_json::Value = serde_json::from_slice(header).unwrap();
        let (jpeg, cells) = rest.split_at(header["jpeg"].as_u64().unwrap() as usize);
        assert_eq!(image::load_from_memory(jpeg).unwrap().to_rgb8().dimensions(), (320, 24));
        assert_eq!(cells, [128, 255, 0, 0]);
        assert_eq!(header["stamp"], (1_i64 << 60).to_string(), "as text, for it has more digits than a double");
        assert_eq!(header["size"], serde_json::json!([640, 48]));
        assert_eq!(header["maps"][0]["window"], serde_json::json!([8.0, 4.0, 16.0, 16.0]));
    }
}
