//! The text that describes messages to whoever reads a bag without knowing them (`ros2msg` of MCAP): the definition of
//! the type, then that of every type it is made of.

use std::collections::BTreeMap;

/// Stands between two definitions.
const SEPARATOR: &str = "================================================================================";

/// The types that are written to bags, and all that they are made of.
const DEFINITIONS: [(&str, &str); 24] = [
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
    ("builtin_interfaces/Duration", "int32 sec\nuint32 nanosec\n"),
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
    (
        "sensor_msgs/Image",
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\n\
         uint32 step\nuint8[] data\n",
    ),
    ("sensor_msgs/CompressedImage", "std_msgs/Header header\nstring format\nuint8[] data\n"),
    ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/Quaternion", "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n"),
    ("geometry_msgs/Pose", "Point position\nQuaternion orientation\n"),
    ("geometry_msgs/PoseWithCovariance", "Pose pose\nfloat64[36] covariance\n"),
    ("vision_msgs/Point2D", "float64 x\nfloat64 y\n"),
    ("vision_msgs/Pose2D", "Point2D position\nfloat64 theta\n"),
    ("vision_msgs/BoundingBox2D", "Pose2D center\nfloat64 size_x\nfloat64 size_y\n"),
    ("vision_msgs/ObjectHypothesis", "string class_id\nfloat64 score\n"),
    ("vision_msgs/ObjectHypothesisWithPose", "ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose\n"),
    (
        "vision_msgs/Detection2D",
        "std_msgs/Header header\nObjectHypothesisWithPose[] results\nBoundingBox2D bbox\nstring id\n",
    ),
    ("vision_msgs/Detection2DArray", "std_msgs/Header header\nDetection2D[] detections\n"),
    ("long_term_tracker/Track", include_str!("../../msg/Track.msg")),
    ("long_term_tracker/TrackArray", include_str!("../../msg/TrackArray.msg")),
    ("foxglove_msgs/Point2", "float64 x\nfloat64 y\n"),
    ("foxglove_msgs/Color", "float64 r\nfloat64 g\nfloat64 b\nfloat64 a\n"),
    (
        "foxglove_msgs/CircleAnnotation",
        "builtin_interfaces/Time timestamp\nPoint2 position\nfloat64 diameter\nfloat64 thickness\nColor fill_color\n\
         Color outline_color\n",
    ),
    (
        "foxglove_msgs/PointsAnnotation",
        "uint8 UNKNOWN=0\nuint8 POINTS=1\nuint8 LINE_LOOP=2\nuint8 LINE_STRIP=3\nuint8 LINE_LIST=4\n\
         builtin_interfaces/Time timestamp\nuint8 type\nPoint2[] points\nColor outline_color\nColor[] outline_colors\n\
         Color fill_color\nfloat64 thickness\n",
    ),
    (
        "foxglove_msgs/TextAnnotation",
        "builtin_interfaces/Time timestamp\nPoint2 position\nstring text\nfloat64 font_size\nColor text_color\n\
         Color background_color\n",
    ),
    (
        "foxglove_msgs/ImageAnnotations",
        "CircleAnnotation[] circles\nPointsAnnotation[] points\nTextAnnotation[] texts\n",
    ),
];

/// The definitions of the type (`package`, `name`) and of all that it is made of. `None` where one of them is not
/// known here.
pub fn schema((package, name): (&str, &str)) -> Option<String> {
    let known = BTreeMap::from(DEFINITIONS);
    let mut wanted = vec![format!("{package}/{name}")];
    let mut text = String::new();
    let mut next = 0;
    while let Some(full) = wanted.get(next) {
        let definition = known.get(full.as_str())?;
        if next > 0 {
            text += &format!("{SEPARATOR}\nMSG: {full}\n");
        }
        text += definition;
        let package = full.split('/').next().unwrap_or_default();
        for part in definition.lines().filter_map(|line| part(package, line)).collect::<Vec<_>>() {
            if !wanted.contains(&part) {
                wanted.push(part);
            }
        }
        next += 1;
    }
    Some(text)
}

/// The full name of the message type that a field is of, `None` for built-in types, comments and empty lines.
fn part(package: &str, line: &str) -> Option<String> {
    let kind = line.split('#').next()?.split_whitespace().next()?;
    let kind = kind.split(['[', '<']).next()?;
    let is_message = kind.contains('/') || kind.starts_with(|c: char| c.is_ascii_uppercase());
    is_message.then(|| if kind.contains('/') { kind.to_owned() } else { format!("{package}/{kind}") })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_schema_holds_every_type_once() {
        let text = schema(("long_term_tracker", "TrackArray")).unwrap();
        assert!(text.starts_with("# All targets in one image."), "{text}");
        let parts: Vec<_> = text.lines().filter_map(|l| l.strip_prefix("MSG: ")).collect();
        let expected =
            ["std_msgs/Header", "long_term_tracker/Track", "builtin_interfaces/Duration", "builtin_interfaces/Time"];
        assert_eq!(parts, expected);
        assert_eq!(text.lines().filter(|l| *l == SEPARATOR).count(), parts.len());
    }

    #[test]
    fn every_definition_is_complete() {
        for (name, _) in DEFINITIONS {
            assert!(schema(name.split_once('/').unwrap()).is_some(), "{name}");
        }
        assert_eq!(schema(("std_msgs", "Strange")), None);
    }
}
