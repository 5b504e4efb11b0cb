//! Every way in which a file may be laid out against the messages that were written to it, and broken files.

use std::collections::BTreeMap;
use std::io::Cursor;

use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions, Writer};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tempfile::TempDir;

use super::*;

const TOPIC: &str = "/eye";

/// Log time and bytes of a message.
type Written = (u64, Vec<u8>);

/// Messages on two topics, in an order that is not that of their times. Gives the file and what is on [`TOPIC`].
fn write(options: WriteOptions) -> (Vec<u8>, Vec<Written>) {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut writer = Writer::with_options(Cursor::new(Vec::new()), options).unwrap();
    let schema = writer.add_schema("sensor_msgs/msg/Image", "ros2msg", b"text").unwrap();
    let ids = [TOPIC, "/ear"].map(|topic| writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).unwrap());
    let mut written = Vec::new();
    for sequence in 0..60 {
        let log_time = 1000 + rng.random_range(0..50) * 10;
        let len = rng.random_range(1..300);
        let bytes: Vec<u8> = (0..len).map(|_| rng.random_range(0..4)).collect();
        let of = usize::from(sequence % 3 == 2);
        let header = MessageHeader { channel_id: ids[of], sequence, log_time, publish_time: 7 };
        writer.write_to_known_channel(&header, &bytes).unwrap();
        if of == 0 {
            written.push((log_time, bytes));
        }
    }
    writer.finish().unwrap();
    (writer.into_inner().into_inner(), written)
}

fn file(bytes: &[u8]) -> (TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.mcap");
    std::fs::write(&path, bytes).unwrap();
    (dir, path)
}

fn read(path: &Path, topic: &str) -> Result<Vec<Written>, BagError> {
    let mut reader = Reader::open(path, topic, &Limits::default())?;
    let mut message = Recorded::default();
    let mut all = Vec::new();
    while reader.next_into(&mut message)? {
        all.push((message.log_time, message.bytes.clone()));
    }
    Ok(all)
}

fn layouts() -> Vec<(&'static str, WriteOptions)> {
    let small = || WriteOptions::new().chunk_size(Some(500)).compression(None);
    vec![
        ("one chunk", WriteOptions::new().compression(None)),
        ("chunks", small()),
        ("chunks without indexes of their messages", small().emit_message_indexes(false)),
        ("zstd", small().compression(Some(Compression::Zstd))),
        ("lz4", small().compression(Some(Compression::Lz4))),
        ("no chunks", WriteOptions::new().use_chunks(false)),
        ("no chunks and no summary", WriteOptions::new().use_chunks(false).emit_summary_records(false)),
    ]
}

#[test]
fn every_layout_gives_the_messages_of_the_topic_by_time() {
    for (layout, options) in layouts() {
        let (bytes, mut written) = write(options);
        let (_dir, path) = file(&bytes);
        let mut counts: Vec<_> =
            contents(&path, &Limits::default()).unwrap().topics.into_iter().map(|t| (t.name, t.count)).collect();
        counts.sort();
        assert_eq!(counts, [("/ear".to_owned(), 20), (TOPIC.to_owned(), 40)], "{layout}");
        // Those of the same time stay in the order in which they were written.
        written.sort_by_key(|(time, _)| *time);
        assert_eq!(read(&path, TOPIC).unwrap(), written, "{layout}");
        assert_eq!(read(&path, "/nose").unwrap(), [], "{layout}");
    }
}

/// The messages in the order in which they were written, and a word of that.
#[test]
fn chunks_that_are_not_listed_are_read_as_they_were_written() {
    for options in [WriteOptions::new().emit_chunk_indexes(false), WriteOptions::new().emit_statistics(false)] {
        let (bytes, written) = write(options);
        let (_dir, path) = file(&bytes);
        let found = contents(&path, &Limits::default()).unwrap();
        assert_eq!(found.topics.iter().find(|t| t.name == TOPIC).map(|t| t.count), Some(40));
        let note = found.note.unwrap();
        assert!(note.starts_with("without an index"), "{note}");
        assert_eq!(read(&path, TOPIC).unwrap(), written);
    }
}

/// Wherever the recorder was ended, what it had written is there; only of the last chunk some may be missing.
#[test]
fn of_a_file_without_its_end_is_read_what_there_is() {
    for (layout, options) in layouts() {
        let (bytes, written) = write(options);
        let mut most = 0;
        for len in (0..bytes.len()).step_by(97) {
            let (_dir, path) = file(&bytes[..len]);
            match contents(&path, &Limits::default()) {
                Err(error) => {
                    let start = format!("{}: truncated after {len} bytes", path.display());
                    assert!(error.to_string().starts_with(&start), "{layout}, {len}: {error}");
                    assert!(most == 0, "{layout}, {len}: fewer than of a shorter file");
                }
                Ok(found) => {
                    let note = found.note.unwrap();
                    let told = note.starts_with(&format!("truncated after {len} bytes"));
                    // All messages may be there, but not the index.
                    assert!(told || note.starts_with("without an index"), "{layout}, {len}: {note}");
                    let read = read(&path, TOPIC).unwrap();
                    assert_eq!(read, written[..read.len()], "{layout}, {len}");
                    assert!(read.len() >= most, "{layout}, {len}: fewer than of a shorter file");
                    most = read.len();
                    let count = found.topics.iter().find(|t| t.name == TOPIC).map(|t| t.count);
                    assert_eq!(count.unwrap_or(0), most as u64, "{layout}, {len}");
                }
            }
        }
        assert_eq!(most, 40, "{layout}");
    }
}

/// Flipped bits give an error or other messages, and nothing worse.
#[test]
fn broken_files_do_no_harm() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let mut refused = 0;
    for (_, options) in layouts() {
        let bytes = write(options).0;
        for _ in 0..60 {
            let mut broken = bytes.clone();
            for _ in 0..3 {
                let at = rng.random_range(0..broken.len());
                broken[at] ^= 1 << rng.random_range(0..8);
            }
            let (_dir, path) = file(&broken);
            let all = contents(&path, &Limits::default()).and_then(|_| read(&path, TOPIC));
            if let Err(error) = all {
                refused += 1;
                assert!(error.to_string().starts_with(&path.display().to_string()), "{error}");
            }
        }
    }
    assert!(refused > 0);
}
