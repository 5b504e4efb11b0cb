//! Bags in MCAP files. The index at the end of a file tells where the chunks are, and these are read in order of time;
//! a file that was written without chunks is looked through once instead. Where the index is missing, messages are read
//! in the order in which they were written.
//!
//! No length in a file is believed: a record must lie in the file, what is read of it or made of it is bounded, and so
//! is what is held at a time. Records that are not needed, however large, are passed over.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

pub use mcap::MAGIC;
use mcap::McapError;
use mcap::records::{Channel, ChunkIndex, Footer, MessageHeader, Record, Statistics, op};

pub use self::chunks::Chunks;
use self::unindexed::{Found, Unindexed};
use super::{BagError, Contents, Messages, Recorded, TopicInfo};
use crate::params::Limits;

mod chunks;
mod unindexed;

/// Bytes before the body of a record: its kind and its length.
const RECORD_HEADER: usize = 9;
/// Bytes before the data of a message: channel, sequence number, two times.
const MESSAGE_HEADER: usize = 22;
/// Bytes of the last record, which says where the index is.
const FOOTER: usize = 20;

/// Where a record is, and what it is.
#[derive(Clone, Copy, Debug)]
struct Place {
    opcode: u8,
    /// Of its body.
    offset: u64,
    len: u64,
}

impl Place {
    /// Where the next record begins.
    fn end(&self) -> u64 {
        self.offset + self.len
    }
}

/// What is known of topics.
#[derive(Default)]
struct Channels {
    schemas: HashMap<u16, String>,
    channels: HashMap<u16, Channel>,
}

impl Channels {
    fn of_topic(&self, topic: &str) -> Vec<u16> {
        self.channels.values().filter(|c| c.topic == topic).map(|c| c.id).collect()
    }
}

/// Where the messages of a file are.
enum Layout {
    /// In chunks, which the index lists.
    Chunks(Vec<ChunkIndex>, Statistics),
    /// One by one.
    Single(Vec<Single>),
    /// Not known: nothing tells of them, or the file is cut off.
    Unindexed,
}

/// Where a message outside of a chunk is.
#[derive(Clone, Copy)]
struct Single {
    channel: u16,
    log_time: u64,
    data: Place,
}

/// A file with its name for messages.
struct McapSource {
    path: PathBuf,
    file: BufReader<File>,
    len: u64,
    /// Bytes that a message, or any record that is read, may have.
    most: usize,
}

impl McapSource {
    fn open(path: &Path, limits: &Limits) -> Result<Self, BagError> {
        let failed = |source| BagError::Io { path: path.to_owned(), source };
        let (file, metadata) = crate::file::open(path).map_err(|e| failed(e.into()))?;
        let most = usize::try_from(limits.message_bytes()).unwrap_or(usize::MAX);
        Ok(Self { path: path.to_owned(), file: BufReader::new(file), len: metadata.len(), most })
    }

    /// What went wrong, with the name of the file.
    fn error(&self, error: McapError) -> BagError {
        match error {
            McapError::BadMagic | McapError::BadFooter | McapError::UnexpectedEof => self.cut_off(),
            McapError::Io(source) => BagError::Io { path: self.path.clone(), source },
            other => self.broken(other.to_string()),
        }
    }

    fn cut_off(&self) -> BagError {
        BagError::CutOff { path: self.path.clone(), len: self.len }
    }

    fn broken(&self, why: String) -> BagError {
        BagError::Broken { path: self.path.clone(), why }
    }

    fn layout(&mut self) -> Result<(Channels, Layout), BagError> {
        match self.listed() {
            Err(BagError::CutOff { .. }) => Ok((Channels::default(), Layout::Unindexed)),
            layout => layout,
        }
    }

    /// The file from its start, for one that does not tell what is where.
    fn unindexed(&self) -> Result<Unindexed, BagError> {
        let failed = |source| BagError::Io { path: self.path.clone(), source };
        let (file, _) = crate::file::open(&self.path).map_err(|e| failed(e.into()))?;
        Ok(Unindexed::new(file, self.most))
    }

    fn unindexed_contents(&self) -> Result<Contents, BagError> {
        let Found { topics, span, ended } = self.unindexed()?.look_through();
        let note = match (ended, span) {
            (false, None) => return Err(self.cut_off()),
            (false, Some(_)) => format!(
                "truncated after {} bytes, or damaged: read up to there, in the order in which it was written ('mcap \
                 recover' repairs the file)",
                self.len
            ),
            (true, _) => "without an index: read in the order in which it was written".to_owned(),
        };
        Ok(Contents { topics, span, note: Some(note) })
    }

    /// What is in the file; nothing of a message but its place is read.
    fn listed(&mut self) -> Result<(Channels, Layout), BagError> {
        let footer = self.footer()?;
        let mut channels = Channels::default();
        let mut chunks = Vec::new();
        let mut statistics = None;
        let end = self.len - (RECORD_HEADER + FOOTER + MAGIC.len()) as u64;
        if footer.summary_start != 0 {
            let mut at = footer.summary_start;
            while at < end {
                let place = self.record(at, end)?;
                at = place.end();
                match self.index_record(place, &mut channels)? {
                    Some(Record::ChunkIndex(chunk)) => chunks.push(chunk),
                    Some(Record::Statistics(found)) => statistics = Some(found),
                    _ => {}
                }
            }
        }
        match statistics {
            Some(statistics) if !chunks.is_empty() => Ok((channels, Layout::Chunks(chunks, statistics))),
            _ => self.look_through(end),
        }
    }

    fn footer(&mut self) -> Result<Footer, BagError> {
        let mut bytes = [0; RECORD_HEADER + FOOTER + MAGIC.len()];
        let Some(start) = self.len.checked_sub((bytes.len() + MAGIC.len()) as u64) else { return Err(self.cut_off()) };
        self.read_at(start + MAGIC.len() as u64, &mut bytes)?;
        let (record, magic) = bytes.split_at(RECORD_HEADER + FOOTER);
        if magic != MAGIC {
            return Err(self.cut_off());
        }
        match mcap::parse_record(record[0], &record[RECORD_HEADER..]) {
            Ok(Record::Footer(footer)) => Ok(footer),
            _ => Err(self.cut_off()),
        }
    }

    /// Finds every message of a file without chunks, up to a place; where a chunk is met, no index tells of it.
    fn look_through(&mut self, end: u64) -> Result<(Channels, Layout), BagError> {
        let mut channels = Channels::default();
        let mut singles = Vec::new();
        let mut at = MAGIC.len() as u64;
        while at < end {
            let place = self.record(at, end)?;
            at = place.end();
            match place.opcode {
                op::DATA_END => break,
                op::CHUNK => return Ok((channels, Layout::Unindexed)),
                op::MESSAGE => singles.push(self.single(place)?),
                _ => drop(self.index_record(place, &mut channels)?),
            }
        }
        Ok((channels, Layout::Single(singles)))
    }

    /// Where the data of a message are.
    fn single(&mut self, Place { opcode, offset, len }: Place) -> Result<Single, BagError> {
        let mut header = [0; MESSAGE_HEADER];
        if len < header.len() as u64 {
            return Err(self.broken(format!("the message at {offset} has {len} bytes")));
        }
        self.read_at(offset, &mut header)?;
        match mcap::parse_record(opcode, &header) {
            Ok(Record::Message { header: MessageHeader { channel_id, log_time, .. }, .. }) => {
                let before = MESSAGE_HEADER as u64;
                let data = Place { opcode, offset: offset + before, len: len - before };
                Ok(Single { channel: channel_id, log_time, data })
            }
            Ok(_) => Err(self.broken(format!("the record at {offset} is not a message"))),
            Err(error) => Err(self.error(error)),
        }
    }

    /// Reads a record that describes others. What is known of topics is kept; others that are not needed are passed
    /// over.
    fn index_record(&mut self, place: Place, into: &mut Channels) -> Result<Option<Record<'static>>, BagError> {
        if !matches!(place.opcode, op::SCHEMA | op::CHANNEL | op::CHUNK_INDEX | op::STATISTICS) {
            return Ok(None);
        }
        let mut body = Vec::new();
        self.read(place, &mut body)?;
        if texts(place.opcode, &body).is_none() {
            return Err(self.broken(format!("the record at {} has a truncated string", place.offset)));
        }
        match mcap::parse_record(place.opcode, &body).map_err(|e| self.error(e))? {
            Record::Schema { header, .. } => drop(into.schemas.insert(header.id, header.name)),
            Record::Channel(channel) => drop(into.channels.insert(channel.id, channel)),
            Record::ChunkIndex(chunk) => return Ok(Some(Record::ChunkIndex(chunk))),
            Record::Statistics(statistics) => return Ok(Some(Record::Statistics(statistics))),
            _ => {}
        }
        Ok(None)
    }

    /// The record that begins there and must end before `end`.
    fn record(&mut self, at: u64, end: u64) -> Result<Place, BagError> {
        let mut header = [0; RECORD_HEADER];
        if end.saturating_sub(at) < header.len() as u64 {
            return Err(self.cut_off());
        }
        self.read_at(at, &mut header)?;
        let [opcode, l0, l1, l2, l3, l4, l5, l6, l7] = header;
        let len = u64::from_le_bytes([l0, l1, l2, l3, l4, l5, l6, l7]);
        let offset = at + header.len() as u64;
        if len > end - offset {
            return Err(self.broken(format!("the record at {at} claims {len} bytes, {} are there", end - offset)));
        }
        Ok(Place { opcode, offset, len })
    }

    /// Overwrites `into` by the body of a record.
    fn read(&mut self, Place { offset, len, .. }: Place, into: &mut Vec<u8>) -> Result<(), BagError> {
        let within = offset.checked_add(len).is_some_and(|end| end <= self.len);
        let len = usize::try_from(len).ok().filter(|&len| within && len <= self.most).ok_or_else(|| {
            let (file, most) = (self.len, self.most);
            self.broken(format!(
                "{len} bytes at {offset} cannot be read: the file has {file}, at most {most} are \
                 allowed"
            ))
        })?;
        into.clear();
        into.resize(len, 0);
        self.read_at(offset, into)
    }

    /// Fills the buffer from that place on.
    fn read_at(&mut self, offset: u64, buffer: &mut [u8]) -> Result<(), BagError> {
        let read = self.seek(offset).and_then(|()| self.file.read_exact(buffer));
        read.map_err(|source| BagError::Io { path: self.path.clone(), source })
    }

    /// What has been read ahead is kept where it can be.
    fn seek(&mut self, offset: u64) -> io::Result<()> {
        let here = self.file.stream_position()?;
        match i64::try_from(i128::from(offset) - i128::from(here)) {
            Ok(way) => self.file.seek_relative(way),
            Err(_) => self.file.seek(SeekFrom::Start(offset)).map(drop),
        }
    }
}

/// Passes over the texts and maps of a record, and gives `None` where one does not lie in it: the library makes room
/// for as many bytes as a text claims before it looks for them.
fn texts(opcode: u8, mut body: &[u8]) -> Option<()> {
    fn skip<'a>(rest: &mut &'a [u8], len: usize) -> Option<&'a [u8]> {
        let (skipped, after) = rest.split_at_checked(len)?;
        *rest = after;
        Some(skipped)
    }
    fn counted<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
        let len = skip(rest, size_of::<u32>())?.try_into().ok()?;
        skip(rest, u32::from_le_bytes(len) as usize)
    }
    let rest = &mut body;
    match opcode {
        op::SCHEMA => {
            skip(rest, 2)?;
            counted(rest)?;
            counted(rest)?;
        }
        op::CHANNEL => {
            skip(rest, 4)?;
            counted(rest)?;
            counted(rest)?;
            let mut pairs = counted(rest)?;
            while !pairs.is_empty() {
                counted(&mut pairs)?;
            }
        }
        op::CHUNK_INDEX => {
            skip(rest, 32)?;
            counted(rest)?;
            skip(rest, 8)?;
            counted(rest)?;
        }
        _ => {}
    }
    Some(())
}

/// What was recorded in the file.
pub fn contents(path: &Path, limits: &Limits) -> Result<Contents, BagError> {
    let mut source = McapSource::open(path, limits)?;
    let (channels, layout) = source.layout()?;
    let span = match &layout {
        Layout::Unindexed => return source.unindexed_contents(),
        Layout::Chunks(_, told) => (told.message_count > 0).then_some((told.message_start_time, told.message_end_time)),
        Layout::Single(messages) => {
            let times = messages.iter().map(|message| message.log_time);
            times.clone().min().zip(times.max())
        }
    };
    let counts: HashMap<u16, u64> = match layout {
        Layout::Unindexed => HashMap::new(),
        Layout::Chunks(_, statistics) => statistics.channel_message_counts.into_iter().collect(),
        Layout::Single(messages) => messages.iter().fold(HashMap::new(), |mut counts, message| {
            *counts.entry(message.channel).or_default() += 1;
            counts
        }),
    };
    let mut topics = Vec::new();
    for (id, channel) in &channels.channels {
        let topic = TopicInfo {
            name: channel.topic.clone(),
            kind: channels.schemas.get(&channel.schema_id).cloned().unwrap_or_default(),
            format: channel.message_encoding.clone(),
            count: counts.get(id).copied().unwrap_or(0),
        };
        super::topics::merge(&mut topics, vec![topic]);
    }
    Ok(Contents { topics, span, note: None })
}

/// The messages of a topic.
pub struct Reader {
    source: McapSource,
    order: Order,
}

enum Order {
    Chunks(Chunks),
    Single(std::vec::IntoIter<Single>),
    /// The topic is looked for.
    Unindexed(Box<Unindexed>, String),
}

impl Reader {
    /// Finds the messages, not yet reading them.
    pub fn open(path: &Path, topic: &str, limits: &Limits) -> Result<Self, BagError> {
        let mut source = McapSource::open(path, limits)?;
        let (channels, layout) = source.layout()?;
        let wanted = channels.of_topic(topic);
        let order = match layout {
            Layout::Chunks(chunks, _) => Order::Chunks(Chunks::new(chunks, wanted, &source)?),
            Layout::Single(mut messages) => {
                messages.retain(|message| wanted.contains(&message.channel));
                messages.sort_by_key(|message| message.log_time);
                Order::Single(messages.into_iter())
            }
            Layout::Unindexed => Order::Unindexed(Box::new(source.unindexed()?), topic.to_owned()),
        };
        Ok(Self { source, order })
    }
}

impl Messages for Reader {
    fn next_into(&mut self, message: &mut Recorded) -> Result<bool, BagError> {
        let Self { source, order } = self;
        match order {
            Order::Unindexed(file, topic) => Ok(file.next_into(Some(topic), message).is_some()),
            Order::Single(messages) => {
                let Some(single) = messages.next() else { return Ok(false) };
                message.log_time = single.log_time;
                source.read(single.data, &mut message.bytes)?;
                Ok(true)
            }
            Order::Chunks(chunks) => chunks.next_into(source, message),
        }
    }
}

#[cfg(test)]
mod tests;
