//! A rosbag2 recording as a source of frames: a folder with `metadata.yaml` and the files it names, or one such file.
//!
//! [`metadata`] says which files there are, [`mcap`] and [`sqlite`] read one, [`topics`] chooses whose images are
//! wanted. Files follow each other as `metadata.yaml` lists them, or without it by the times of their first messages,
//! and messages within a file by the time at which they were recorded, which is how rosbag2 plays them. A message that
//! is compressed by itself tells so by its first bytes, which no plain message has.

mod inflate;
pub mod mcap;
pub mod metadata;
pub mod sqlite;
pub mod topics;

use std::io::Read;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

pub use self::inflate::InflateError;
use self::metadata::Metadata;
use self::topics::Choice;
pub use self::topics::{Picture, TopicInfo};
use super::other::{self, Other};
use super::truth::FILE_NAME;
use super::{FrameSource, Origin, ReplayError, folder};
use crate::decode::DecodeError;
use crate::error::FrameError;
use crate::file;
use crate::frame::FrameBuffer;
use crate::messages::cdr::{self, CdrError};
use crate::messages::{CompressedImage, Header, Image, Topic, convert};
use crate::params::Limits;

/// Why a bag, or a message in it, cannot be read. Each message names the file.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum BagError {
    /// The file system refuses.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    /// `metadata.yaml` cannot be understood.
    #[error("{}: {why}", path.display())]
    Metadata { path: PathBuf, why: String },
    /// `metadata.yaml` names a file that is not there.
    #[error("{}: names {file}, which does not exist", path.display())]
    MissingFile { path: PathBuf, file: String },
    /// A folder cannot be listed.
    #[error(transparent)]
    Folder(Box<ReplayError>),
    /// The file is of another kind.
    #[error("{}: {advice}", path.display())]
    Kind { path: PathBuf, advice: String },
    /// The end of the file is missing, and no message is in it.
    #[error("{}: truncated after {len} bytes, before the end of the first message", path.display())]
    CutOff { path: PathBuf, len: u64 },
    /// The file is broken, or made in a way that is not read here.
    #[error("{}: {why}", path.display())]
    Broken { path: PathBuf, why: String },
    /// The topic that was asked for is not there.
    #[error("{}: no topic '{topic}'; {known}", path.display())]
    NoTopic { path: PathBuf, topic: String, known: String },
    /// The topic that was asked for holds something else.
    #[error("{}: topic '{topic}' holds {kind}; {known}", path.display())]
    NoImages { path: PathBuf, topic: String, kind: String, known: String },
    /// No topic was asked for, and there is not just one that could be meant.
    #[error("{}: choose one with --topic NAME; {known}", path.display())]
    Choose { path: PathBuf, known: String },
    /// No topic holds images, and why not.
    #[error("{}: no topic with images; {known}{reason}", path.display())]
    NothingToSee { path: PathBuf, known: String, reason: &'static str },
    /// There are topics with images, but without a message.
    #[error("{}: nothing was recorded on a topic with images; {known}", path.display())]
    NothingRecorded { path: PathBuf, known: String },
    /// The topic is there, but nothing was recorded.
    #[error("{}: no message on '{topic}'", path.display())]
    Empty { path: PathBuf, topic: String },
    /// A message does not give a frame.
    #[error("{}: message on '{topic}' at {}.{:09} s: {source}", path.display(), time / NANOS, time % NANOS)]
    Message { path: PathBuf, topic: String, time: u64, source: Box<MessageError> },
}

/// Why a message does not give a frame.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum MessageError {
    /// It is compressed by itself and cannot be read.
    #[error(transparent)]
    Inflate(#[from] InflateError),
    /// It is not of its type.
    #[error(transparent)]
    Cdr(#[from] CdrError),
    /// Its fields do not fit its pixels.
    #[error(transparent)]
    Raw(#[from] FrameError),
    /// The image in it cannot be decoded.
    #[error("format '{format}' {source}")]
    Compressed { format: String, source: DecodeError },
}

/// How a Zstandard frame begins. Plain CDR begins with a zero.
const COMPRESSED: &[u8] = b"\x28\xb5\x2f\xfd";
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

/// What was recorded in a file.
#[derive(Debug, Default)]
pub struct Contents {
    /// The topics that it names.
    pub topics: Vec<TopicInfo>,
    /// The times of the first and the last message; `None` where there is none.
    pub span: Option<(u64, u64)>,
    /// What had to be mended to read it.
    pub note: Option<String>,
}

/// What a file of a bag is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BagKind {
    /// MCAP, the default of rosbag2.
    Mcap,
    /// An SQLite database, the default until ROS 2 Iron.
    Sqlite,
}

impl BagKind {
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
    fn contents(self, path: &Path, limits: &Limits) -> Result<Contents, BagError> {
        match self {
            Self::Mcap => mcap::contents(path, limits),
            Self::Sqlite => sqlite::contents(path, limits),
        }
    }

    fn messages(self, path: &Path, topic: &str, limits: &Limits) -> Result<Box<dyn Messages>, BagError> {
        Ok(match self {
            Self::Mcap => Box::new(mcap::Reader::open(path, topic, limits)?),
            Self::Sqlite => Box::new(sqlite::Reader::open(path, topic, limits)?),
        })
    }
}

/// What recordings are called.
pub const SUFFIXES: [&str; 2] = ["mcap", "db3"];

/// Whether the file is called a recording, packed or not.
pub fn is_named_as_bag(path: &Path) -> bool {
    let is = |path: &Path| SUFFIXES.contains(&other::suffix(path).as_str());
    path.is_file() && (is(path) || other::suffix(path) == metadata::ZSTD_SUFFIX && is(&path.with_extension("")))
}

/// Whether the path is meant as a bag: a file that is one, or a folder with `metadata.yaml` or with recordings and no
/// images.
pub fn is_bag(path: &Path) -> Result<bool, ReplayError> {
    if !path.is_dir() {
        return Ok(path.is_file() && matches!(BagKind::of(path), Ok(Some(_))));
    }
    let is_bag = path.join(metadata::FILE_NAME).is_file();
    Ok(is_bag || (!metadata::recordings(path)?.is_empty() && !folder::has_images(path)?))
}

/// The images of one topic.
pub struct Bag {
    /// What was opened, for messages and for the boxes beside it.
    path: PathBuf,
    topic: String,
    picture: Picture,
    files: std::vec::IntoIter<(PathBuf, BagKind)>,
    current: Option<(PathBuf, Box<dyn Messages>)>,
    remaining: usize,
    message: Recorded,
    header: Header,
    notes: Vec<String>,
    limits: Limits,
}

impl Bag {
    /// Opens a folder or a file. Every file is looked at, so that what is missing is known before the first frame.
    pub fn open(path: &Path, topic: Option<&str>, limits: &Limits) -> Result<Self, BagError> {
        let Metadata { files, ordered } = Metadata::of(path)?;
        let mut notes = Vec::new();
        let mut parts = Vec::new();
        let several = files.len() > 1;
        for file in files {
            let failed = |source| BagError::Io { path: file.clone(), source };
            match BagKind::of(&file).map_err(failed)? {
                Some(kind) => {
                    let contents = kind.contents(&file, limits)?;
                    notes.extend(contents.note.as_ref().map(|note| format!("{}: {note}", file.display())));
                    parts.push(Part { file, kind, contents });
                }
                None => match Other::of(&file).map_err(failed)? {
                    // What a recorder leaves that was ended before it wrote the first message.
                    Other::Empty if several => notes.push(format!("{}: empty, ignored", file.display())),
                    other => {
                        let advice = other.advice(&file);
                        return Err(BagError::Kind { path: file, advice });
                    }
                },
            }
        }
        if !ordered {
            notes.push(format!("{}: {}", path.display(), by_time(&mut parts)));
        }
        let mut all = Vec::new();
        parts.iter_mut().for_each(|part| topics::merge(&mut all, std::mem::take(&mut part.contents.topics)));
        let Choice { topic, picture, note } = topics::choose(path, &all, topic)?;
        if topic.count == 0 {
            return Err(BagError::Empty { path: path.to_owned(), topic: topic.name.clone() });
        }
        notes.extend(note.map(|note| format!("{}: {note}", path.display())));
        Ok(Self {
            path: path.to_owned(),
            topic: topic.name.clone(),
            picture,
            files: parts.into_iter().map(|part| (part.file, part.kind)).collect::<Vec<_>>().into_iter(),
            current: None,
            remaining: usize::try_from(topic.count).unwrap_or(usize::MAX),
            message: Recorded::default(),
            header: Header::default(),
            notes,
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
    fn frame(&mut self) -> Result<FrameBuffer, MessageError> {
        if self.message.bytes.starts_with(COMPRESSED) {
            let most = usize::try_from(self.limits.message_bytes()).unwrap_or(usize::MAX);
            self.message.bytes = inflate::zstd(&self.message.bytes, most)?;
        }
        match self.picture {
            Picture::Raw => {
                let image: Image = self.message()?;
                self.header = image.header.clone();
                Ok(convert::raw(image)?)
            }
            Picture::Compressed => {
                let image: CompressedImage = self.message()?;
                let frame = convert::compressed(&image, self.limits.image_bytes());
                self.header = image.header;
                frame.map_err(|source| MessageError::Compressed { format: image.format, source })
            }
        }
    }

    fn message<T: Topic + DeserializeOwned>(&self) -> Result<T, CdrError> {
        cdr::decode(&self.message.bytes)
    }
}

/// A file of a bag that has been looked at.
struct Part {
    file: PathBuf,
    kind: BagKind,
    contents: Contents,
}

/// Puts files that nobody has listed into the order of their first messages; those without messages stay behind. Gives
/// what to say of it.
fn by_time(parts: &mut [Part]) -> String {
    let name = |part: &Part| part.file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let named: Vec<_> = parts.iter().map(name).collect();
    parts.sort_by_key(|part| part.contents.span.map_or(u64::MAX, |(first, _)| first));
    let timed: Vec<_> = parts.iter().map(name).collect();
    let count = parts.len();
    let missing = format!("no {} beside the recording (perhaps it was not closed)", metadata::FILE_NAME);
    let read = if count == 1 { format!("{} is read", timed[0]) } else { format!("its {count} files are read") };
    let order = match count {
        1 => "",
        _ if timed == named => " in the order of their names, which is that of their times",
        _ => " in the order of their times, which is not that of their names",
    };
    let overlap = parts.windows(2).find(|pair| match (pair[0].contents.span, pair[1].contents.span) {
        (Some((_, end)), Some((begin, _))) => begin < end,
        _ => false,
    });
    let overlap = overlap.map_or(String::new(), |pair| {
        format!("; {} begins before {} ends: they may be two recordings", name(&pair[1]), name(&pair[0]))
    });
    format!("{missing}; {read}{order}{overlap}")
}

impl FrameSource for Bag {
    fn next_frame(&mut self) -> Result<Option<FrameBuffer>, ReplayError> {
        if !self.advance()? {
            return Ok(None);
        }
        self.remaining = self.remaining.saturating_sub(1);
        self.frame().map(Some).map_err(|source| {
            let path = self.current.as_ref().map_or(&self.path, |(path, _)| path).clone();
            BagError::Message { path, topic: self.topic.clone(), time: self.message.log_time, source: source.into() }
                .into()
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

    fn notes(&self) -> &[String] {
        &self.notes
    }
}
