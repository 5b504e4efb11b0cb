//! Files that are read as a whole: regular ones, and no more of them than asked for. A FIFO or a device would keep the
//! reader waiting, or never end.

use std::fs::{File, FileType, Metadata, OpenOptions};
use std::io::{self, Read};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::Path;

use rustix::fs::OFlags;

/// Why a file is not read.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum FileError {
    /// The file system refuses.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// It is something else than a regular file.
    #[error("it is {0}, expected a regular file")]
    Irregular(&'static str),
    /// It is larger than what is read.
    #[error("it has {len} bytes, at most {most} are allowed")]
    TooLarge { len: u64, most: u64 },
}

impl From<FileError> for io::Error {
    fn from(error: FileError) -> Self {
        match error {
            FileError::Io(error) => error,
            FileError::Irregular(_) => Self::new(io::ErrorKind::InvalidInput, error),
            FileError::TooLarge { .. } => Self::new(io::ErrorKind::FileTooLarge, error),
        }
    }
}

/// Opens a regular file, never waiting for one that is something else.
pub fn open(path: &Path) -> Result<(File, Metadata), FileError> {
    // Before it is opened, for opening alone does something to some devices; and again, for it may be another by then.
    regular(&std::fs::metadata(path)?)?;
    let file = OpenOptions::new().read(true).custom_flags(OFlags::NONBLOCK.bits().cast_signed()).open(path)?;
    let metadata = file.metadata()?;
    regular(&metadata)?;
    Ok((file, metadata))
}

/// The bytes of a regular file of at most `most` bytes.
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>, FileError> {
    let (file, metadata) = open(path)?;
    let len = metadata.len();
    if len > most {
        return Err(FileError::TooLarge { len, most });
    }
    let mut bytes = Vec::new();
    // It may grow while it is read.
    file.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
    let len = bytes.len() as u64;
    if len > most { Err(FileError::TooLarge { len, most }) } else { Ok(bytes) }
}

/// The text of a regular file of at most `most` bytes.
pub fn read_text(path: &Path, most: u64) -> Result<String, FileError> {
    let text = String::from_utf8(read(path, most)?);
    text.map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error.utf8_error()).into())
}

fn regular(metadata: &Metadata) -> Result<(), FileError> {
    let kind = metadata.file_type();
    if kind.is_file() { Ok(()) } else { Err(FileError::Irregular(name(kind))) }
}

fn name(kind: FileType) -> &'static str {
    match kind {
        _ if kind.is_dir() => "a folder",
        _ if kind.is_fifo() => "a FIFO",
        _ if kind.is_char_device() || kind.is_block_device() => "a device",
        _ if kind.is_socket() => "a socket",
        _ => "not a regular file",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regular_files_are_read_up_to_the_limit() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        std::fs::write(&path, "four").unwrap();
        assert_eq!(read(&path, 4).unwrap(), b"four");
        assert_eq!(read_text(&path, 100).unwrap(), "four");
        assert_eq!(read(&path, 3).unwrap_err().to_string(), "it has 4 bytes, at most 3 are allowed");
        let linked = dir.path().join("b");
        std::os::unix::fs::symlink(&path, &linked).unwrap();
        assert_eq!(read(&linked, 4).unwrap(), b"four");
    }

    #[test]
    fn what_would_never_end_or_never_begin_is_refused_by_its_kind() {
        let dir = tempfile::tempdir().unwrap();
        let fifo = dir.path().join("fifo");
        assert!(std::process::Command::new("mkfifo").arg(&fifo).status().unwrap().success());
        let _socket = std::os::unix::net::UnixListener::bind(dir.path().join("socket")).unwrap();
        for (path, kind) in [
            (fifo.as_path(), "a FIFO"),
            (Path::new("/dev/zero"), "a device"),
            (dir.path(), "a folder"),
            (&dir.path().join("socket"), "a socket"),
        ] {
            let message = read(path, 100).unwrap_err().to_string();
            assert_eq!(message, format!("it is {kind}, expected a regular file"));
        }
        // A file of no length that has more to give, as those of the kernel.
        assert!(matches!(read(Path::new("/proc/self/maps"), 10), Err(FileError::TooLarge { len: 11, most: 10 })));
    }
}
