//! The messages on the wire and in bags, field by field as their `.msg` and `.srv` files have them.
//!
//! [`cdr`] is how they are laid out in bytes, [`schema`] the text that describes them to others, [`convert`] goes from
//! them to the core's types and back. What `ros2-client` itself defines (the parameter services, `/rosout`) is used
//! from there.

pub mod cdr;
pub mod convert;
pub mod schema;

#[cfg(feature = "ros")]
use ros2_client::{Message, MessageTypeName, ServiceTypeName};
use serde::{Deserialize, Serialize};

use crate::frame::Stamp;

/// A message that has a type name, so that a topic can be made of it.
pub trait Topic: Serialize + 'static {
    /// Package and type, as in `sensor_msgs` and `Image`.
    const TYPE: (&'static str, &'static str);

    /// The name in bags, as in `sensor_msgs/msg/Image`.
    fn full_name() -> String {
        format!("{}/msg/{}", Self::TYPE.0, Self::TYPE.1)
    }

    /// The name for the ROS 2 library.
    #[cfg(feature = "ros")]
    fn type_name() -> MessageTypeName {
        MessageTypeName::new(Self::TYPE.0, Self::TYPE.1)
    }
}

macro_rules! messages {
    ($($package:literal / $name:ident { $($(#[$attr:meta])* $field:ident : $ty:ty),* $(,)? })*) => {$(
        #[doc = concat!("`", $package, "/msg/", stringify!($name), "`")]
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        #[allow(missing_docs, reason = "the fields are those of the ROS message")]
        pub struct $name { $($(#[$attr])* pub $field: $ty,)* }

        impl Topic for $name {
            const TYPE: (&'static str, &'static str) = ($package, stringify!($name));
        }

        #[cfg(feature = "ros")]
        impl Message for $name {}
    )*};
}

messages! {
    "builtin_interfaces" / Time { sec: i32, nanosec: u32 }
    "builtin_interfaces" / Duration { sec: i32, nanosec: u32 }
    "std_msgs" / Header { stamp: Time, frame_id: String }

    "sensor_msgs" / Image {
        header: Header,
        height: u32,
        width: u32,
        encoding: String,
        is_bigendian: u8,
        step: u32,
        // Byte by byte, 1920 x 1080 takes 8 ms to read; as a block, 0.2 ms.
        #[serde(with = "serde_bytes")]
        data: Vec<u8>,
    }
    "sensor_msgs" / CompressedImage {
        header: Header,
        format: String,
        #[serde(with = "serde_bytes")]
        data: Vec<u8>,
    }
    "sensor_msgs" / RegionOfInterest { x_offset: u32, y_offset: u32, height: u32, width: u32, do_rectify: bool }

    "geometry_msgs" / Point { x: f64, y: f64, z: f64 }
    "geometry_msgs" / Quaternion { x: f64, y: f64, z: f64, w: f64 }
    "geometry_msgs" / Pose { position: Point, orientation: Quaternion }
    "geometry_msgs" / PoseWithCovariance { pose: Pose, covariance: [[f64; 6]; 6] }

    "vision_msgs" / Point2D { x: f64, y: f64 }
    "vision_msgs" / Pose2D { position: Point2D, theta: f64 }
    "vision_msgs" / BoundingBox2D { center: Pose2D, size_x: f64, size_y: f64 }
    "vision_msgs" / ObjectHypothesis { class_id: String, score: f64 }
    "vision_msgs" / ObjectHypothesisWithPose { hypothesis: ObjectHypothesis, pose: PoseWithCovariance }
    "vision_msgs" / Detection2D {
        header: Header,
        results: Vec<ObjectHypothesisWithPose>,
        bbox: BoundingBox2D,
        id: String,
    }
    "vision_msgs" / Detection2DArray { header: Header, detections: Vec<Detection2D> }

    "rosgraph_msgs" / Clock { clock: Time }

    "diagnostic_msgs" / KeyValue { key: String, value: String }
    "diagnostic_msgs" / DiagnosticStatus {
        level: u8,
        name: String,
        message: String,
        hardware_id: String,
        values: Vec<KeyValue>,
    }
    "diagnostic_msgs" / DiagnosticArray { header: Header, status: Vec<DiagnosticStatus> }

    "long_term_tracker" / Track {
        id: String,
        state: u8,
        center_x: f64,
        center_y: f64,
        size_x: f64,
        size_y: f64,
        velocity_x: f64,
        velocity_y: f64,
        confidence: f32,
        response: f32,
        reacquired: bool,
        age: u32,
        lost_for: u32,
    }
    "long_term_tracker" / TrackArray {
        header: Header,
        algorithm: String,
        tracks: Vec<Track>,
        skipped: u32,
        processing_time: Duration,
    }

    "foxglove_msgs" / Point2 { x: f64, y: f64 }
    "foxglove_msgs" / Color { r: f64, g: f64, b: f64, a: f64 }
    "foxglove_msgs" / CircleAnnotation {
        timestamp: Time,
        position: Point2,
        diameter: f64,
        thickness: f64,
        fill_color: Color,
        outline_color: Color,
    }
    "foxglove_msgs" / PointsAnnotation {
        timestamp: Time,
        r#type: u8,
        points: Vec<Point2>,
        outline_color: Color,
        outline_colors: Vec<Color>,
        fill_color: Color,
        thickness: f64,
    }
    "foxglove_msgs" / TextAnnotation {
        timestamp: Time,
        position: Point2,
        text: String,
        font_size: f64,
        text_color: Color,
        background_color: Color,
    }
    "foxglove_msgs" / ImageAnnotations {
        circles: Vec<CircleAnnotation>,
        points: Vec<PointsAnnotation>,
        texts: Vec<TextAnnotation>,
    }
}

impl PointsAnnotation {
    /// The points are the corners of a closed line.
    pub const LINE_LOOP: u8 = 2;
}

impl Track {
    /// The target is where the box is.
    pub const TRACKING: u8 = 0;
    /// It probably is.
    pub const UNCERTAIN: u8 = 1;
    /// It is not in sight; the box is the best guess.
    pub const LOST: u8 = 2;
}

impl Header {
    /// When the image was taken. A stamp of zero is what sources without a clock send.
    pub fn stamp(&self) -> Stamp {
        Some(self.stamp.nanos()).filter(|&nanos| nanos != 0)
    }
}

impl Time {
    /// Nanoseconds since the epoch.
    pub fn nanos(&self) -> i64 {
        i64::from(self.sec) * NANOS + i64::from(self.nanosec)
    }

    /// The time that many nanoseconds after the epoch; what does not fit 32 bits of seconds is cut off.
    pub fn from_nanos(nanos: i64) -> Self {
        let (sec, nanosec) = (nanos.div_euclid(NANOS), nanos.rem_euclid(NANOS));
        Self { sec: sec.clamp(i32::MIN.into(), i32::MAX.into()) as i32, nanosec: nanosec as u32 }
    }
}

/// Nanoseconds of a second.
const NANOS: i64 = 1_000_000_000;

impl From<std::time::Duration> for Duration {
    fn from(d: std::time::Duration) -> Self {
        Self { sec: i32::try_from(d.as_secs()).unwrap_or(i32::MAX), nanosec: d.subsec_nanos() }
    }
}

/// The request of `std_srvs/srv/Trigger`. A message without fields holds one byte on the wire.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TriggerRequest {
    /// Filler.
    pub structure_needs_at_least_one_member: u8,
}
#[cfg(feature = "ros")]
impl Message for TriggerRequest {}

/// The response of `std_srvs/srv/Trigger`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TriggerResponse {
    /// Whether it was done.
    pub success: bool,
    /// What was done, or why not.
    pub message: String,
}
#[cfg(feature = "ros")]
impl Message for TriggerResponse {}

/// The type of `~/stop` and `~/restart`.
#[cfg(feature = "ros")]
pub fn trigger() -> ServiceTypeName {
    ServiceTypeName::new("std_srvs", "Trigger")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_keep_their_nanoseconds_on_both_sides_of_the_epoch() {
        for nanos in [0, 1, 1_700_000_000_123_456_789, -1, -1_500_000_000] {
            assert_eq!(Time::from_nanos(nanos).nanos(), nanos);
        }
        assert_eq!(Time::from_nanos(-1), Time { sec: -1, nanosec: 999_999_999 });
        assert_eq!(Time::from_nanos(i64::MAX).sec, i32::MAX);
    }
}
