//! `metadata.yaml` of a rosbag2 folder: which files the recording is made of.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::{BagError, is_named_as_bag};
use crate::file;
use crate::replay::{folder, order, other};

/// Bytes that the file may have: those of a recording of ten thousand files, and more.
const MOST_BYTES: u64 = 4_000_000;

/// Brackets within each other that the file may have; recorders write two or three.
const MOST_DEPTH: usize = 64;

/// What makes a folder a bag.
pub const FILE_NAME: &str = "metadata.yaml";
/// The compression that rosbag2 offers.
const ZSTD: &str = "zstd";
/// What it puts behind the name of a file that it compressed as a whole.
pub const ZSTD_SUFFIX: &str = "zstd";

/// Which files a recording is made of.
#[derive(Debug, PartialEq)]
pub struct Metadata {
    /// There is at least one.
    pub files: Vec<PathBuf>,
    /// Whether they stand in order, as `metadata.yaml` lists them. Without it they are in the order of their names,
    /// which need not be that of time.
    pub ordered: bool,
}

#[derive(Deserialize)]
struct Document {
    rosbag2_bagfile_information: Information,
}

#[derive(Deserialize)]
struct Information {
    relative_file_paths: Vec<String>,
    #[serde(default)]
    compression_format: Option<String>,
    #[serde(default)]
    compression_mode: Option<String>,
}

impl Metadata {
    /// That of a folder; a file stands for itself. Without the file, which is written when the recording ends, or with
    /// one in which nothing was written yet, the recordings in the folder are taken.
    pub fn of(path: &Path) -> Result<Self, BagError> {
        if !path.is_dir() {
            return Ok(Self { files: vec![path.to_owned()], ordered: true });
        }
        let yaml = path.join(FILE_NAME);
        let text = match file::read_text(&yaml, MOST_BYTES).map_err(std::io::Error::from) {
            Err(error) if error.kind() == ErrorKind::NotFound => String::new(),
            text => text.map_err(|source| BagError::Io { path: yaml.clone(), source })?,
        };
        if text.trim_matches(|c: char| c == '\0' || c.is_whitespace()).is_empty() {
            return Self::without(path);
        }
        let failed = |why: String| BagError::Metadata { path: yaml.clone(), why };
        let depth = depth(&text);
        if depth > MOST_DEPTH {
            return Err(failed(format!("brackets are nested {depth} deep, at most {MOST_DEPTH} are allowed")));
        }
        let document: Document = serde_yaml_ng::from_str(&text).map_err(|e| failed(e.to_string()))?;
        let info = document.rosbag2_bagfile_information;
        let (mode, format) = (info.compression_mode.unwrap_or_default(), info.compression_format.unwrap_or_default());
        // MCAP compresses in its own way, which is told in the file; a compressed message tells by itself.
        match mode.to_ascii_lowercase().as_str() {
            "" | "none" | "storage" => {}
            "message" | "file" if format == ZSTD => {}
            _ => {
                return Err(failed(format!(
                    "compression '{format}' by '{mode}' is not supported; decompress the bag first"
                )));
            }
        }
        if info.relative_file_paths.is_empty() {
            return Err(failed("names no files".to_owned()));
        }
        let located = |file: String| locate(path, &file).ok_or(BagError::MissingFile { path: yaml.clone(), file });
        let files = info.relative_file_paths.into_iter().map(located).collect::<Result<_, _>>()?;
        Ok(Self { files, ordered: true })
    }

    /// The recordings in a folder that does not tell of them; of one that is there packed and unpacked, the latter.
    fn without(path: &Path) -> Result<Self, BagError> {
        let mut files = recordings(path)?;
        let unpacked: Vec<_> = files.clone();
        files.retain(|file| other::suffix(file) != ZSTD_SUFFIX || !unpacked.contains(&file.with_extension("")));
        if files.is_empty() {
            let why = format!("{FILE_NAME} is empty, and there are no recordings (.mcap, .db3) beside it");
            return Err(BagError::Metadata { path: path.to_owned(), why });
        }
        order::sort(&mut files);
        Ok(Self { files, ordered: false })
    }
}

/// How many brackets stand within each other: what takes the reader of YAML a time that grows with the square of them.
fn depth(text: &str) -> usize {
    let mut open: usize = 0;
    let deepest = text.bytes().map(|byte| {
        match byte {
            b'[' | b'{' => open += 1,
            b']' | b'}' => open = open.saturating_sub(1),
            _ => {}
        }
        open
    });
    deepest.max().unwrap_or(0)
}

/// The files of a folder that are called recordings, packed ones included.
pub fn recordings(path: &Path) -> Result<Vec<PathBuf>, BagError> {
    let files = folder::files(path).map_err(|error| BagError::Folder(Box::new(error)))?;
    Ok(files.into_iter().filter(|file| is_named_as_bag(file)).collect())
}

/// Where the file is. Before version 4 the names began with that of the folder; and a file that was compressed may have
/// been unpacked since.
fn locate(folder: &Path, file: &str) -> Option<PathBuf> {
    let bare = Path::new(file).file_name()?;
    let unpacked =
        Path::new(bare).extension().filter(|e| *e == ZSTD_SUFFIX).map(|_| Path::new(bare).with_extension(""));
    let places = unpacked.map(|name| folder.join(name)).into_iter().chain([folder.join(file), folder.join(bare)]);
    places.into_iter().find(|p| p.is_file())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(information: &str) -> (tempfile::TempDir, Result<Metadata, String>) {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("a_0.mcap"), b"").unwrap();
        std::fs::write(dir.path().join("a_1.mcap"), b"").unwrap();
        let text = format!("rosbag2_bagfile_information: {{version: 5, {information}}}\n");
        std::fs::write(dir.path().join(FILE_NAME), text).unwrap();
        let metadata = Metadata::of(dir.path()).map_err(|e| e.to_string());
        (dir, metadata)
    }

    #[test]
    fn files_are_listed_in_order_with_or_without_the_name_of_the_folder() {
        let (dir, metadata) = read("relative_file_paths: [a_1.mcap, a/a_0.mcap], compression_mode: ''");
        let files = ["a_1.mcap", "a_0.mcap"].map(|f| dir.path().join(f)).to_vec();
        assert_eq!(metadata, Ok(Metadata { files, ordered: true }));
        let file = dir.path().join("a_0.mcap");
        assert_eq!(Metadata::of(&file).unwrap().files, [file]);
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        for (information, why) in [
            ("relative_file_paths: [a_0.mcap, a_2.mcap]", "names a_2.mcap, which does not exist"),
            ("relative_file_paths: []", "names no files"),
            ("files: 3", "missing field `relative_file_paths`"),
            (
                "relative_file_paths: [a_0.mcap], compression_mode: FILE, compression_format: lz4",
                "compression 'lz4' by 'FILE' is not supported; decompress the bag first",
            ),
        ] {
            let (dir, metadata) = read(information);
            let message = metadata.unwrap_err();
            assert!(message.starts_with(&format!("{}: ", dir.path().join(FILE_NAME).display())), "{message}");
            assert!(message.contains(why), "{message}");
        }
    }

    #[test]
    fn a_file_that_has_been_unpacked_is_taken_for_the_packed_one() {
        let (dir, metadata) =
            read("relative_file_paths: [a/a_0.mcap.zstd], compression_mode: FILE, compression_format: zstd");
        assert_eq!(metadata.unwrap().files, [dir.path().join("a_0.mcap")]);
    }

    #[test]
    fn without_a_word_of_the_recorder_the_files_are_those_of_the_folder() {
        let dir = tempfile::tempdir().unwrap();
        let path = |name: &str| dir.path().join(name);
        std::fs::write(path(FILE_NAME), " \n\0\0").unwrap();
        let message = Metadata::of(dir.path()).unwrap_err().to_string();
        assert!(message.contains("metadata.yaml is empty, and there are no recordings"), "{message}");
        for name in ["a_10.mcap", "a_9.mcap", "a_9.mcap.zstd", "a_11.db3.zstd", "._a_9.mcap", "notes.txt"] {
            std::fs::write(path(name), b"").unwrap();
        }
        let files = ["a_9.mcap", "a_10.mcap", "a_11.db3.zstd"].map(path).to_vec();
        let expected = Metadata { files, ordered: false };
        assert_eq!(Metadata::of(dir.path()).unwrap(), expected);
        std::fs::remove_file(path(FILE_NAME)).unwrap();
        assert_eq!(Metadata::of(dir.path()).unwrap(), expected);
    }
}
