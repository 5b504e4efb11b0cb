//! What to tell when no image comes: what is asked for, who publishes there, and why the two do not match.

use rustdds::discovery::PublicationBuiltinTopicData;
use rustdds::policy::{Durability, Reliability};

use super::image_qos::ImageQos;

/// The line for `topic` (absolute, as ROS has it) after `seconds` without an image. `kind` is the type of the images
/// as DDS has it.
pub fn line<'a>(
    topic: &str,
    kind: &str,
    qos: ImageQos,
    seconds: u64,
    publishers: impl Iterator<Item = &'a PublicationBuiltinTopicData>,
) -> String {
    let (mut here, mut elsewhere) = (Vec::new(), Vec::new());
    for publisher in publishers {
        let Some(name) = publisher.topic_name.strip_prefix("rt") else { continue };
        if name == topic {
            here.push(match mismatch(publisher, kind, qos) {
                Some(why) => format!("one that does not match: {why}"),
                None => "one that matches".to_owned(),
            });
        } else if publisher.type_name == kind {
            elsewhere.push(name.to_owned());
        }
    }
    elsewhere.sort_unstable();
    elsewhere.dedup();
    let listed = |items: Vec<String>| if items.is_empty() { "none".to_owned() } else { items.join(", ") };
    format!(
        "no image on {topic} after {seconds} s ({}, {}); publishers there: {}; other topics with images: {}",
        reliability(qos.reliable),
        durability(qos.transient_local),
        listed(here),
        listed(elsewhere)
    )
}

/// Why nothing comes from a publisher: all that differs.
fn mismatch(publisher: &PublicationBuiltinTopicData, kind: &str, qos: ImageQos) -> Option<String> {
    let mut differs = Vec::new();
    if publisher.type_name != kind {
        differs.push(format!("its type is {}, not {}", ros_type(&publisher.type_name), ros_type(kind)));
    }
    // What is not told has the default of DDS for writers.
    let reliable = !matches!(publisher.reliability, Some(Reliability::BestEffort));
    let transient_local = publisher.durability.is_some_and(|d| d >= Durability::TransientLocal);
    if qos.reliable && !reliable {
        differs.push(format!("it is {}, {} is requested", reliability(false), reliability(true)));
    }
    if qos.transient_local && !transient_local {
        differs.push(format!("it is {}, {} is requested", durability(false), durability(true)));
    }
    (!differs.is_empty()).then(|| differs.join(" and "))
}

/// `sensor_msgs/msg/Image` of `sensor_msgs::msg::dds_::Image_`.
fn ros_type(dds: &str) -> String {
    dds.replace("::dds_::", "::").replace("::", "/").trim_end_matches('_').to_owned()
}

fn reliability(reliable: bool) -> &'static str {
    ImageQos::RELIABILITIES[usize::from(reliable)]
}

fn durability(transient_local: bool) -> &'static str {
    ImageQos::DURABILITIES[usize::from(transient_local)]
}

#[cfg(test)]
mod tests {
    use super::*;

    const KIND: &str = "sensor_msgs::msg::dds_::Image_";
    const SENSOR: ImageQos = ImageQos { reliable: false, transient_local: false, keep_all: false, depth: 1 };

    fn publisher(topic: &str, kind: &str, reliability: Reliability) -> PublicationBuiltinTopicData {
        let guid = rustdds::GUID::default();
        let mut data = PublicationBuiltinTopicData::new(guid, None, topic.to_owned(), kind.to_owned(), None);
        data.reliability = Some(reliability);
        data
    }

    #[test]
    fn each_publisher_is_told_with_what_keeps_its_images_away() {
        let publishers = [
            publisher("rt/image", KIND, Reliability::BestEffort),
            publisher("rt/image", "std_msgs::msg::dds_::String_", Reliability::BestEffort),
            publisher("rt/camera", KIND, Reliability::BestEffort),
            publisher("rt/camera", KIND, Reliability::BestEffort),
            publisher("rq/image", KIND, Reliability::BestEffort),
        ];
        assert_eq!(
            line("/image", KIND, SENSOR, 5, publishers.iter()),
            "no image on /image after 5 s (best_effort, volatile); publishers there: one that matches, one that does \
             not match: its type is std_msgs/msg/String, not sensor_msgs/msg/Image; other topics with images: /camera"
        );
        let asked = ImageQos { reliable: true, transient_local: true, ..SENSOR };
        let text = line("/image", KIND, asked, 5, publishers[..1].iter());
        assert!(
            text.contains("it is best_effort, reliable is requested and it is volatile, transient_local is"),
            "{text}"
        );
        let none = line("/image", KIND, SENSOR, 5, publishers[..0].iter());
        assert!(none.ends_with("publishers there: none; other topics with images: none"), "{none}");
    }
}
