//! What a file or folder holds that no frames are read from, and what to do about it.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use super::{bag, folder};

/// Bytes at the start of a file that tell what it is.
const START: u64 = 512;
/// How many names a message lists.
const LISTED: usize = 5;
/// Folders that are looked into for images or recordings, and entries of each of them.
const LOOKED_INTO: usize = 1000;

/// What the suffix of a video may be, where its first bytes do not tell.
const VIDEO: [&str; 21] = [
    "mp4", "m4v", "mov", "avi", "mkv", "webm", "mpg", "mpeg", "mts", "m2ts", "ts", "wmv", "flv", "ogv", "3gp", "h264",
    "264", "h265", "265", "hevc", "mjpeg",
];
/// Files that lie beside images and are none.
const COMPANIONS: [&str; 12] = ["txt", "csv", "json", "yaml", "yml", "xml", "md", "log", "html", "toml", "ini", "py"];
/// How compressed files begin, what they are called and what unpacks them.
const PACKED: [(&[u8], &str, &str); 7] = [
    (b"\x28\xb5\x2f\xfd", "zstd", "zstd -d"),
    (b"\x1f\x8b", "gzip", "gzip -dk"),
    (b"BZh", "bzip2", "bzip2 -dk"),
    (b"\xfd7zXZ\0", "xz", "xz -dk"),
    (b"\x04\x22\x4d\x18", "lz4", "lz4 -d"),
    (b"PK\x03\x04", "zip", "unzip"),
    (b"7z\xbc\xaf\x27\x1c", "7z", "7z x"),
];

/// What a file is that no frames are read from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Other {
    /// Nothing is in it.
    Empty,
    /// A recording of ROS 1.
    Ros1Bag,
    /// A video.
    Video,
    /// One image.
    Image,
    /// Compressed as a whole: by what, and what unpacks it.
    Packed(&'static str, &'static str),
    /// Text.
    Text,
    /// Named as a recording, but something else.
    NoBag,
    /// A pipe, a device or a socket.
    NoFile,
    /// Something else.
    Unknown,
}

impl Other {
    /// Looks at the first bytes and the name.
    pub fn of(path: &Path) -> io::Result<Self> {
        if !path.metadata()?.is_file() {
            return Ok(Self::NoFile);
        }
        let mut start = Vec::new();
        File::open(path)?.take(START).read_to_end(&mut start)?;
        let is = |suffixes: &[&str]| suffixes.contains(&suffix(path).as_str());
        let packed = PACKED.iter().find(|(magic, ..)| start.starts_with(magic));
        Ok(match start.as_slice() {
            [] => Self::Empty,
            s if s.starts_with(b"#ROSBAG") || s.starts_with(b"#ROSRECORD") => Self::Ros1Bag,
            s if is_video(s) || is(&VIDEO) => Self::Video,
            s if image::guess_format(s).is_ok() => Self::Image,
            _ if let Some(&(_, name, tool)) = packed => Self::Packed(name, tool),
            _ if is(&bag::SUFFIXES) => Self::NoBag,
            s if is_text(s) => Self::Text,
            _ => Self::Unknown,
        })
    }

    /// What to say of the file, after its name.
    pub fn advice(self, path: &Path) -> String {
        const SOURCES: &str =
            "SOURCE is a folder of images, the folder of a ROS 2 recording, or one file of it (.mcap, .db3)";
        let shown = path.display();
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        match self {
            Self::Empty => "the file is empty (0 bytes)".to_owned(),
            Self::Ros1Bag => format!(
                "a ROS 1 bag, which is not read; convert it to a ROS 2 recording with 'rosbags-convert --src \
                 \"{shown}\" --dst \"{stem}\"' ('pip install rosbags')"
            ),
            Self::Video => format!(
                "a video, which is not read; write its frames as images with 'mkdir \"{stem}\" && ffmpeg -i \
                 \"{shown}\" \"{stem}/%06d.png\"' and give that folder"
            ),
            Self::Image => "a single image; give the folder that holds the images".to_owned(),
            Self::Packed(name, tool) => format!(
                "the file is compressed as a whole ({name}), which is not read; unpack it first with '{tool} \
                 \"{shown}\"'"
            ),
            Self::Text => format!("a text file; {SOURCES}"),
            Self::NoBag => format!("neither an MCAP nor an SQLite file, whatever it is called; {SOURCES}"),
            Self::NoFile => format!("neither a file nor a folder; {SOURCES}"),
            Self::Unknown => format!("an unknown kind of file; {SOURCES}"),
        }
    }
}

/// The suffix of a name, in lower case.
pub fn suffix(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}

/// Whether the first bytes are those of MP4 and its kin, AVI, Matroska, an MPEG program stream, Flash, Windows Media or
/// Ogg.
fn is_video(start: &[u8]) -> bool {
    const STARTS: [&[u8]; 5] =
        [b"\x1a\x45\xdf\xa3", b"\0\0\x01\xba", b"FLV\x01", b"\x30\x26\xb2\x75\x8e\x66\xcf\x11", b"OggS"];
    let at = |offset: usize, magic: &[u8]| start.get(offset..).is_some_and(|s| s.starts_with(magic));
    // Images of the newer kinds come in the boxes of MP4.
    let still = [b"ftypavif", b"ftypheic", b"ftypmif1", b"ftypheix"].iter().any(|magic| at(4, *magic));
    STARTS.iter().any(|magic| at(0, magic))
        || (at(0, b"RIFF") && at(8, b"AVI "))
        || ([b"ftyp", b"moov", b"mdat", b"wide"].iter().any(|magic| at(4, *magic)) && !still)
}

/// Whether the bytes are UTF-8, as far as they go, without control characters but for those between lines and words.
fn is_text(start: &[u8]) -> bool {
    let control = |b: &u8| *b < b' ' && !b"\t\r\n\x0c".contains(b);
    let valid = match std::str::from_utf8(start) {
        Ok(_) => true,
        Err(e) => e.error_len().is_none(),
    };
    valid && !start.iter().any(control)
}

/// Files that are counted by their suffixes.
#[derive(Debug, Default)]
pub struct Tally {
    by_suffix: BTreeMap<String, usize>,
}

impl Tally {
    /// Counts a file.
    pub fn add(&mut self, path: &Path) {
        *self.by_suffix.entry(suffix(path)).or_default() += 1;
    }

    /// What looks like images or recordings that were passed over: not what usually lies beside images.
    pub fn strange(mut self) -> Self {
        self.by_suffix.retain(|suffix, _| !COMPANIONS.contains(&suffix.as_str()));
        self
    }

    /// Whether nothing was counted.
    pub fn is_empty(&self) -> bool {
        self.by_suffix.is_empty()
    }
}

/// `12 files (10 .gif, 1 .pdf, 1 without a suffix)`.
impl std::fmt::Display for Tally {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let count: usize = self.by_suffix.values().sum();
        let mut kinds: Vec<_> = self.by_suffix.iter().collect();
        kinds.sort_by_key(|(_, count)| std::cmp::Reverse(**count));
        let named = |(suffix, count): (&String, &usize)| match suffix.as_str() {
            "" => format!("{count} without a suffix"),
            suffix => format!("{count} .{suffix}"),
        };
        let kinds = listed(kinds.into_iter().map(named));
        write!(f, "{count} {} ({kinds})", if count == 1 { "file" } else { "files" })
    }
}

/// The first few, and how many more there are.
pub fn listed(mut all: impl Iterator<Item = String>) -> String {
    let first: Vec<_> = all.by_ref().take(LISTED).collect();
    match all.count() {
        0 => first.join(", "),
        more => format!("{} and {more} more", first.join(", ")),
    }
}

/// What to say of a folder that holds neither images nor a recording, after its name.
pub fn folder_advice(path: &Path, files: &[PathBuf]) -> String {
    let known = folder::EXTENSIONS.join(", ");
    let inner = inner_sources(path);
    let mut tally = Tally::default();
    files.iter().for_each(|file| tally.add(file));
    if !inner.is_empty() {
        let count = inner.len();
        let (these, one) = if count == 1 { ("a folder", "it") } else { ("folders", "one of them") };
        let names = listed(inner.into_iter());
        return format!(
            "no images ({known}) in the folder, but {these} with images or recordings; give {one}: {names}"
        );
    }
    for file in files {
        if let Ok(other @ (Other::Ros1Bag | Other::Video | Other::Packed(..))) = Other::of(file) {
            return format!("no images ({known}) in the folder, but {}: {}", tally, other.advice(file));
        }
    }
    if tally.is_empty() {
        return format!("no images ({known}) in the folder, which is empty");
    }
    format!("no images ({known}) in the folder, but {tally}")
}

/// The names of the folders below that images or recordings lie in.
fn inner_sources(path: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(path).into_iter().flatten().flatten().take(LOOKED_INTO);
    let holds = |folder: &Path| {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().take(LOOKED_INTO);
        entries.map(|e| e.path()).any(|e| folder::is_image(&e) || bag::is_named_as_bag(&e))
    };
    let is_source = |folder: &PathBuf| folder.is_dir() && (holds(folder) || holds(&folder.join(folder::IMAGE_FOLDER)));
    let mut found: Vec<_> = entries.map(|e| e.path()).filter(is_source).collect();
    found.sort();
    found.iter().map(|f| f.file_name().unwrap_or_default().to_string_lossy().into_owned()).collect()
}
