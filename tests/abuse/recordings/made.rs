//! Images, messages and recordings of a target that moves, made here.

use std::io::Cursor;
use std::path::Path;

use image::{Rgb, RgbImage};
use long_term_tracker::Rect;
use long_term_tracker::messages::{Header, Image, Time, cdr};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rusqlite::Connection;

pub const SIZE: (u32, u32) = (160, 120);
pub const INIT: &str = "20,40,24,32";
pub const RAW: &str = "sensor_msgs/msg/Image";
/// Nanoseconds from one recorded image to the next.
pub const PERIOD: u64 = 33_333_333;
pub const START: u64 = 1_700_000_000_000_000_000;

/// The target's true box on a frame.
pub fn target(frame: usize) -> Rect {
    Rect::new(20.0 + 2.0 * frame as f64, 40.0 + (frame % 7) as f64, 24.0, 32.0)
}

/// Blocks of 4 px, so that features of 4 px cells have something to hold on to.
pub fn blocks(seed: u64, width: u32, height: u32, dark: bool) -> RgbImage {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let range = if dark { 20..90 } else { 60..250 };
    let cells: Vec<[u8; 3]> =
        (0..width * height / 16).map(|_| std::array::from_fn(|_| rng.random_range(range.clone()))).collect();
    RgbImage::from_fn(width, height, |x, y| Rgb(cells[(y / 4 * (width / 4) + x / 4) as usize]))
}

pub fn scene(frame: usize) -> RgbImage {
    let mut image = blocks(1, SIZE.0, SIZE.1, true);
    let at = target(frame);
    image::imageops::replace(&mut image, &blocks(2, 24, 32, false), at.x as i64, at.y as i64);
    image
}

/// The message of a frame in CDR.
pub fn message(frame: usize) -> Vec<u8> {
    let stamp = Time::from_nanos((START + frame as u64 * PERIOD) as i64);
    let image = Image {
        header: Header { stamp, frame_id: "camera".to_owned() },
        height: SIZE.1,
        width: SIZE.0,
        encoding: "rgb8".to_owned(),
        is_bigendian: 0,
        step: 3 * SIZE.0,
        data: scene(frame).into_raw(),
    };
    cdr::encode(&image).expect("a message")
}

pub fn time(frame: usize) -> u64 {
    START + frame as u64 * PERIOD
}

/// A channel of a recording and its messages, with their times.
pub struct Channel<'a> {
    topic: &'a str,
    kind: &'a str,
    encoding: &'a str,
    pub messages: Vec<(u64, Vec<u8>)>,
}

pub fn images(topic: &str, frames: impl IntoIterator<Item = usize>) -> Channel<'_> {
    let messages = frames.into_iter().map(|n| (time(n), message(n))).collect();
    Channel { topic, kind: RAW, encoding: "cdr", messages }
}

/// Messages of a type that holds no image.
pub fn other<'a>(topic: &'a str, kind: &'a str, encoding: &'a str, count: usize) -> Channel<'a> {
    Channel { topic, kind, encoding, messages: (0..count).map(|n| (time(n), vec![0; 64])).collect() }
}

pub fn mcap(channels: &[Channel], options: mcap::WriteOptions) -> Vec<u8> {
    let mut bag = mcap::Writer::with_options(Cursor::new(Vec::new()), options).expect("a bag");
    let mut all = Vec::new();
    for channel in channels {
        let schema = bag.add_schema(channel.kind, "ros2msg", b"").expect("a schema");
        let id = bag.add_channel(schema, channel.topic, channel.encoding, &Default::default()).expect("a channel");
        all.extend(channel.messages.iter().map(|(time, data)| (*time, id, data)));
    }
    all.sort();
    for (log_time, channel_id, data) in all {
        let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time, publish_time: log_time };
        bag.write_to_known_channel(&header, data).expect("a message written");
    }
    bag.finish().expect("the bag written");
    bag.into_inner().into_inner()
}

pub fn plain() -> mcap::WriteOptions {
    mcap::WriteOptions::new()
}

/// Writes a recording of images into the tables of rosbag2; the connection is still open.
pub fn sqlite(path: &Path, mode: &str, frames: impl Iterator<Item = (u64, Vec<u8>)>) -> Connection {
    let bag = Connection::open(path).expect("a database");
    bag.pragma_update(None, "journal_mode", mode).expect("the mode");
    bag.execute_batch(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT \
         NOT NULL, offered_qos_profiles TEXT NOT NULL);
         CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data \
         BLOB NOT NULL);
         INSERT INTO topics VALUES(1, '/eye', 'sensor_msgs/msg/Image', 'cdr', '');",
    )
    .expect("the tables");
    for (time, data) in frames {
        bag.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES(1, ?1, ?2)", (time as i64, data))
            .expect("a message");
    }
    bag
}

pub fn recorded(count: usize) -> impl Iterator<Item = (u64, Vec<u8>)> {
    (0..count).map(|n| (time(n), message(n)))
}
