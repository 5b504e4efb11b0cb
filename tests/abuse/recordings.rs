//! Recordings and images as cameras and tools write them, and what users are told of those that cannot be read.

mod made;

use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use image::ImageFormat;
use long_term_tracker::Rect;
use made::*;
use rusqlite::Connection;

fn track_command(source: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_track"));
    command.arg(source).args(["-p", "lcmht.cnn.enabled:=false"]).args(args).env_remove("RUST_LOG");
    command
}

fn track(source: &Path, args: &[&str]) -> Output {
    track_command(source, &[&["--init", INIT], args].concat()).output().expect("track ran")
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Asserts that each row of a run is on the target of its frame, and that so many frames were read.
#[track_caller]
fn assert_follows(output: &Output, frames: usize, of: &str) {
    let csv = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{of}: {}", said(output));
    let rows: Vec<Vec<f64>> =
        csv.lines().skip(1).map(|row| row.split(',').take(4).map(|v| v.parse().expect("a number")).collect()).collect();
    assert_eq!(rows.len(), frames, "{of}: {}", said(output));
    for (n, row) in rows.iter().enumerate() {
        let rect = Rect::new(row[0], row[1], row[2], row[3]);
        assert!(rect.iou(&target(n)) > 0.5, "{of}, frame {n}: {rect}, {}", said(output));
    }
}

/// Asserts that a run ends with 2 and an error that begins with the path and holds these parts.
#[track_caller]
fn assert_told(source: &Path, output: &Output, parts: &[&str]) {
    let said = said(output);
    let error = said.lines().last().unwrap_or_default();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(error.starts_with(&format!("error: {}", source.display())), "{said}");
    for part in parts {
        assert!(error.replace(&source.display().to_string(), "").contains(part), "no '{part}' in {said}");
    }
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a folder")
}

fn write(path: PathBuf, bytes: impl AsRef<[u8]>) -> PathBuf {
    fs::create_dir_all(path.parent().expect("a folder above")).expect("the folder");
    fs::write(&path, bytes).expect("a file");
    path
}

/// Makes the name of a frame.
type Naming<'a> = &'a dyn Fn(usize) -> String;

/// Files named by time in seconds, as programs print it.
#[test]
fn images_named_by_seconds_are_read_in_the_order_of_their_numbers() {
    const FRAMES: usize = 40;
    let at = |n: usize| n as f64 / 30.0;
    let nanos = |n: usize| 1_000_000_000 + n * 33_333_333;
    let formats: [(&str, Naming, bool); 6] = [
        ("time.time()", &|n| format!("{:?}", 1_700_000_000.25 + at(n)), false),
        ("milliseconds", &|n| format!("frame_{:?}", ((12.0 + at(n)) * 1e3).round() / 1e3), false),
        ("six digits", &|n| format!("{:.6}", 9.5 + at(n)), false),
        ("with a unit", &|n| format!("cam1-{}s", 0.5 + at(n)), false),
        ("nanoseconds, not filled up", &|n| format!("{}.{}", nanos(n) / 1_000_000_000, nanos(n) % 1_000_000_000), true),
        ("versions", &|n| format!("1.{n}"), true),
    ];
    for (kind, name, told) in formats {
        let dir = folder();
        for n in 0..FRAMES {
            scene(n).save(dir.path().join(name(n) + ".png")).expect("a saved frame");
        }
        let output = track(dir.path(), &[]);
        assert_follows(&output, FRAMES, kind);
        assert_eq!(said(&output).contains("read as whole numbers"), told, "{kind}: {}", said(&output));
    }
}

/// BMP, TIFF, WebP and the portable formats are read; what is not read is counted.
#[test]
fn no_image_is_passed_over_in_silence() {
    for format in [ImageFormat::Bmp, ImageFormat::Tiff, ImageFormat::WebP, ImageFormat::Pnm] {
        let dir = folder();
        let ending = if format == ImageFormat::Pnm { "ppm" } else { format.extensions_str()[0] };
        for n in 0..4 {
            let path = dir.path().join(format!("{n}.{}", ending.to_uppercase()));
            scene(n).save_with_format(path, format).expect("a saved frame");
        }
        let output = track(dir.path(), &[]);
        assert_follows(&output, 4, ending);
        assert!(!said(&output).contains("ignored"), "{}", said(&output));
    }
    let dir = folder();
    for n in 0..3 {
        // One of them is not of the kind that its name says, which does not matter.
        let format = if n == 1 { ImageFormat::Bmp } else { ImageFormat::Png };
        scene(n).save_with_format(dir.path().join(format!("{n}.png")), format).expect("a saved frame");
    }
    for name in ["3.gif", "4.gif", "5.heic", "6", "groundtruth_rect.txt", "._7.gif"] {
        write(dir.path().join(name), "1,2,3,4");
    }
    let output = track(dir.path(), &[]);
    assert_follows(&output, 3, "png");
    let expected = "ignored: 4 files (2 .gif, 1 without a suffix, 1 .heic)";
    assert!(said(&output).contains(expected), "{}", said(&output));
}

/// Runs the command with the folder of its source where nothing can be written.
fn on_read_only(folder: &Path, file: &str) -> Output {
    let allow = |mode| fs::set_permissions(folder, fs::Permissions::from_mode(mode)).expect("the permissions");
    allow(0o555);
    let probe = folder.join("probe");
    let output = if fs::write(&probe, "").is_err() {
        track(&folder.join(file), &[])
    } else {
        // Permissions do not hold root back; a mount does, in a name space of its own.
        fs::remove_file(probe).expect("the probe removed");
        let inner = "mount --bind \"$0\" \"$0\" && mount -o remount,bind,ro \"$0\" && exec \"$@\"";
        let track = track_command(&folder.join(file), &["--init", INIT]);
        let mut command = Command::new("unshare");
        command.args(["-m", "sh", "-c", inner]).arg(folder).arg(track.get_program()).args(track.get_args());
        command.output().expect("unshare ran")
    };
    allow(0o755);
    output
}

/// The file alone, with a log that is not written back, with the log's index, and in the middle of a transaction.
#[test]
fn recordings_in_sqlite_are_read_where_nothing_can_be_written_and_as_a_recorder_left_them() {
    let made = folder();
    let closed = made.path().join("closed.db3");
    sqlite(&closed, "WAL", recorded(4)).close().expect("closed");
    assert!(!made.path().join("closed.db3-wal").exists());

    let logged = made.path().join("logged.db3");
    let open = sqlite(&logged, "WAL", recorded(4));
    assert!(fs::metadata(made.path().join("logged.db3-wal")).expect("the log").len() > 0);

    let journal = made.path().join("journal.db3");
    drop(sqlite(&journal, "DELETE", recorded(4)));
    let writing = Connection::open(&journal).expect("a database");
    // What is being written goes to the file before the transaction ends.
    writing
        .execute_batch("PRAGMA cache_size = 2; BEGIN; UPDATE messages SET data = zeroblob(60000);")
        .expect("an update");
    assert!(made.path().join("journal.db3-journal").exists());

    for (kind, endings) in [
        ("closed", &[""][..]),
        ("logged", &["", "-wal"]),
        ("logged", &["", "-wal", "-shm"]),
        ("journal", &["", "-journal"]),
    ] {
        let place = folder();
        for ending in endings {
            let from = made.path().join(format!("{kind}.db3{ending}"));
            fs::copy(from, place.path().join(format!("a b%20?.db3{ending}"))).expect("a copy");
        }
        let before = fs::read_dir(place.path()).expect("the folder").count();
        let what = format!("{kind} {endings:?}");
        assert_follows(&on_read_only(place.path(), "a b%20?.db3"), 4, &what);
        let output = track(&place.path().join("a b%20?.db3"), &[]);
        assert_follows(&output, 4, &what);
        assert_eq!(said(&output).contains("killed while writing"), kind == "journal", "{}", said(&output));
        assert_eq!(fs::read_dir(place.path()).expect("the folder").count(), before, "{what}: something was left there");
    }
    drop((open, writing));
}

/// A file tells of its own that its messages are compressed one by one.
#[test]
fn one_file_of_a_recording_with_compressed_messages_is_read_alone() {
    let dir = folder();
    let packed = |(time, data): (u64, Vec<u8>)| (time, zstd::encode_all(data.as_slice(), 1).expect("compressed"));
    let mut channel = images("/eye", 0..4);
    channel.messages = channel.messages.into_iter().map(packed).collect();
    let file = write(dir.path().join("a_0.mcap"), mcap(&[channel], plain().compression(None)));
    assert_follows(&track(&file, &[]), 4, "mcap");
    let file = dir.path().join("a_0.db3");
    drop(sqlite(&file, "DELETE", recorded(4).map(packed)));
    assert_follows(&track(&file, &[]), 4, "db3");
}

/// Compressed as a whole, a file is told with what unpacks it, and the folder is read once that is done.
#[test]
fn a_file_that_is_compressed_as_a_whole_is_told_with_the_way_out() {
    let dir = folder();
    let whole = mcap(&[images("/eye", 0..4)], plain());
    let packed = write(dir.path().join("a_0.mcap.zstd"), zstd::encode_all(whole.as_slice(), 1).expect("compressed"));
    let metadata = "rosbag2_bagfile_information: {version: 9, relative_file_paths: [a_0.mcap.zstd], \
                    compression_format: zstd, compression_mode: FILE}";
    let way = "compressed as a whole (zstd), which is not read; unpack it first with 'zstd -d";
    assert_told(&packed, &track(&packed, &[]), &[way]);
    assert_told(&packed, &track(dir.path(), &[]), &[way]);
    let metadata = write(dir.path().join("metadata.yaml"), metadata);
    assert_told(&packed, &track(dir.path(), &[]), &[way]);
    write(dir.path().join("a_0.mcap"), &whole);
    assert_follows(&track(dir.path(), &[]), 4, "unpacked");
    fs::remove_file(metadata).expect("removed");
    assert_follows(&track(dir.path(), &[]), 4, "unpacked, without metadata.yaml");
}

/// The recorder was ended before it wrote `metadata.yaml`.
#[test]
fn a_folder_without_metadata_is_read_in_the_order_of_time() {
    let dir = folder();
    let part = |name: &str, frames: std::ops::Range<usize>| {
        write(dir.path().join(name), mcap(&[images("/eye", frames)], plain()))
    };
    let first = part("run_9.mcap", 0..3);
    part("run_10.mcap", 3..6);
    write(dir.path().join("run_11.mcap"), "");
    let output = track(dir.path(), &[]);
    assert_follows(&output, 6, "by name and time");
    for line in ["no metadata.yaml", "its 2 files are read in the order of their names", "run_11.mcap: empty, ignored"]
    {
        assert!(said(&output).contains(line), "no '{line}' in {}", said(&output));
    }
    // An empty one is none, and stands for its folder like any other.
    let metadata = write(dir.path().join("metadata.yaml"), "");
    assert_follows(&track(&metadata, &[]), 6, "empty metadata.yaml");
    fs::rename(first, dir.path().join("run_99.mcap")).expect("renamed");
    let output = track(dir.path(), &[]);
    assert_follows(&output, 6, "by time alone");
    assert!(
        said(&output).contains("in the order of their times, which is not that of their names"),
        "{}",
        said(&output)
    );
    part("run_100.mcap", 1..4);
    let output = track(dir.path(), &[]);
    let told = "run_100.mcap begins before run_99.mcap ends";
    assert!(said(&output).contains(told), "{}", said(&output));
}

#[test]
fn a_topic_on_which_nothing_was_recorded_leaves_no_choice() {
    let dir = folder();
    let empty = other("/eye/compressedDepth", "sensor_msgs/msg/CompressedImage", "cdr", 0);
    let file = write(dir.path().join("a.mcap"), mcap(&[images("/eye", 0..4), empty], plain()));
    let output = track(&file, &[]);
    assert_follows(&output, 4, "one of two");
    let told = "/eye is read: nothing was recorded on /eye/compressedDepth";
    assert!(said(&output).contains(told), "{}", said(&output));
    assert_follows(&track(&file, &["--topic", "eye"]), 4, "without the slash");
}

/// What users hand in that cannot be read, and what each of them is told.
#[test]
fn what_is_not_read_is_told_with_what_it_is_and_what_to_do() {
    let dir = folder();
    let path = |name: &str| dir.path().join(name);
    let bag = |name: &str, channel: Channel| write(path(name), mcap(&[channel], plain()));
    let cases: Vec<(PathBuf, Vec<&str>)> = vec![
        (
            bag("ros1.mcap", other("/eye", "sensor_msgs/Image", "ros1", 3)),
            vec!["/eye (sensor_msgs/Image in ros1, 3 messages)", "messages of ROS 1 are not read", "rosbags-convert"],
        ),
        (
            bag("video.mcap", other("/eye/video", "foxglove.CompressedVideo", "protobuf", 3)),
            vec!["/eye/video (foxglove.CompressedVideo in protobuf, 3 messages)", "coded video is not read"],
        ),
        (
            bag("info.mcap", other("/camera_info", "sensor_msgs/msg/CameraInfo", "cdr", 3)),
            vec!["no topic with images", "/camera_info (sensor_msgs/msg/CameraInfo", "only sensor_msgs/msg/Image"],
        ),
        (
            bag("silent.mcap", other("/eye", RAW, "cdr", 0)),
            vec!["nothing was recorded", "/eye (sensor_msgs/msg/Image, 0 messages)"],
        ),
        (write(path("old.bag"), b"#ROSBAG V2.0\n\0\0"), vec!["a ROS 1 bag", "rosbags-convert --src"]),
        (write(path("clip.mp4"), b"\0\0\0\x20ftypisom\0\0"), vec!["a video", "ffmpeg -i"]),
        (write(path("clip"), b"RIFF\0\0\0\0AVI LIST"), vec!["a video", "ffmpeg -i"]),
        (write(path("clip.mkv"), b"\x1a\x45\xdf\xa3\x01"), vec!["a video", "ffmpeg -i"]),
        (write(path("clip.mov"), b"\0\0\0\x14ftypqt  "), vec!["a video", "ffmpeg -i"]),
        (write(path("picture.png"), b"\x89PNG\r\n\x1a\n"), vec!["a single image", "give the folder"]),
        (write(path("pictures.zip"), b"PK\x03\x04"), vec!["compressed as a whole (zip)", "unzip"]),
        (write(path("empty.mcap"), b""), vec!["empty (0 bytes)"]),
        (write(path("words.db3"), b"SQLite format 4"), vec!["neither an MCAP nor an SQLite file"]),
        (write(path("words.txt"), b"1,2,3,4\n"), vec!["a text file", "SOURCE is a folder of images"]),
        (write(path("noise"), b"\x01\x02\x03"), vec!["an unknown kind of file", "SOURCE is"]),
        (PathBuf::from("/dev/null"), vec!["neither a file nor a folder"]),
        (path("gone"), vec!["no such file or folder"]),
    ];
    for (source, parts) in &cases {
        assert_told(source, &track(source, &[]), parts);
    }
    let other_tables = path("fruit.db3");
    let made = Connection::open(&other_tables).and_then(|c| c.execute_batch("CREATE TABLE fruit (name)"));
    made.expect("a table");
    assert_told(
        &other_tables,
        &track(&other_tables, &[]),
        &["it lacks the tables 'topics' and 'messages'", "it has fruit"],
    );
}

/// The recorder was ended in the middle: what was written is read, also of the chunk that was begun.
#[test]
fn a_recording_without_its_end_is_read_as_far_as_it_goes() {
    const FRAMES: usize = 12;
    let dir = folder();
    let chunks = || plain().chunk_size(Some(200_000));
    for (kind, options) in [
        ("plain chunks", chunks().compression(None)),
        ("compressed chunks", chunks()),
        ("one chunk", plain().compression(None)),
        ("no chunks", plain().use_chunks(false)),
    ] {
        let whole = mcap(&[images("/eye", 0..FRAMES)], options);
        let file = write(dir.path().join("a.mcap"), &whole);
        assert_follows(&track(&file, &[]), FRAMES, kind);
        for percent in [40, 80] {
            let len = whole.len() * percent / 100;
            let file = write(dir.path().join("cut.mcap"), &whole[..len]);
            let output = track(&file, &[]);
            let frames = String::from_utf8_lossy(&output.stdout).lines().count().saturating_sub(1);
            assert!(frames + 2 >= FRAMES * percent / 100 && frames < FRAMES, "{kind}, {percent} %: {frames} frames");
            assert_follows(&output, frames, kind);
            assert!(said(&output).contains(&format!("truncated after {len} bytes")), "{}", said(&output));
        }
        let file = write(dir.path().join("cut.mcap"), &whole[..100]);
        assert_told(&file, &track(&file, &[]), &["truncated after 100 bytes"]);
    }
}

#[test]
fn images_without_boxes_and_boxes_without_images_are_told() {
    let dir = folder();
    let walk = dir.path().join("walk");
    // As a program on Windows writes it.
    let rows = |count: usize| {
        let row = |n| format!("{};{};24;32\r\n", target(n).x, target(n).y);
        format!("\u{feff}{}", (0..count).map(row).collect::<String>())
    };
    let truth = write(walk.join("groundtruth_rect.txt"), rows(6));
    for n in 0..4 {
        scene(n).save(walk.join(format!("{n}.png"))).expect("a saved frame");
    }
    let output = track_command(&walk, &[]).output().expect("track ran");
    assert_follows(&output, 4, "marked in the file");
    let evaluate = |source: &Path| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_evaluate"));
        command.arg(source).args(["-p", "lcmht.cnn.enabled:=false"]).output().expect("evaluate ran")
    };
    let output = evaluate(dir.path());
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let told = "walk: 4 images, but 6 boxes; the first 4 are scored";
    assert!(said(&output).contains(told), "{}", said(&output));
    fs::write(&truth, rows(3)).expect("the boxes");
    let told = "walk: 4 images, but 3 boxes; the first 3 are scored";
    assert!(said(&evaluate(dir.path())).contains(told));
    fs::write(&truth, rows(4)).expect("the boxes");
    assert_eq!(said(&evaluate(dir.path())), "");
    assert_told(&walk, &evaluate(&walk), &["no sequences", "which is a sequence itself: give its parent folder"]);
}

/// What is told of folders.
#[test]
fn a_folder_without_images_is_told_with_what_is_in_it() {
    let dir = folder();
    let path = |name: &str| dir.path().join(name);
    let told = |name: &str, parts: &[&str]| assert_told(&path(name), &track(&path(name), &[]), parts);
    fs::create_dir(path("bare")).expect("a folder");
    told("bare", &["no images (jpg, jpeg, png, bmp", "which is empty"]);
    write(path("gifs/1.gif"), "GIF89a");
    write(path("gifs/notes.txt"), "words");
    told("gifs", &["but 2 files (1 .gif, 1 .txt)"]);
    write(path("clips/clip.mp4"), b"\0\0\0\x20ftypisom\0\0");
    told("clips", &["a video", "ffmpeg -i"]);
    write(path("bags/old.bag"), b"#ROSBAG V2.0\n");
    told("bags", &["a ROS 1 bag", "rosbags-convert"]);
    for name in ["b/img/1.png", "a/1.jpg", "c/c_0.mcap", "notes/words.txt"] {
        write(path("sequences").join(name), "");
    }
    told("sequences", &["but folders with images or recordings; give one of them: a, b, c"]);
    // Links that lead to themselves.
    std::os::unix::fs::symlink(path("round"), path("round")).expect("a link");
    told("round", &["symbolic links"]);
}

#[cfg(target_os = "linux")]
#[test]
fn names_that_are_no_text_are_read() {
    use std::os::unix::ffi::OsStrExt as _;
    let dir = folder();
    let inner = dir.path().join(std::ffi::OsStr::from_bytes(b"r\xe9sum\xe9"));
    fs::create_dir(&inner).expect("a folder");
    for n in 0..4 {
        let name = [b"\xe9_".as_slice(), format!("{}.png", 8 + n).as_bytes()].concat();
        scene(n).save(inner.join("x.png")).expect("a saved frame");
        fs::rename(inner.join("x.png"), inner.join(std::ffi::OsStr::from_bytes(&name))).expect("renamed");
    }
    assert_follows(&track(&inner, &[]), 4, "images");
    let file = inner.join("a.db3");
    sqlite(&file, "WAL", recorded(4)).close().expect("closed");
    assert_follows(&track(&file, &[]), 4, "a recording");
}
