//! From messages to the core's types and back.

use std::time::Duration;

use super::{
    BoundingBox2D, CompressedImage, Detection2D, Detection2DArray, Header, Image, ObjectHypothesis,
    ObjectHypothesisWithPose, Point2D, Pose2D, RegionOfInterest, Track, TrackArray,
};
use crate::decode::{DecodeError, decode};
use crate::error::FrameError;
use crate::frame::{Encoding, Frame, FrameBuffer, Stamp};
use crate::geometry::Rect;
use crate::tracker::{Output, State, Target};

/// The class in detections: the tracker follows what it was shown and knows no classes.
const CLASS: &str = "target";

/// The image of a message, whose layout has been checked.
#[derive(Debug)]
pub struct Received {
    header: Header,
    image: FrameBuffer,
    /// When the last part of it came in, nanoseconds since the epoch.
    pub arrival: i64,
}

impl Received {
    /// Takes the message where its bytes hold what its fields say.
    pub fn new(mut message: Image, arrival: i64) -> Result<Self, FrameError> {
        let header = std::mem::take(&mut message.header);
        Ok(Self { image: pixels(message, header.stamp())?, header, arrival })
    }

    /// Decodes the message, whose pixels may take `most` bytes.
    pub fn decoded(message: CompressedImage, arrival: i64, most: u64) -> Result<Self, DecodeError> {
        Ok(Self { image: compressed(&message, most)?, header: message.header, arrival })
    }

    /// The header, which everything computed from the image bears.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// How many bytes the image holds.
    pub fn bytes(&self) -> usize {
        self.image.bytes()
    }

    /// The image as the core sees it.
    pub fn frame(&self) -> Frame<'_> {
        self.image.frame()
    }
}

fn pixels(image: Image, stamp: Stamp) -> Result<FrameBuffer, FrameError> {
    let encoding = Encoding::parse(&image.encoding, image.is_bigendian != 0)?;
    FrameBuffer::new(image.data, image.width, image.height, image.step as usize, encoding, stamp)
}

/// The image in a message as a frame with its own bytes.
pub fn raw(image: Image) -> Result<FrameBuffer, FrameError> {
    let stamp = image.header.stamp();
    pixels(image, stamp)
}

/// The JPEG or PNG image in a message, whose pixels may take `most` bytes; its bytes tell which, whatever the format is
/// said to be.
pub fn compressed(image: &CompressedImage, most: u64) -> Result<FrameBuffer, DecodeError> {
    let decoded = decode(&image.data, image.header.stamp(), most)?;
    let encoding = meant(&image.format, decoded.frame().encoding());
    Ok(decoded.read_as(encoding)?)
}

/// What the pixels of a decoded image are by the format that image_transport writes: the encoding of the image that was
/// compressed, and after a semicolon how. A mosaic goes through as grey; and red and blue were exchanged where the
/// compressor, which takes blue first, was given red first.
fn meant(format: &str, decoded: Encoding) -> Encoding {
    let Some((original, how)) = format.split_once(';') else { return decoded };
    let mosaic = Encoding::parse(original.trim(), false).ok().filter(|encoding| encoding.is_mosaic());
    match (decoded, mosaic) {
        (Encoding::Mono8, Some(mosaic)) => mosaic,
        (Encoding::Rgb8, _) if how.contains("compressed rgb") => Encoding::Bgr8,
        (Encoding::Rgba8, _) if how.contains("compressed rgb") => Encoding::Bgra8,
        _ => decoded,
    }
}

/// What a mark asks for.
#[derive(Debug, Clone, PartialEq)]
pub enum Mark {
    /// Follow what is in a box.
    Start(Start),
    /// Follow nothing or, where an id is given, that target no longer.
    Stop(Option<String>),
}

/// A target to be taken up.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    /// Where it is.
    pub rect: Rect,
    /// How it is to be called.
    pub id: Option<String>,
    /// The frame on which it is there; `None` for the newest.
    pub stamp: Stamp,
}

impl From<&RegionOfInterest> for Mark {
    fn from(roi: &RegionOfInterest) -> Self {
        if roi.width == 0 && roi.height == 0 {
            return Self::Stop(None);
        }
        let [x, y, w, h] = [roi.x_offset, roi.y_offset, roi.width, roi.height].map(f64::from);
        Self::Start(Start { rect: Rect::new(x, y, w, h), id: None, stamp: None })
    }
}

/// The box of a detection that is turned is the upright one around it. An empty id is none, a stamp of zero the newest
/// frame's.
impl From<&Detection2D> for Mark {
    fn from(detection: &Detection2D) -> Self {
        let id = Some(detection.id.clone()).filter(|id| !id.is_empty());
        let BoundingBox2D { center, size_x, size_y } = &detection.bbox;
        if *size_x == 0.0 && *size_y == 0.0 {
            return Self::Stop(id);
        }
        let (sin, cos) = center.theta.sin_cos();
        let upright = |along: f64, across: f64| (cos * along).abs() + (sin * across).abs();
        let size = if center.theta == 0.0 {
            [*size_x, *size_y]
        } else {
            [upright(*size_x, *size_y), upright(*size_y, *size_x)]
        };
        let rect = Rect::around([center.position.x, center.position.y], size);
        Self::Start(Start { rect, id, stamp: detection.header.stamp() })
    }
}

/// The message on `~/tracks`.
pub fn tracks(header: &Header, algorithm: &str, output: &Output, skipped: u32, processing: Duration) -> TrackArray {
    TrackArray {
        header: header.clone(),
        algorithm: algorithm.to_owned(),
        tracks: output.targets.iter().map(track).collect(),
        skipped,
        processing_time: processing.into(),
    }
}

fn track(target: &Target) -> Track {
    let [center_x, center_y] = target.rect.centre();
    let state = match target.state {
        State::Tracking => Track::TRACKING,
        State::Uncertain => Track::UNCERTAIN,
        State::Lost => Track::LOST,
    };
    Track {
        id: target.id.to_string(),
        state,
        center_x,
        center_y,
        size_x: target.rect.w,
        size_y: target.rect.h,
        velocity_x: target.velocity[0],
        velocity_y: target.velocity[1],
        confidence: target.confidence,
        response: target.response,
        reacquired: target.reacquired,
        age: target.age,
        lost_for: target.lost_for,
    }
}

/// The message on `~/detections`: lost targets are left out.
pub fn detections(header: &Header, output: &Output) -> Detection2DArray {
    let seen = output.targets.iter().filter(|t| t.state != State::Lost);
    Detection2DArray { header: header.clone(), detections: seen.map(|t| detection(header, t)).collect() }
}

fn detection(header: &Header, target: &Target) -> Detection2D {
    let [x, y] = target.rect.centre();
    let mut result = ObjectHypothesisWithPose {
        hypothesis: ObjectHypothesis { class_id: CLASS.to_owned(), score: target.confidence.into() },
        ..Default::default()
    };
    result.pose.pose.orientation.w = 1.0;
    Detection2D {
        header: header.clone(),
        results: vec![result],
        bbox: BoundingBox2D {
            center: Pose2D { position: Point2D { x, y }, theta: 0.0 },
            size_x: target.rect.w,
            size_y: target.rect.h,
        },
        id: target.id.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::Time;
    use super::*;

    const MOST: u64 = 1_000_000;

    fn header() -> Header {
        Header { stamp: Time { sec: 3, nanosec: 5 }, frame_id: "camera".to_owned() }
    }

    fn image(encoding: &str, step: u32, len: usize) -> Image {
        let (height, width) = (4, 6);
        let data = vec![7; len];
        Image { header: header(), height, width, encoding: encoding.to_owned(), is_bigendian: 0, step, data }
    }

    fn target(state: State) -> Target {
        Target {
            id: "5".into(),
            rect: Rect::new(10.0, 20.0, 4.0, 8.0),
            velocity: [1.0, -2.0],
            confidence: 0.5,
            response: 0.25,
            state,
            reacquired: true,
            age: 9,
            lost_for: 2,
        }
    }

    #[test]
    fn images_are_taken_with_their_padding_or_refused_with_the_values() {
        let good = Received::new(image("rgb8", 20, 80), 1).unwrap();
        assert_eq!(good.frame().stamp(), Some(3_000_000_005));
        assert_eq!((good.frame().width(), good.frame().height()), (6, 4));
        let message = |encoding, step, len| Received::new(image(encoding, step, len), 1).unwrap_err().to_string();
        assert!(message("rgb8", 17, 80).contains("step of 17 bytes"));
        assert!(message("rgb8", 18, 71).contains("data of 71 bytes"));
        assert!(message("bayer_xyz8", 6, 80).contains("'bayer_xyz8' is not supported"));
    }

    #[test]
    fn sources_without_a_clock_have_no_stamp() {
        let mut unstamped = image("mono8", 6, 24);
        unstamped.header.stamp = Time::default();
        assert_eq!(Received::new(unstamped, 1).unwrap().frame().stamp(), None);
    }

    #[test]
    fn a_region_without_extent_stops() {
        let roi = |width, height| RegionOfInterest { x_offset: 1, y_offset: 2, height, width, do_rectify: false };
        let start = |rect| Mark::Start(Start { rect, id: None, stamp: None });
        assert_eq!(Mark::from(&roi(0, 0)), Mark::Stop(None));
        assert_eq!(Mark::from(&roi(3, 4)), start(Rect::new(1.0, 2.0, 3.0, 4.0)));
        assert_eq!(Mark::from(&roi(0, 4)), start(Rect::new(1.0, 2.0, 0.0, 4.0)), "refused later, not a stop");
    }

    #[test]
    fn a_detection_names_its_frame_and_its_target() {
        let mut detection = super::detection(&header(), &target(State::Tracking));
        let stamp = Some(3_000_000_005);
        let start = |rect| Mark::Start(Start { rect, id: Some("5".to_owned()), stamp });
        assert_eq!(Mark::from(&detection), start(Rect::new(10.0, 20.0, 4.0, 8.0)));
        // By a quarter turn the sides change places; by half of that both span their sum over the root of two.
        for (theta, w, h) in [
            (std::f64::consts::FRAC_PI_2, 8.0, 4.0),
            (-std::f64::consts::FRAC_PI_4, 12.0 / 2f64.sqrt(), 12.0 / 2f64.sqrt()),
        ] {
            detection.bbox.center.theta = theta;
            let Mark::Start(Start { rect, .. }) = Mark::from(&detection) else { panic!("a start") };
            assert!((rect.w - w).abs() < 1e-9 && (rect.h - h).abs() < 1e-9, "{rect}");
            assert_eq!(rect.centre(), [12.0, 24.0]);
        }
        (detection.bbox.size_x, detection.bbox.size_y) = (0.0, 0.0);
        assert_eq!(Mark::from(&detection), Mark::Stop(Some("5".to_owned())));
        assert_eq!(Mark::from(&Detection2D::default()), Mark::Stop(None));
        let newest = Detection2D { bbox: BoundingBox2D { size_x: 4.0, ..Default::default() }, ..Default::default() };
        assert!(matches!(Mark::from(&newest), Mark::Start(Start { id: None, stamp: None, .. })));
    }

    #[test]
    fn a_compressed_image_is_what_its_format_says_it_was() {
        let png = |image: image::DynamicImage| {
            let mut data = std::io::Cursor::new(Vec::new());
            image.write_to(&mut data, image::ImageFormat::Png).unwrap();
            data.into_inner()
        };
        let colour = png(image::RgbImage::from_pixel(4, 2, image::Rgb([10, 20, 30])).into());
        let grey = png(image::GrayImage::from_fn(4, 2, |x, y| image::Luma([(x + 4 * y) as u8])).into());
        let deep: image::ImageBuffer<image::Luma<u16>, _> =
            image::ImageBuffer::from_pixel(4, 2, image::Luma([0x1234_u16]));
        let deep = png(deep.into());
        for (format, data, encoding, rgb) in [
            ("bgr8; png compressed bgr8", &colour, Encoding::Rgb8, [10, 20, 30]),
            ("rgb8; png compressed bgr8", &colour, Encoding::Rgb8, [10, 20, 30]),
            ("rgb8; jpeg compressed rgb8", &colour, Encoding::Bgr8, [30, 20, 10]),
            ("png", &colour, Encoding::Rgb8, [10, 20, 30]),
            ("", &colour, Encoding::Rgb8, [10, 20, 30]),
            ("mono8; png compressed ", &grey, Encoding::Mono8, [5, 5, 5]),
            ("bayer_rggb8; png compressed ", &grey, Encoding::BayerRggb8, [0, 2, 5]),
            ("bayer_rggb8; png compressed bgr8", &colour, Encoding::Rgb8, [10, 20, 30]),
            ("16UC1; png compressed ", &deep, Encoding::Mono16, [0x12; 3]),
            ("mono16; png compressed ", &deep, Encoding::Mono16, [0x12; 3]),
        ] {
            let message = CompressedImage { header: header(), format: format.to_owned(), data: data.clone() };
            let got = Received::decoded(message, 1, MOST).unwrap();
            assert_eq!((got.frame().encoding(), got.header()), (encoding, &header()), "{format}");
            assert_eq!(got.frame().stamp(), Some(3_000_000_005));
            let told = got.frame().rgb(1, 1);
            assert!(told.iter().zip(rgb).all(|(a, b)| a.abs_diff(b) <= 1), "{format}: {told:?}");
        }
        let broken = CompressedImage { data: colour[..colour.len() / 2].to_vec(), ..Default::default() };
        assert!(Received::decoded(broken, 1, MOST).unwrap_err().to_string().starts_with("cannot be decoded: "));
        let depth = CompressedImage { data: vec![0; 99], ..Default::default() };
        let why = Received::decoded(depth, 1, MOST).unwrap_err().to_string();
        assert_eq!(why, "cannot be decoded: 99 bytes are neither JPEG nor PNG");
    }

    #[test]
    fn tracks_bear_the_header_and_all_that_is_known() {
        let output = Output { targets: vec![target(State::Lost)] };
        let got = tracks(&header(), "lcmht", &output, 3, Duration::from_millis(1500));
        assert_eq!((got.header, got.skipped), (header(), 3));
        assert_eq!((got.processing_time.sec, got.processing_time.nanosec), (1, 500_000_000));
        let t = &got.tracks[0];
        assert_eq!((t.center_x, t.center_y, t.size_x, t.size_y), (12.0, 24.0, 4.0, 8.0));
        assert_eq!((t.state, t.age, t.lost_for, t.reacquired), (Track::LOST, 9, 2, true));
    }

    #[test]
    fn detections_leave_out_lost_targets() {
        let output = Output { targets: vec![target(State::Lost), target(State::Uncertain)] };
        let got = detections(&header(), &output);
        assert_eq!(got.detections.len(), 1);
        let d = &got.detections[0];
        assert_eq!((d.bbox.center.position.x, d.bbox.size_y), (12.0, 8.0));
        assert_eq!(d.results[0].hypothesis.score, 0.5);
    }
}
