//! The bag that a run leaves: the images as they came, and beside them what the tracker says, all as ROS 2 messages in
//! an MCAP file that describes its own types.
//!
//! | topic | type |
//! |---|---|
//! | that of the source, or `/image/compressed` for image files | `sensor_msgs/msg/Image` or `CompressedImage` |
//! | `/tracker/tracks` | `long_term_tracker/msg/TrackArray` |
//! | `/tracker/detections` | `vision_msgs/msg/Detection2DArray` |
//! | `/tracker/annotations` | `foxglove_msgs/msg/ImageAnnotations`, the boxes for an image viewer |
//!
//! Messages about an image are recorded at the time of the image.

mod annotations;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::time::Duration;

use mcap::records::MessageHeader;
use mcap::{McapError, WriteOptions, Writer};
use serde::Serialize;

use self::annotations::annotations;
use crate::messages::cdr::{self, CdrError};
use crate::messages::convert::{detections, tracks};
use crate::messages::{CompressedImage, Header, Image, Time, Topic, schema};
use crate::replay::Origin;
use crate::replay::bag::Picture;
use crate::tracker::Output;

/// Topics of the node under its default name.
const TRACKS: &str = "/tracker/tracks";
const DETECTIONS: &str = "/tracker/detections";
const ANNOTATIONS: &str = "/tracker/annotations";
/// Where image files go: the node's topic for compressed images.
const FILES: &str = "/image/compressed";
/// What the camera of image files is called.
const FRAME_ID: &str = "camera";
/// Image files bear no time: they are put so many nanoseconds apart, which is 30 a second.
const PERIOD: i64 = 33_333_333;

/// Why the bag cannot be written. Each message names the file.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum RecordError {
    /// There is such a file already, or none can be made.
    #[error("{}: cannot be written: {source}", path.display())]
    Create { path: PathBuf, source: io::Error },
    /// A message or the file cannot be written.
    #[error("{}: cannot be written: {why}", path.display())]
    Write { path: PathBuf, why: String },
}

/// A bag that is being written.
pub struct Recorder {
    path: PathBuf,
    algorithm: &'static str,
    writer: Writer<BufWriter<File>>,
    channels: BTreeMap<String, u16>,
    frames: u32,
}

/// The time at which a message is recorded and its place among those of its topic.
type At = (u64, u32);

impl Recorder {
    /// Makes the file, which must be new: a recording is not overwritten.
    pub fn create(path: &Path, algorithm: &'static str) -> Result<Self, RecordError> {
        let failed = |source| RecordError::Create { path: path.to_owned(), source };
        let file = File::create_new(path).map_err(failed)?;
        let library = concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION"));
        let options = WriteOptions::new().profile("ros2").library(library);
        let writer = options.create(BufWriter::new(file)).map_err(|e| unwritten(path, e.into()))?;
        Ok(Self { path: path.to_owned(), algorithm, writer, channels: BTreeMap::new(), frames: 0 })
    }

    /// Writes an image and what the tracker says of it, after so much work.
    pub fn write(&mut self, origin: Origin, output: &Output, processing: Duration) -> Result<(), RecordError> {
        self.frames += 1;
        self.put_all(origin, output, processing).map_err(|why| unwritten(&self.path, why))
    }

    /// Writes the index at the end. A bag that is dropped instead has one too, but nobody learns where that failed.
    pub fn finish(mut self) -> Result<(), RecordError> {
        self.writer.finish().map_err(|e| unwritten(&self.path, e.into()))?;
        let file = self.writer.into_inner().into_inner();
        file.map(drop).map_err(|e| RecordError::Write { path: self.path, why: e.to_string() })
    }

    fn put_all(&mut self, origin: Origin, output: &Output, processing: Duration) -> Result<(), Unwritten> {
        let (header, log_time) = self.put_image(origin)?;
        let at = (log_time, self.frames);
        self.put(TRACKS, &tracks(&header, self.algorithm, output, 0, processing), at)?;
        self.put(DETECTIONS, &detections(&header, output), at)?;
        self.put(ANNOTATIONS, &annotations(&header.stamp, output), at)
    }

    /// Writes the image; gives its header and the time at which it was recorded.
    fn put_image(&mut self, origin: Origin) -> Result<(Header, u64), Unwritten> {
        match origin {
            Origin::Message { topic, picture, log_time, header, bytes } => {
                let at = (log_time, self.frames);
                match picture {
                    Picture::Raw => self.put_bytes::<Image>(topic, bytes, at)?,
                    Picture::Compressed => self.put_bytes::<CompressedImage>(topic, bytes, at)?,
                }
                Ok((header.clone(), log_time))
            }
            Origin::File(bytes) => {
                let nanos = i64::from(self.frames) * PERIOD;
                let header = Header { stamp: Time::from_nanos(nanos), frame_id: FRAME_ID.to_owned() };
                let format = image::guess_format(bytes).map_or("", |f| f.extensions_str()[0]);
                let format = if format == "jpg" { "jpeg" } else { format }.to_owned();
                let message = CompressedImage { header: header.clone(), format, data: bytes.to_owned() };
                let log_time = nanos.unsigned_abs();
                self.put(FILES, &message, (log_time, self.frames))?;
                Ok((header, log_time))
            }
        }
    }

    fn put<T: Topic + Serialize>(&mut self, topic: &str, message: &T, at: At) -> Result<(), Unwritten> {
        self.put_bytes::<T>(topic, &cdr::encode(message)?, at)
    }

    fn put_bytes<T: Topic>(&mut self, topic: &str, bytes: &[u8], (log_time, sequence): At) -> Result<(), Unwritten> {
        let channel_id = match self.channels.get(topic) {
            Some(&id) => id,
            None => {
                let text = schema::schema(T::TYPE).ok_or_else(|| Unwritten::Schema(T::full_name()))?;
                let schema = self.writer.add_schema(&T::full_name(), "ros2msg", text.as_bytes())?;
                let id = self.writer.add_channel(schema, topic, "cdr", &BTreeMap::new())?;
                self.channels.insert(topic.to_owned(), id);
                id
            }
        };
        let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
        Ok(self.writer.write_to_known_channel(&header, bytes)?)
    }
}

/// Why something was not written, before the file is named.
#[derive(Debug, thiserror::Error)]
enum Unwritten {
    #[error(transparent)]
    Mcap(#[from] McapError),
    #[error(transparent)]
    Cdr(#[from] CdrError),
    #[error("the type {0} is not described")]
    Schema(String),
}

fn unwritten(path: &Path, why: Unwritten) -> RecordError {
    let why = match why {
        Unwritten::Mcap(McapError::Io(source)) => source.to_string(),
        other => other.to_string(),
    };
    RecordError::Write { path: path.to_owned(), why }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::{Detection2DArray, ImageAnnotations, TrackArray};

    #[test]
    fn every_type_that_is_written_is_described() {
        for kind in
            [Image::TYPE, CompressedImage::TYPE, TrackArray::TYPE, Detection2DArray::TYPE, ImageAnnotations::TYPE]
        {
            assert!(schema::schema(kind).is_some(), "{kind:?}");
        }
    }
}
