//! Bags as a user gives them to `track` and gets them from it, with an independent implementation on the other side.

mod support;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::LazyLock;

use long_term_tracker::messages::{Header, Image, cdr};
use support::Environment;

const FRAMES: usize = 20;
const INIT: &str = "528,182,31,101";

/// The first frames of the clip in `assets/demo` as files, `jpg/`, `png/` and `raw/`, and bags of them, `bags/`.
static MADE: LazyLock<PathBuf> = LazyLock::new(|| {
    let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join("bags");
    if dir.exists() {
        fs::remove_dir_all(&dir).expect("what an earlier run made removed");
    }
    fs::create_dir_all(&dir).expect("a folder");
    let clip = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/demo/img");
    let mut frames: Vec<_> = fs::read_dir(clip).expect("the clip").map(|e| e.expect("a frame").path()).collect();
    frames.sort();
    for kind in ["jpg", "png", "raw"] {
        fs::create_dir(dir.join(kind)).expect("a folder for frames");
    }
    let mut size = (0, 0);
    for (n, frame) in frames[..FRAMES].iter().enumerate() {
        let path = |kind: &str, ending: &str| dir.join(kind).join(format!("{n}.{ending}"));
        fs::copy(frame, path("jpg", "jpg")).expect("a copied frame");
        let pixels = image::open(frame).expect("a frame").into_rgb8();
        size = pixels.dimensions();
        pixels.save(path("png", "png")).expect("a saved frame");
        fs::write(path("raw", "rgb"), pixels.into_raw()).expect("saved pixels");
    }
    let bags = dir.join("bags");
    fs::create_dir(&bags).expect("a folder for bags");
    let (width, height) = (size.0.to_string(), size.1.to_string());
    peer(&["write", text(&dir), text(&bags), &width, &height]);
    dir
});

fn made(name: &str) -> PathBuf {
    MADE.join(name)
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a path of text")
}

/// Runs a function of `tests/peer/bags.py`.
fn peer(args: &[&str]) {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peer/bags.py");
    let output = Environment::get().python().arg(script).args(args).output().expect("python ran");
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
}

fn track(source: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_track"));
    let init: &[&str] = if args.contains(&"--init") { &[] } else { &["--init", INIT] };
    command.arg(source).args(init).args(args).output().expect("track ran")
}

/// The rows of a run that must succeed.
fn rows(source: &Path, args: &[&str]) -> String {
    let output = track(source, args);
    assert!(output.status.success(), "{}: {}", source.display(), String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

/// The run ends with the code, and what it says is one line that holds `parts`.
#[track_caller]
fn assert_refused(source: &Path, args: &[&str], code: i32, parts: &[&str]) {
    let output = track(source, args);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{said}");
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(said.starts_with(&format!("error: {}", source.display())), "{said}");
    for part in parts {
        assert!(said.contains(part), "no '{part}' in {said}");
    }
}

#[test]
fn bags_of_every_kind_give_the_boxes_of_the_folder() {
    let expected = rows(&made("png"), &[]);
    assert_eq!(expected.lines().count(), FRAMES + 1);
    assert_eq!(rows(&made("jpg"), &[]), expected, "the PNG files were made of the JPEG files");
    for bag in ["mcap", "mcap_zstd", "mcap_message", "sqlite", "sqlite_message"] {
        for topic in ["/camera/raw", "/camera/raw/compressed", "/camera/png/compressed"] {
            assert_eq!(rows(&made("bags").join(bag), &["--topic", topic]), expected, "{bag} {topic}");
        }
    }
    for file in ["mcap/mcap.mcap", "mcap_zstd/mcap_zstd.mcap", "sqlite/sqlite.db3"] {
        assert_eq!(rows(&made("bags").join(file), &["--topic", "/camera/raw"]), expected, "{file}");
    }
}

#[test]
fn files_of_a_bag_follow_each_other() {
    let dir = tempfile::tempdir().expect("a folder");
    let files = [("a.db3", "sqlite/sqlite.db3"), ("b.mcap", "mcap_zstd/mcap_zstd.mcap")];
    for (name, file) in files {
        fs::copy(made("bags").join(file), dir.path().join(name)).expect("a copied file");
    }
    let metadata = "rosbag2_bagfile_information: {version: 9, relative_file_paths: [a.db3, b.mcap]}";
    fs::write(dir.path().join("metadata.yaml"), metadata).expect("a metadata file");
    fs::write(dir.path().join("groundtruth_rect.txt"), format!("{INIT}\n")).expect("a file of boxes");
    // The box comes from the file beside the recording.
    let output = Command::new(env!("CARGO_BIN_EXE_track"))
        .arg(dir.path())
        .args(["--topic", "/camera/png/compressed"])
        .output()
        .expect("track ran");
    let said = String::from_utf8(output.stdout).expect("text");
    let once = rows(&made("png"), &[]);
    assert_eq!(said.lines().count(), 2 * FRAMES + 1, "{}", String::from_utf8_lossy(&output.stderr));
    assert!(said.starts_with(&once));
}

#[test]
fn the_bag_of_a_run_is_read_by_others_and_by_the_next_run() {
    let dir = tempfile::tempdir().expect("a folder");
    let (bag, csv) = (dir.path().join("run.mcap"), dir.path().join("rows.csv"));
    for (source, topic) in [
        (Some("bags/mcap_zstd"), "/camera/raw"),
        (Some("bags/sqlite"), "/camera/png/compressed"),
        (None, "/image/compressed"),
    ] {
        let path = made(source.unwrap_or("jpg"));
        let choice: &[&str] = if source.is_some() { &["--topic", topic] } else { &[] };
        let args = [choice, &["--bag", text(&bag), "--output", text(&csv)]].concat();
        assert_eq!(rows(&path, &args), "");
        peer(&["check", text(&bag), text(&csv), source.map_or("-", |_| text(&path)), topic]);
        // There is but one topic with images.
        assert_eq!(rows(&bag, &[]), fs::read_to_string(&csv).expect("the rows"));
        fs::remove_file(&bag).expect("the bag removed");
    }
}

#[test]
fn a_run_that_fails_leaves_a_bag_of_what_came_before() {
    let dir = tempfile::tempdir().expect("a folder");
    let images = dir.path().join("images");
    fs::create_dir(&images).expect("a folder for frames");
    for n in 0..5 {
        fs::copy(made("png").join(format!("{n}.png")), images.join(format!("{n}.png"))).expect("a copied frame");
    }
    let broken = images.join("3.png");
    fs::write(&broken, b"no image").expect("a broken frame");
    let bag = dir.path().join("run.mcap");
    let output = track(&images, &["--bag", text(&bag)]);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(rows(&bag, &[]).lines().count(), 1 + 3);
    // It is not overwritten, least of all while it is read.
    let before = fs::read(&bag).expect("the bag");
    assert_refused(&bag, &["--bag", text(&bag)], 2, &["cannot be written", "exists"]);
    assert_eq!(fs::read(&bag).expect("the bag"), before);
}

#[test]
fn topics_that_cannot_be_meant_are_told_with_those_that_can() {
    let known = "topics with images: /camera/png/compressed (sensor_msgs/msg/CompressedImage, 20 messages), \
                 /camera/raw (sensor_msgs/msg/Image, 20 messages), \
                 /camera/raw/compressed (sensor_msgs/msg/CompressedImage, 20 messages)";
    for bag in ["mcap", "sqlite"] {
        let bag = made("bags").join(bag);
        assert_refused(&bag, &[], 2, &["choose one with --topic NAME", known]);
        assert_refused(&bag, &["--topic", "/camera"], 2, &["no topic '/camera'", known]);
        assert_refused(&bag, &["--topic", "/chatter"], 2, &["'/chatter' holds std_msgs/msg/String", known]);
    }
    assert_refused(&made("png"), &["--topic", "/camera"], 2, &["a folder of images has no topic '/camera'"]);
}

#[test]
fn broken_recordings_are_told_in_one_line() {
    let dir = tempfile::tempdir().expect("a folder");
    let topic = ["--topic", "/camera/raw"];
    let file = |name: &str, bytes: &[u8]| {
        let path = dir.path().join(name);
        fs::write(&path, bytes).expect("a file");
        path
    };
    let mcap = fs::read(made("bags/mcap/mcap.mcap")).expect("a bag");
    let sqlite = fs::read(made("bags/sqlite/sqlite.db3")).expect("a bag");
    for (part, readable) in [(0.001, false), (0.5, true), (0.99, true)] {
        let len = (mcap.len() as f64 * part) as usize;
        let cut = file("cut.mcap", &mcap[..len]);
        let told = format!("truncated after {len} bytes");
        if readable {
            let output = track(&cut, &topic);
            let said = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success() && said.contains(&told), "{said}");
            let rows = String::from_utf8_lossy(&output.stdout).lines().count() - 1;
            let expected = (FRAMES as f64 * part) as usize;
            assert!(rows + 1 >= expected && rows <= FRAMES, "{rows} rows of {part} of {FRAMES} frames");
        } else {
            assert_refused(&cut, &topic, 2, &[&told]);
        }
    }
    let cut = file("cut.db3", &sqlite[..sqlite.len() / 2]);
    let output = track(&cut, &topic);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(matches!(output.status.code(), Some(1 | 2)), "{said}");
    assert!(said.starts_with(&format!("error: {}: ", cut.display())) && said.lines().count() == 1, "{said}");

    assert_refused(&file("empty.mcap", b""), &topic, 2, &["empty (0 bytes)"]);
    assert_refused(&file("text.db3", b"SQLite format 4"), &topic, 2, &["neither an MCAP nor an SQLite file"]);
    let other = file("other.db3", b"");
    fs::remove_file(&other).expect("an empty file removed");
    rusqlite::Connection::open(&other).and_then(|c| c.execute("CREATE TABLE fruit (name)", [])).expect("a database");
    assert_refused(&other, &topic, 2, &["it lacks the tables 'topics' and 'messages'", "it has fruit"]);

    let metadata =
        file("metadata.yaml", b"rosbag2_bagfile_information: {relative_file_paths: [cut.mcap, gone_1.mcap]}");
    let output = track(dir.path(), &topic);
    let said = String::from_utf8_lossy(&output.stderr);
    let expected = format!("error: {}: names gone_1.mcap, which does not exist\n", metadata.display());
    assert_eq!((output.status.code(), said.as_ref()), (Some(2), expected.as_str()));
}

/// Bags made here, of messages that no frame can be made of.
#[test]
fn messages_that_give_no_frame_end_the_run_after_the_rows_before_them() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("a.mcap");
    let good = Image {
        header: Header::default(),
        height: 240,
        width: 320,
        encoding: "mono8".to_owned(),
        is_bigendian: 0,
        step: 320,
        data: (0..320 * 240_u32).map(|i| (i * i % 251) as u8).collect(),
    };
    let whole = cdr::encode(&good).expect("a message");
    let encoded = |change: fn(&mut Image)| {
        let mut image = good.clone();
        change(&mut image);
        cdr::encode(&image).expect("a message")
    };
    for (bytes, why) in [
        (encoded(|i| i.encoding = "rgb7".to_owned()), "encoding 'rgb7' is not supported"),
        (encoded(|i| i.step = 319), "step of 319 bytes is shorter than a row"),
        (encoded(|i| i.height = 241), "data of 76800 bytes is shorter than 241 rows"),
        (whole[..100].to_vec(), "100 bytes are not a sensor_msgs/msg/Image"),
        (vec![0; 2], "2 bytes are not a message"),
        ([&[0, 9], &whole[2..]].concat(), "representation 0x0009 is not plain CDR"),
    ] {
        let file = fs::File::create(&path).expect("a file");
        let mut bag = mcap::Writer::new(std::io::BufWriter::new(file)).expect("a bag");
        let schema = bag.add_schema("sensor_msgs/msg/Image", "ros2msg", b"").expect("a schema");
        let channel_id = bag.add_channel(schema, "/eye", "cdr", &Default::default()).expect("a channel");
        for (log_time, data) in [(2_000_000_005, &bytes), (1_000_000_000, &whole), (3_000_000_000, &whole)] {
            let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time, publish_time: log_time };
            bag.write_to_known_channel(&header, data).expect("a message written");
        }
        bag.finish().expect("the bag written");
        let output = track(&path, &["--init", "50,50,40,60"]);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{said}");
        let expected = format!("error: {}: message on '/eye' at 2.000000005 s: {why}", path.display());
        assert!(said.starts_with(&expected) && said.lines().count() == 1, "{said}");
        assert_eq!(String::from_utf8_lossy(&output.stdout).lines().count(), 2, "the header and the first frame");
    }
}
