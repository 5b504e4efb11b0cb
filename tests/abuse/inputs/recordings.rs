//! Recordings whose lengths are lies.

use std::path::{Path, PathBuf};

use long_term_tracker::messages::{Header, Image, Time, cdr};
use tempfile::TempDir;

use super::bytes::{Chunk, footer, magic, mcap, message, record, zstd_zeros};
use super::{INIT, REFUSED, Ran, scene, track};

fn file(name: &str, bytes: &[u8]) -> (TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    (dir, path)
}

fn follow(bytes: &[u8], more: &[&str]) -> Ran {
    let (_dir, path) = file("a.mcap", bytes);
    track(&path, &[&INIT[..], more].concat())
}

/// An image message.
fn image(n: u32) -> Vec<u8> {
    let picture = scene(n);
    let header = Header { stamp: Time { sec: 1, nanosec: n }, frame_id: "eye".to_owned() };
    let (height, width) = (picture.height(), picture.width());
    let encoding = "rgb8".to_owned();
    cdr::encode(&Image { header, height, width, encoding, is_bigendian: 0, step: 3 * width, data: picture.into_raw() })
        .unwrap()
}

fn good(time: u64) -> Chunk {
    Chunk::plain([time, time], message(time, &image(time as u32)))
}

fn zeros(times: [u64; 2], count: usize, claimed: u64) -> Chunk {
    Chunk { times, compression: "zstd", packed: zstd_zeros(count), claimed }
}

#[test]
fn the_files_made_here_are_read_where_they_are_true() {
    let packed = zstd::bulk::compress(&message(3, &image(3)), 3).unwrap();
    let claimed = message(3, &image(3)).len() as u64;
    let compressed = Chunk { times: [3, 3], compression: "zstd", packed, claimed };
    let ran = follow(&mcap(&[good(1), good(2), compressed], 1, &[]), &[]);
    assert_eq!((ran.code, ran.out.lines().count()), (Some(0), 4), "{}", ran.err);
}

#[test]
fn no_length_in_an_mcap_file_is_believed() {
    const GIB: usize = 1 << 30;
    let long = 1_u64 << 60;
    let one = || zeros([1, 1], 4 * GIB, 4 * GIB as u64);
    let inner = |bytes: Vec<u8>| mcap(&[Chunk::plain([1, 1], bytes)], 1, &[]);
    let loose = |records: &[u8]| [&magic()[..], &record(1, 8, &[0; 8]), records, &footer(0)].concat();
    let lie = |chunk: Chunk, claimed| Chunk { claimed, ..chunk };
    for (what, bytes, words) in [
        ("a chunk of 4 GiB", mcap(&[one()], 1, &[]), &["4294967296 bytes, at most 320000000 are allowed"][..]),
        ("a chunk that is less", mcap(&[lie(good(1), 300_000_000)], 1, &[]), &["300000000 were claimed"]),
        ("a chunk that is more", mcap(&[lie(one(), 1000)], 1, &[]), &["the chunk at", "at most 1000 are allowed"]),
        ("a chunk listed 300 times", mcap(&[zeros([1, 1], 9_000_000, 9_000_000)], 300, &[]), &["overlaps the one at"]),
        ("chunks in the index", mcap(&[good(1)], 1, &record(6, 9, &[0; 9])), &[]),
        ("a long record in a chunk", inner(record(5, long, &[0; 40])), &["the record at 0 in it is truncated"]),
        ("a long schema in the index", mcap(&[good(1)], 1, &record(3, long, &[0; 99])), &["claims", "bytes"]),
        (
            "a long string in the index",
            mcap(&[good(1)], 1, &record(3, 10, &[1, 0, 255, 255, 255, 255, 1, 1, 1, 1])),
            &["a truncated string"],
        ),
        ("a long message without chunks", loose(&record(5, long, &[0; 99])), &["claims 1152921504606846976 bytes"]),
        ("a long attachment", loose(&record(9, long - 1, &[0; 99])), &["claims 1152921504606846975 bytes"]),
        ("an index beyond the end", [&magic()[..], &footer(u64::MAX)].concat(), &[]),
    ] {
        let ran = follow(&bytes, &[]);
        assert!(bytes.len() < 700_000, "{what} takes {} bytes", bytes.len());
        if ran.code == Some(0) {
            // What is not needed is passed over.
            assert!(words.is_empty() && ran.peak < 2 * REFUSED, "{what}: {} kB, {}", ran.peak, ran.err);
        } else {
            assert!(ran.err.contains("a.mcap"), "{what}: {}", ran.err);
            ran.refused(words, REFUSED);
        }
    }
}

#[test]
fn chunks_that_wait_for_each_other_are_bounded_together() {
    // Each says that it begins at 1, and what is in it that it was recorded at the end of time.
    let body = |n: usize| [message(u64::MAX, &image(n as u32)), record(99, 30_000_000, &vec![0; 30_000_000])].concat();
    let chunk = |n: usize| {
        let plain = body(n);
        let packed = zstd::bulk::compress(&plain, 1).unwrap();
        Chunk { times: [1, 1], compression: "zstd", packed, claimed: plain.len() as u64 }
    };
    let chunks: Vec<_> = (0..12).map(chunk).collect();
    let ran = follow(&mcap(&chunks, 1, &[]), &["-p", "limits.message_mb:=40"]);
    ran.refused(&["overlap it in time", "2 x 40000000"], 200_000);
}

#[test]
fn what_is_whole_is_read_before_what_is_not() {
    let ran = follow(&mcap(&[good(1), good(2), zeros([3, 3], 1 << 32, 1 << 32)], 1, &[]), &[]);
    assert_eq!((ran.code, ran.out.lines().count()), (Some(1), 3), "{}", ran.err);
    ran.refused(&["4294967296 bytes, at most 320000000 are allowed"], 2 * REFUSED);
}

/// A folder with a recording whose messages are compressed each by itself.
fn by_message(name: &str, bytes: &[u8]) -> TempDir {
    let (dir, _) = file(name, bytes);
    let yaml = format!(
        "rosbag2_bagfile_information: {{version: 5, relative_file_paths: [{name}], compression_mode: MESSAGE, \
         compression_format: zstd}}\n"
    );
    std::fs::write(dir.path().join("metadata.yaml"), yaml).unwrap();
    dir
}

#[test]
fn a_compressed_message_becomes_no_more_than_may_be() {
    let bomb = message(2, &zstd_zeros(3 << 30));
    assert!(bomb.len() < 111_000);
    let first = message(1, &zstd::bulk::compress(&image(1), 3).unwrap());
    let bytes = mcap(&[Chunk::plain([1, 1], first), Chunk::plain([2, 2], bomb)], 1, &[]);
    let ran = track(by_message("a.mcap", &bytes).path(), &[&INIT[..], &["-p", "limits.message_mb:=50"]].concat());
    assert_eq!((ran.code, ran.out.lines().count()), (Some(1), 2), "{}", ran.err);
    ran.refused(&["a.mcap: message on '/eye' at 0.000000002 s", "at most 50000000 are allowed"], 2 * REFUSED);
}

fn database(fill: impl Fn(&rusqlite::Connection)) -> (TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.db3");
    let connection = rusqlite::Connection::open(&path).unwrap();
    let topics = "CREATE TABLE topics (id INTEGER PRIMARY KEY, name, type, serialization_format, offered_qos_profiles);
                  INSERT INTO topics VALUES (1, '/eye', 'sensor_msgs/msg/Image', 'cdr', '');";
    connection.execute_batch(topics).unwrap();
    fill(&connection);
    (dir, path)
}

#[test]
fn a_database_is_read_no_longer_than_its_tables_are() {
    const TABLE: &str = "CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id, timestamp, data)";
    let (_dir, path) = database(|all| {
        all.execute(TABLE, []).unwrap();
        all.execute("INSERT INTO messages VALUES (1, 1, 1, ?1)", [image(1)]).unwrap();
        all.execute("INSERT INTO messages VALUES (2, 1, 2, zeroblob(3000000))", []).unwrap();
    });
    let ran = track(&path, &[&INIT[..], &["-p", "limits.message_mb:=2"]].concat());
    assert_eq!((ran.code, ran.out.lines().count()), (Some(1), 2), "{}", ran.err);
    ran.refused(&["a.db3: ", "too big"], 2 * REFUSED);
    let (_dir, path) = database(|all| {
        let endless = "CREATE VIEW messages AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) \
                       SELECT i AS id, 1 AS topic_id, i AS timestamp, zeroblob(1000) AS data FROM n";
        all.execute_batch(endless).unwrap();
    });
    track(&path, &INIT).refused(&["a.db3: it lacks the tables 'topics' and 'messages'"], REFUSED);
}

#[test]
fn the_description_of_a_recording_is_bounded_too() {
    let (dir, _) = file("a.mcap", &mcap(&[good(1)], 1, &[]));
    let write = |text: &str| std::fs::write(dir.path().join("metadata.yaml"), text).unwrap();
    write(&"[".repeat(160_000));
    track(dir.path(), &INIT).refused(&["metadata.yaml: brackets are nested 160000 deep"], REFUSED);
    std::fs::File::create(dir.path().join("metadata.yaml")).unwrap().set_len(1 << 40).unwrap();
    track(dir.path(), &INIT).refused(&["metadata.yaml: it has 1099511627776 bytes"], REFUSED);
}

#[test]
fn a_recording_is_a_regular_file() {
    let dir = tempfile::tempdir().unwrap();
    for (name, to) in [("a.mcap", "/dev/zero"), ("b.db3", "/dev/zero")] {
        std::os::unix::fs::symlink(to, dir.path().join(name)).unwrap();
        let ran = track(&dir.path().join(name), &INIT);
        assert!(ran.code == Some(2) && ran.peak < REFUSED, "{name}: {:?}, {} kB, {}", ran.code, ran.peak, ran.err);
    }
    super::fifo(Path::new(&dir.path().join("c.mcap")));
    let ran = track(&dir.path().join("c.mcap"), &INIT);
    assert!(ran.code == Some(2), "{:?}, {}", ran.code, ran.err);
}
