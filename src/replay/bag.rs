//! A rosbag2 recording as a source of frames: a folder with `metadata.yaml` and the files it names, or one such file.
//!
//! [`metadata`] says which files there are, [`mcap`] and [`sqlite`] read one, [`topics`] chooses whose images are wanted.
//! Files follow each other as `metadata.yaml` lists them, and messages within a file by the time at which they were
//! recorded, which is how rosbag2 plays them.

mod inflate;
pub mod mcap;
pub mod metadata;
pub mod sqlite;
pub mod topics;

use std::io::Read;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use self::metadata::Metadata;
pub use self::topics::{Picture, TopicInfo};
use super::truth::FILE_NAME;
use super::{FrameSource, Origin, ReplayError};
use crate::file;
use crate::frame::FrameBuffer;
use crate::messages::{CompressedImage, Header, Image, Topic, cdr, convert};
use crate::params::Limits;

/// Why a bag, or a message in it, cannot be read. Each message names the file.
#[derive(Debug, thiserror::Error)]
pub enum BagError {
    /// The file system refuses.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    /// `metadata.yaml` cannot be understood.
    #[error("{}: {why}", path.display())]
    Metadata { path: PathBuf, why: String },
    /// `metadata.yaml` names a file that is not there.
    #[error("{}: names {file}, which is not there", path.display())]
    MissingFile { path: PathBuf, file: String },
    /// The file is of another kind.
    #[error("{}: neither an MCAP nor an SQLite file", .0.display())]
    Kind(PathBuf),
    /// The end of the file is missing.
    #[error(
        "{}: cut off after {len} bytes: an MCAP file has an index at its end ('mcap recover' saves what is there)",
        path.display()
    )]
    CutOff { path: PathBuf, len: u64 },
    /// The file is broken, or made in a way that is not read here.
    #[error("{}: {why}", path.display())]
    Broken { path: PathBuf, why: String },
    /// The topic that was asked for is not there.
    #[error("{}: no topic '{topic}'; topics with images: {known}", path.display())]
    NoTopic { path: PathBuf, topic: String, known: String },
    /// The topic that was asked for holds something else.
    #[error("{}: topic '{topic}' holds {kind}; topics with images: {known}", path.display())]
    NoImages { path: PathBuf, topic: String, kind: String, known: String },
    /// No topic was asked for, and there is not just one that could be meant.
    #[error("{}: choose by --topic NAME; topics with images: {known}", path.display())]
    Choose { path: PathBuf, known: String },
    /// The topic is there, but nothing was recorded.
    #[error("{}: no message on '{topic}'", path.display())]
    Empty { path: PathBuf, topic: String },
    /// A message does not give a frame.
    #[error("{}: message on '{topic}' at {}.{:09} s: {why}", path.display(), time / NANOS, time % NANOS)]
    Message { path: PathBuf, topic: String, time: u64, why: String },
}

/// Nanoseconds of a second.
const NANOS: u64 = 1_000_000_000;

/// A recorded message.
#[derive(Debug, Default)]
pub struct Recorded {
    /// When it was recorded, in nanoseconds since the epoch.
    pub log_time: u64,
    /// CDR, with its header.
    pub bytes: Vec<u8>,
}

/// The messages of one topic of one file, by the time at which they were recorded.
pub trait Messages: Send {
    /// Overwrites `message` by the next; `false` after the last.
    fn next_into(&mut self, message: &mut Recorded) -> Result<bool, BagError>;
}

/// What a file of a bag is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// MCAP, the default of rosbag2.
    Mcap,
    /// An SQLite database, the default until ROS 2 Iron.
    Sqlite,
}

impl Kind {
    /// What the first bytes of a file say; `None` for other files.
    fn of(path: &Path) -> std::io::Result<Option<Self>> {
        const LONGEST: u64 = sqlite::MAGIC.len() as u64;
        let mut start = Vec::new();
        file::open(path).map_err(std::io::Error::from)?.0.take(LONGEST).read_to_end(&mut start)?;
        Ok(match start {
            s if s.starts_with(mcap::MAGIC) => Some(Self::Mcap),
            s if s.starts_with(sqlite::MAGIC) => Some(Self::Sqlite),
            _ => None,
        })
    }

    /// What was recorded in the file.
    fn topics(self, path: &Path, limits: &Limits) -> Result<Vec<TopicInfo>, BagError> {
        match self {
            Self::Mcap => mcap::topics(path, limits),
            Self::Sqlite => sqlite::topics(path, limits),
        }
    }

    fn messages(self, path: &Path, topic: &str, limits: &Limits) -> Result<Box<dyn Messages>, BagError> {
        Ok(match self {
            Self::Mcap => Box::new(mcap::Reader::open(path, topic, limits)?),
            Self::Sqlite => Box::new(sqlite::Reader::open(path, topic, limits)?),
        })
    }
}

/// Whether the path is meant as a bag: a folder with `metadata.yaml`, or a file that is or is called one.
pub fn is_bag(path: &Path) -> bool {
    if path.is_dir() {
        return path.join(metadata::FILE_NAME).is_file();
    }
    let called = path.extension().is_some_and(|e| e == "mcap" || e == "db3");
    path.is_file() && (called || matches!(Kind::of(path), Ok(Some(_))))
}

/// The images of one topic.
pub struct Bag {
    /// What was opened, for messages and for the boxes beside it.
    path: PathBuf,
    topic: String,
    picture: Picture,
    files: std::vec::IntoIter<(PathBuf, Kind)>,
    current: Option<(PathBuf, Box<dyn Messages>)>,
    /// Whether each message is a Zstandard frame.
    compressed: bool,
    remaining: usize,
    message: Recorded,
    header: Header,
    limits: Limits,
}

impl Bag {
    /// Opens a folder or a file. Every file is looked at, so that what is missing is known before the first frame.
    pub fn open(path: &Path, topic: Option<&str>, limits: &Limits) -> Result<Self, BagError> {
        let Metadata { files, compressed } = Metadata::of(path)?;
        let mut kinds = Vec::new();
        let mut all = Vec::new();
        for file in files {
            let kind = Kind::of(&file).map_err(|source| BagError::Io { path: file.clone(), source })?;
            let kind = kind.ok_or_else(|| BagError::Kind(file.clone()))?;
            topics::merge(&mut all, kind.topics(&file, limits)?);
            kinds.push((file, kind));
        }
        let (info, picture) = topics::choose(path, &all, topic)?;
        if info.count == 0 {
            return Err(BagError::Empty { path: path.to_owned(), topic: info.name.clone() });
        }
        Ok(Self {
            path: path.to_owned(),
            topic: info.name.clone(),
            picture,
            files: kinds.into_iter(),
            current: None,
            compressed,
            remaining: usize::try_from(info.count).unwrap_or(usize::MAX),
            message: Recorded::default(),
            header: Header::default(),
            limits: limits.clone(),
        })
    }

    /// Reads the next message; `false` after the last of the last file.
    fn advance(&mut self) -> Result<bool, BagError> {
        loop {
            if self.current.is_none() {
                let Some((path, kind)) = self.files.next() else { return Ok(false) };
                let messages = kind.messages(&path, &self.topic, &self.limits)?;
                self.current = Some((path, messages));
            }
            if let Some((_, messages)) = &mut self.current
                && messages.next_into(&mut self.message)?
            {
                return Ok(true);
            }
            self.current = None;
        }
    }

    /// The frame in the message that was read last.
    fn frame(&mut self) -> Result<FrameBuffer, String> {
        if self.compressed {
            let most = usize::try_from(self.limits.message_bytes()).unwrap_or(usize::MAX);
            self.message.bytes = inflate::zstd(&self.message.bytes, most)?;
        }
        match self.picture {
            Picture::Raw => {
                let image: Image = self.message()?;
                self.header = image.header.clone();
                convert::raw(image).map_err(|e| e.to_string())
            }
            Picture::Compressed => {
                let image: CompressedImage = self.message()?;
                let frame = convert::compressed(&image, self.limits.image_bytes())
                    .map_err(|e| format!("format '{}' {e}", image.format));
                self.header = image.header;
                frame
            }
        }
    }

    fn message<T: Topic + DeserializeOwned>(&self) -> Result<T, String> {
        cdr::decode(&self.message.bytes).map_err(|e| e.to_string())
    }
}

impl FrameSource for Bag {
    fn next_frame(&mut self) -> Result<Option<FrameBuffer>, ReplayError> {
        if !self.advance()? {
            return Ok(None);
        }
        self.remaining = self.remaining.saturating_sub(1);
        self.frame().map(Some).map_err(|why| {
            let path = self.current.as_ref().map_or(&self.path, |(path, _)| path).clone();
            BagError::Message { path, topic: self.topic.clone(), time: self.message.log_time, why }.into()
        })
    }

    fn origin(&self) -> Origin<'_> {
        let Recorded { log_time, bytes } = &self.message;
        Origin::Message { topic: &self.topic, picture: self.picture, log_time: *log_time, header: &self.header, bytes }
    }

    fn remaining(&self) -> Option<usize> {
        Some(self.remaining)
    }

    fn truth_candidates(&self) -> Vec<PathBuf> {
        let folder = if self.path.is_dir() { Some(self.path.as_path()) } else { self.path.parent() };
        folder.map(|f| f.join(FILE_NAME)).into_iter().collect()
    }
}
