//! Which topic of a bag is meant.

use std::path::{Path, PathBuf};

use super::BagError;
use crate::messages::{CompressedImage, Image, Topic};
use crate::replay::other::listed;

/// How messages must be laid out.
const CDR: &str = "cdr";
/// How those of ROS 1 are.
const ROS_1: &str = "ros1";
/// How the names of types end that hold coded video: Foxglove's, and those of the image transports.
const VIDEO: [&str; 3] = ["CompressedVideo", "FFMPEGPacket", "theora_image_transport/msg/Packet"];

/// What was recorded under a name.
#[derive(Clone, Debug, PartialEq)]
pub struct TopicInfo {
    /// As in `/camera/image_raw`.
    pub name: String,
    /// As in `sensor_msgs/msg/Image`.
    pub kind: String,
    /// How its messages are laid out in bytes; `cdr` is read.
    pub format: String,
    /// Messages.
    pub count: u64,
}

/// The types that hold an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Picture {
    /// `sensor_msgs/msg/Image`
    Raw,
    /// `sensor_msgs/msg/CompressedImage`: JPEG or PNG.
    Compressed,
}

impl Picture {
    /// The one of that type.
    fn of(topic: &TopicInfo) -> Option<Self> {
        match topic.kind.as_str() {
            _ if topic.format != CDR => None,
            kind if kind == Image::full_name() => Some(Self::Raw),
            kind if kind == CompressedImage::full_name() => Some(Self::Compressed),
            _ => None,
        }
    }
}

/// Adds what was recorded in another file; messages of the same topic are counted together.
pub fn merge(all: &mut Vec<TopicInfo>, more: Vec<TopicInfo>) {
    for topic in more {
        match all.iter_mut().find(|t| (&t.name, &t.kind, &t.format) == (&topic.name, &topic.kind, &topic.format)) {
            Some(known) => known.count = known.count.saturating_add(topic.count),
            None => all.push(topic),
        }
    }
}

/// A topic with images, and what to say of the choice where it was not the user's alone.
#[derive(Debug)]
pub struct Choice<'a> {
    /// The topic.
    pub topic: &'a TopicInfo,
    /// Of which kind its images are.
    pub picture: Picture,
    /// What to say of the choice.
    pub note: Option<String>,
}

/// The topic of that name, which may lack its first slash; without a name, the only one on which images were recorded.
pub fn choose<'a>(path: &Path, all: &'a [TopicInfo], name: Option<&str>) -> Result<Choice<'a>, BagError> {
    let images: Vec<_> = all.iter().filter_map(|t| Some((t, Picture::of(t)?))).collect();
    let path = path.to_owned();
    let Some(name) = name else { return only(path, &images, all) };
    let is_named = |topic: &TopicInfo| topic.name == name || topic.name.strip_prefix('/') == Some(name);
    let found = images.iter().filter(|(t, _)| is_named(t)).max_by_key(|(t, _)| t.count);
    if let Some(&(topic, picture)) = found {
        return Ok(Choice { topic, picture, note: None });
    }
    let known = known(&images, all);
    Err(match all.iter().find(|t| is_named(t)) {
        None => BagError::NoTopic { path, topic: name.to_owned(), known },
        Some(other) => {
            let kind = format!("{} in {}", other.kind, other.format);
            let reason = if images.is_empty() { reason(&[other]) } else { "" };
            let known = format!("{known}{reason}");
            BagError::NoImages { path, topic: name.to_owned(), kind, known }
        }
    })
}

fn only<'a>(path: PathBuf, images: &[(&'a TopicInfo, Picture)], all: &[TopicInfo]) -> Result<Choice<'a>, BagError> {
    let recorded: Vec<_> = images.iter().filter(|(t, _)| t.count > 0).collect();
    match recorded.as_slice() {
        [] if images.is_empty() => {
            let reason = reason(&all.iter().collect::<Vec<_>>());
            Err(BagError::NothingToSee { path, known: known(images, all), reason })
        }
        [] => Err(BagError::NothingRecorded { path, known: known(images, all) }),
        &[&(topic, picture)] => {
            let empty = images.iter().filter(|(t, _)| t.count == 0).map(|(t, _)| t.name.clone());
            let note = (images.len() > 1).then(|| {
                let empty = listed(empty);
                format!("{} is read: nothing was recorded on {empty}", topic.name)
            });
            Ok(Choice { topic, picture, note })
        }
        _ => Err(BagError::Choose { path, known: known(images, all) }),
    }
}

/// `topics with images: /a (sensor_msgs/msg/Image, 12 messages), ...` by name; where there are none, what else there
/// is.
fn known(images: &[(&TopicInfo, Picture)], all: &[TopicInfo]) -> String {
    let one = |t: &TopicInfo| format!("{} ({}, {} messages)", t.name, t.kind, t.count);
    let mut images: Vec<_> = images.iter().map(|(t, _)| one(t)).collect();
    images.sort_unstable();
    if !images.is_empty() {
        return format!("topics with images: {}", images.join(", "));
    }
    let mut others: Vec<_> =
        all.iter().map(|t| format!("{} ({} in {}, {} messages)", t.name, t.kind, t.format, t.count)).collect();
    others.sort_unstable();
    if others.is_empty() {
        "there are no topics".to_owned()
    } else {
        format!("there are: {}", listed(others.into_iter()))
    }
}

/// Why there is nothing to be read in these, and what to do about it.
fn reason(topics: &[&TopicInfo]) -> &'static str {
    let is = |test: fn(&TopicInfo) -> bool| topics.iter().any(|t| test(t));
    if is(|t| t.format == ROS_1) {
        "; messages of ROS 1 are not read: convert the original .bag with 'rosbags-convert --src FILE.bag --dst \
         FOLDER' ('pip install rosbags')"
    } else if is(|t| VIDEO.iter().any(|kind| t.kind.ends_with(kind))) {
        "; coded video is not read, for its frames are no images by themselves: record the images, or write them as \
         files ('ffmpeg -i VIDEO frames/%06d.png') and give that folder"
    } else {
        "; only sensor_msgs/msg/Image and sensor_msgs/msg/CompressedImage in cdr are read"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topic(name: &str, kind: &str, count: u64) -> TopicInfo {
        TopicInfo { name: name.to_owned(), kind: format!("sensor_msgs/msg/{kind}"), format: CDR.to_owned(), count }
    }

    fn chosen(all: &[TopicInfo], name: Option<&str>) -> Result<(String, Picture), String> {
        let chosen = choose(Path::new("a.mcap"), all, name);
        chosen.map(|c| (c.topic.name.clone(), c.picture)).map_err(|e| e.to_string())
    }

    #[test]
    fn the_only_one_with_images_is_taken_and_of_several_the_named_one() {
        let mut all = vec![topic("/imu", "Imu", 9), topic("/b", "Image", 3)];
        assert_eq!(chosen(&all, None), Ok(("/b".to_owned(), Picture::Raw)));
        all.push(topic("/a", "CompressedImage", 4));
        assert_eq!(chosen(&all, Some("/a")), Ok(("/a".to_owned(), Picture::Compressed)));
        let known = "topics with images: /a (sensor_msgs/msg/CompressedImage, 4 messages), /b (sensor_msgs/msg/Image, \
                     3 messages)";
        assert_eq!(chosen(&all, None), Err(format!("a.mcap: choose one with --topic NAME; {known}")));
        assert_eq!(chosen(&all, Some("/c")), Err(format!("a.mcap: no topic '/c'; {known}")));
        let expected = format!("a.mcap: topic '/imu' holds sensor_msgs/msg/Imu in cdr; {known}");
        assert_eq!(chosen(&all, Some("/imu")), Err(expected));
    }

    #[test]
    fn a_topic_on_which_nothing_was_recorded_is_not_meant() {
        let mut all = vec![topic("/a", "Image", 0), topic("/b", "CompressedImage", 3), topic("/imu", "Imu", 9)];
        let note = choose(Path::new("a.mcap"), &all, None).unwrap().note;
        assert_eq!(note.as_deref(), Some("/b is read: nothing was recorded on /a"));
        assert_eq!(chosen(&all, None).unwrap().0, "/b");
        // Whoever names it gets it, with or without the slash.
        assert_eq!(chosen(&all, Some("a")).unwrap().0, "/a");
        all.remove(1);
        let known = "topics with images: /a (sensor_msgs/msg/Image, 0 messages)";
        assert_eq!(chosen(&all, None), Err(format!("a.mcap: nothing was recorded on a topic with images; {known}")));
        assert_eq!(choose(Path::new("a.mcap"), &[topic("/b", "Image", 1)], None).unwrap().note, None);
    }

    #[test]
    fn where_no_topic_has_images_the_others_are_told_and_why_they_do_not_do() {
        let other = |name: &str, kind: &str, format: &str| TopicInfo {
            name: name.to_owned(),
            kind: kind.to_owned(),
            format: format.to_owned(),
            count: 3,
        };
        let plain = "; only sensor_msgs/msg/Image and sensor_msgs/msg/CompressedImage in cdr are read";
        for (topic, reason) in [
            (other("/b", "sensor_msgs/msg/Image", "json"), plain),
            (other("/b", "foxglove.RawImage", "protobuf"), plain),
            (other("/camera_info", "sensor_msgs/msg/CameraInfo", "cdr"), plain),
            (other("/b", "sensor_msgs/Image", "ros1"), "; messages of ROS 1 are not read: convert"),
            (other("/b", "foxglove.CompressedVideo", "protobuf"), "; coded video is not read"),
            (other("/b", "foxglove_msgs/msg/CompressedVideo", "cdr"), "; coded video is not read"),
            (other("/b", "ffmpeg_image_transport_msgs/msg/FFMPEGPacket", "cdr"), "; coded video is not read"),
        ] {
            let there = format!("there are: {} ({} in {}, 3 messages)", topic.name, topic.kind, topic.format);
            let message = chosen(std::slice::from_ref(&topic), None).unwrap_err();
            assert!(message.starts_with(&format!("a.mcap: no topic with images; {there}{reason}")), "{message}");
            let message = chosen(std::slice::from_ref(&topic), Some(&topic.name)).unwrap_err();
            let holds =
                format!("a.mcap: topic '{}' holds {} in {}; {there}{reason}", topic.name, topic.kind, topic.format);
            assert!(message.starts_with(&holds), "{message}");
        }
        let message = chosen(&[], None).unwrap_err();
        assert!(message.starts_with("a.mcap: no topic with images; there are no topics"), "{message}");
    }

    #[test]
    fn files_of_a_bag_are_counted_together() {
        let mut all = vec![topic("/b", "Image", 3)];
        merge(&mut all, vec![topic("/a", "Image", 1), topic("/b", "Image", 4)]);
        assert_eq!(all, [topic("/b", "Image", 7), topic("/a", "Image", 1)]);
    }
}
