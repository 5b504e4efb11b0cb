//! Which topic of a bag is meant.

use std::path::Path;

use super::BagError;
use crate::messages::{CompressedImage, Image, Topic};

/// How messages must be laid out.
const CDR: &str = "cdr";

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

/// The topic of that name; without a name, the only one that holds images.
pub fn choose<'a>(path: &Path, all: &'a [TopicInfo], name: Option<&str>) -> Result<(&'a TopicInfo, Picture), BagError> {
    let images: Vec<_> = all.iter().filter_map(|t| Some((t, Picture::of(t)?))).collect();
    let path = path.to_owned();
    let known = list(&images);
    match (name, images.as_slice()) {
        (None, &[only]) => Ok(only),
        (None, _) => Err(BagError::Choose { path, known }),
        (Some(name), images) => match images.iter().find(|(t, _)| t.name == name) {
            Some(&found) => Ok(found),
            None => Err(match all.iter().find(|t| t.name == name) {
                None => BagError::NoTopic { path, topic: name.to_owned(), known },
                Some(other) => {
                    let kind = format!("{} in {}", other.kind, other.format);
                    BagError::NoImages { path, topic: name.to_owned(), kind, known }
                }
            }),
        },
    }
}

/// `/a (sensor_msgs/msg/Image, 12 messages), ...` by name.
fn list(images: &[(&TopicInfo, Picture)]) -> String {
    let one = |(t, _): &(&TopicInfo, Picture)| format!("{} ({}, {} messages)", t.name, t.kind, t.count);
    let mut all: Vec<_> = images.iter().map(one).collect();
    all.sort_unstable();
    if all.is_empty() { "none".to_owned() } else { all.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topic(name: &str, kind: &str, count: u64) -> TopicInfo {
        TopicInfo { name: name.to_owned(), kind: format!("sensor_msgs/msg/{kind}"), format: CDR.to_owned(), count }
    }

    fn chosen(all: &[TopicInfo], name: Option<&str>) -> Result<(String, Picture), String> {
        let chosen = choose(Path::new("a.mcap"), all, name);
        chosen.map(|(t, p)| (t.name.clone(), p)).map_err(|e| e.to_string())
    }

    #[test]
    fn the_only_one_with_images_is_taken_and_of_several_the_named_one() {
        let mut all = vec![topic("/imu", "Imu", 9), topic("/b", "Image", 3)];
        assert_eq!(chosen(&all, None), Ok(("/b".to_owned(), Picture::Raw)));
        all.push(topic("/a", "CompressedImage", 4));
        assert_eq!(chosen(&all, Some("/a")), Ok(("/a".to_owned(), Picture::Compressed)));
        let known = "topics with images: /a (sensor_msgs/msg/CompressedImage, 4 messages), /b (sensor_msgs/msg/Image, 3 \
                     messages)";
        assert_eq!(chosen(&all, None), Err(format!("a.mcap: choose by --topic NAME; {known}")));
        assert_eq!(chosen(&all, Some("/c")), Err(format!("a.mcap: no topic '/c'; {known}")));
        let expected = format!("a.mcap: topic '/imu' holds sensor_msgs/msg/Imu in cdr; {known}");
        assert_eq!(chosen(&all, Some("/imu")), Err(expected));
    }

    #[test]
    fn what_is_laid_out_otherwise_is_no_image() {
        let mut json = topic("/b", "Image", 3);
        json.format = "json".to_owned();
        let message = "a.mcap: choose by --topic NAME; topics with images: none";
        assert_eq!(chosen(&[json.clone()], None), Err(message.to_owned()));
        let message = "a.mcap: topic '/b' holds sensor_msgs/msg/Image in json; topics with images: none";
        assert_eq!(chosen(&[json], Some("/b")), Err(message.to_owned()));
    }

    #[test]
    fn files_of_a_bag_are_counted_together() {
        let mut all = vec![topic("/b", "Image", 3)];
        merge(&mut all, vec![topic("/a", "Image", 1), topic("/b", "Image", 4)]);
        assert_eq!(all, [topic("/b", "Image", 7), topic("/a", "Image", 1)]);
    }
}
