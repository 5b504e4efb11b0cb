//! From messages to the core's types and back.

use std::time::Duration;

use super::{
    BoundingBox2D, CompressedImage, Detection2D, Detection2DArray, Header, Image, ObjectHypothesis,
    ObjectHypothesisWithPose, Point2D, Pose2D, RegionOfInterest, Track, TrackArray,
};
use crate::decode::{DecodeError, decode};
use crate::error::FrameError;
use crate::frame::{Encoding, Frame, FrameBuffer};
use crate::geometry::Rect;
use crate::tracker::{Output, State, Target};

/// The class in detections: the tracker follows what it was shown and knows no classes.
const CLASS: &str = "target";

/// An image message whose layout has been checked.
#[derive(Debug)]
pub struct Received {
    image: Image,
    encoding: Encoding,
    /// When the last part of it came in, nanoseconds since the epoch.
    pub arrival: i64,
}

impl Received {
    /// Takes the message where its bytes hold what its fields say.
    pub fn new(image: Image, arrival: i64) -> Result<Self, FrameError> {
        let encoding = Encoding::parse(&image.encoding, image.is_bigendian != 0)?;
        frame(&image, encoding)?;
        Ok(Self { image, encoding, arrival })
    }

    /// The header, which everything computed from the image bears.
    pub fn header(&self) -> &Header {
        &self.image.header
    }

    /// The image as the core sees it.
    pub fn frame(&self) -> Frame<'_> {
        frame(&self.image, self.encoding).expect("the layout was checked when the message came")
    }
}

fn frame(image: &Image, encoding: Encoding) -> Result<Frame<'_>, FrameError> {
    Frame::new(&image.data, image.width, image.height, image.step as usize, encoding, image.header.stamp())
}

/// The image in a message as a frame with its own bytes.
pub fn raw(image: Image) -> Result<FrameBuffer, FrameError> {
    let encoding = Encoding::parse(&image.encoding, image.is_bigendian != 0)?;
    let stamp = image.header.stamp();
    FrameBuffer::new(image.data, image.width, image.height, image.step as usize, encoding, stamp)
}

/// The JPEG or PNG image in a message; its bytes tell which, whatever the format is said to be.
pub fn compressed(image: &CompressedImage) -> Result<FrameBuffer, DecodeError> {
    decode(&image.data, image.header.stamp())
}

/// What a mark asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mark {
    /// Follow what is in the box.
    Start(Rect),
    /// Follow nothing.
    Stop,
}

impl From<&RegionOfInterest> for Mark {
    fn from(roi: &RegionOfInterest) -> Self {
        if roi.width == 0 && roi.height == 0 {
            return Self::Stop;
        }
        let [x, y, w, h] = [roi.x_offset, roi.y_offset, roi.width, roi.height].map(f64::from);
        Self::Start(Rect::new(x, y, w, h))
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
        assert_eq!(Mark::from(&roi(0, 0)), Mark::Stop);
        assert_eq!(Mark::from(&roi(3, 4)), Mark::Start(Rect::new(1.0, 2.0, 3.0, 4.0)));
        assert_eq!(Mark::from(&roi(0, 4)), Mark::Start(Rect::new(1.0, 2.0, 0.0, 4.0)), "refused later, not a stop");
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
