//! `metadata.yaml` of a rosbag2 folder: which files the recording is made of.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::BagError;
use crate::file;

/// Bytes that the file may have: those of a recording of ten thousand files, and more.
const MOST_BYTES: u64 = 4_000_000;

/// Brackets within each other that the file may have; recorders write two or three.
const MOST_DEPTH: usize = 64;

/// What makes a folder a bag.
pub const FILE_NAME: &str = "metadata.yaml";

/// What is needed of it.
#[derive(Debug, PartialEq)]
pub struct Metadata {
    /// The files in order; there is at least one.
    pub files: Vec<PathBuf>,
    /// Whether each message is compressed by itself, with Zstandard.
    pub compressed: bool,
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
    /// That of a folder; a file stands for itself.
    pub fn of(path: &Path) -> Result<Self, BagError> {
        if !path.is_dir() {
            return Ok(Self { files: vec![path.to_owned()], compressed: false });
        }
        let yaml = path.join(FILE_NAME);
        let text = file::read_text(&yaml, MOST_BYTES);
        let text = text.map_err(|error| BagError::Io { path: yaml.clone(), source: error.into() })?;
        let failed = |why: String| BagError::Metadata { path: yaml.clone(), why };
        let depth = depth(&text);
        if depth > MOST_DEPTH {
            return Err(failed(format!("{depth} brackets stand within each other, at most {MOST_DEPTH} are read")));
        }
        let document: Document = serde_yaml_ng::from_str(&text).map_err(|e| failed(e.to_string()))?;
        let info = document.rosbag2_bagfile_information;
        let (mode, format) = (info.compression_mode.unwrap_or_default(), info.compression_format.unwrap_or_default());
        let compressed = match mode.to_ascii_lowercase().as_str() {
            // MCAP compresses in its own way, which is told in the file.
            "" | "none" | "storage" => false,
            "message" if format == "zstd" => true,
            _ => {
                return Err(failed(format!(
                    "compression '{format}' by '{mode}' is not read; decompress the bag first"
                )));
            }
        };
        if info.relative_file_paths.is_empty() {
            return Err(failed("names no files".to_owned()));
        }
        let located = |file: String| locate(path, &file).ok_or(BagError::MissingFile { path: yaml.clone(), file });
        let files = info.relative_file_paths.into_iter().map(located).collect::<Result<_, _>>()?;
        Ok(Self { files, compressed })
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

/// Where the file is. Before version 4 the names began with that of the folder.
fn locate(folder: &Path, file: &str) -> Option<PathBuf> {
    let bare = Path::new(file).file_name()?;
    [folder.join(file), folder.join(bare)].into_iter().find(|p| p.is_file())
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
        assert_eq!(metadata, Ok(Metadata { files, compressed: false }));
        let file = dir.path().join("a_0.mcap");
        assert_eq!(Metadata::of(&file).unwrap().files, [file]);
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        for (information, why) in [
            ("relative_file_paths: [a_0.mcap, a_2.mcap]", "names a_2.mcap, which is not there"),
            ("relative_file_paths: []", "names no files"),
            ("files: 3", "missing field `relative_file_paths`"),
            (
                "relative_file_paths: [a_0.mcap], compression_mode: FILE, compression_format: zstd",
                "compression 'zstd' by 'FILE' is not read; decompress the bag first",
            ),
        ] {
            let (dir, metadata) = read(information);
            let message = metadata.unwrap_err();
            assert!(message.starts_with(&format!("{}: ", dir.path().join(FILE_NAME).display())), "{message}");
            assert!(message.contains(why), "{message}");
        }
        let (_dir, metadata) =
            read("relative_file_paths: [a_0.mcap], compression_mode: MESSAGE, compression_format: zstd");
        assert!(metadata.unwrap().compressed);
    }
}
