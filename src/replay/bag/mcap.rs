//! Bags in MCAP files. The index at the end of a file tells where the chunks are, and these are read in order of time;
//! a file that was written without chunks is looked through once instead.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub use mcap::MAGIC;
use mcap::read::ChannelAccumulator;
use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::sans_io::summary_reader::{SummaryReadEvent, SummaryReader, SummaryReaderOptions};
use mcap::sans_io::{IndexedReadEvent, IndexedReader, IndexedReaderOptions};
use mcap::{Channel, McapError, Summary};

use super::{BagError, Messages, Recorded, TopicInfo};

/// A chunk or a message that claims to have more bytes is taken for broken.
const MAX_RECORD: usize = 1 << 32;
/// Bytes before the body of a record: its kind and its length.
const RECORD_HEADER: u64 = 9;
/// Bytes before the data of a message: channel, sequence number, two times.
const MESSAGE_HEADER: u64 = 22;

type Channels = HashMap<u16, Arc<Channel<'static>>>;

/// Where the messages of a file are.
enum Layout {
    /// In chunks, which the summary lists.
    Chunks(Summary),
    /// One by one.
    Single(Channels, Vec<Place>),
}

/// Where a message outside of a chunk is.
#[derive(Clone, Copy)]
struct Place {
    channel: u16,
    log_time: u64,
    /// Of its data.
    offset: u64,
    len: usize,
}

/// A file with its name for messages.
struct Source {
    path: PathBuf,
    file: File,
    len: u64,
}

impl Source {
    fn open(path: &Path) -> Result<Self, BagError> {
        let failed = |source| BagError::Io { path: path.to_owned(), source };
        let file = File::open(path).map_err(failed)?;
        let len = file.metadata().map_err(failed)?.len();
        Ok(Self { path: path.to_owned(), file, len })
    }

    /// What went wrong, with the name of the file.
    fn error(&self, error: McapError) -> BagError {
        let path = self.path.clone();
        match error {
            McapError::BadMagic | McapError::BadFooter | McapError::UnexpectedEof => {
                BagError::CutOff { path, len: self.len }
            }
            McapError::Io(source) => BagError::Io { path, source },
            other => BagError::Broken { path, why: other.to_string() },
        }
    }

    fn layout(&mut self) -> Result<Layout, BagError> {
        let summary = self.summary().map_err(|e| self.error(e))?;
        match summary {
            Some(summary) if !summary.chunk_indexes.is_empty() && summary.stats.is_some() => {
                Ok(Layout::Chunks(summary))
            }
            _ => self.look_through(),
        }
    }

    /// The index at the end of the file, `None` where it was written without.
    fn summary(&mut self) -> Result<Option<Summary>, McapError> {
        let options = SummaryReaderOptions::default().with_file_size(self.len).with_record_length_limit(MAX_RECORD);
        let mut reader = SummaryReader::new_with_options(options);
        while let Some(event) = reader.next_event() {
            match event? {
                SummaryReadEvent::ReadRequest(n) => {
                    let read = self.file.read(reader.insert(n))?;
                    reader.notify_read(read);
                }
                SummaryReadEvent::SeekRequest(to) => reader.notify_seeked(self.file.seek(to)?),
            }
        }
        Ok(reader.finish())
    }

    /// Finds every message of a file without chunks.
    fn look_through(&mut self) -> Result<Layout, BagError> {
        let walked = self.walk().map_err(|e| self.error(e))?;
        walked.ok_or_else(|| BagError::Broken {
            path: self.path.clone(),
            why: "chunks and messages are not listed at the end of the file ('mcap recover' writes it anew)".to_owned(),
        })
    }

    /// `None` where a chunk was met.
    fn walk(&mut self) -> Result<Option<Layout>, McapError> {
        self.file.rewind()?;
        let mut file = BufReader::new(&self.file);
        let options = LinearReaderOptions::default().with_emit_chunks(true).with_record_length_limit(MAX_RECORD);
        let mut reader = LinearReader::new_with_options(options);
        let mut channels = ChannelAccumulator::default();
        let mut ids = Vec::new();
        let mut places = Vec::new();
        let mut offset = MAGIC.len() as u64;
        while let Some(event) = reader.next_event() {
            let (opcode, data) = match event? {
                LinearReadEvent::ReadRequest(n) => {
                    let read = file.read(reader.insert(n))?;
                    reader.notify_read(read);
                    continue;
                }
                LinearReadEvent::Record { opcode, data } => (opcode, data),
            };
            match opcode {
                op::CHUNK => return Ok(None),
                op::SCHEMA | op::CHANNEL | op::MESSAGE => match mcap::parse_record(opcode, data)? {
                    Record::Schema { header, data } => channels.add_schema(header, data.into_owned().into())?,
                    Record::Channel(channel) => {
                        ids.push(channel.id);
                        channels.add_channel(channel)?;
                    }
                    Record::Message { header, data } => places.push(Place {
                        channel: header.channel_id,
                        log_time: header.log_time,
                        offset: offset + RECORD_HEADER + MESSAGE_HEADER,
                        len: data.len(),
                    }),
                    _ => {}
                },
                _ => {}
            }
            offset += RECORD_HEADER + data.len() as u64;
        }
        let channels = ids.into_iter().filter_map(|id| Some((id, channels.get(id)?))).collect();
        Ok(Some(Layout::Single(channels, places)))
    }

    /// Fills the buffer from that place on.
    fn read_at(&mut self, offset: u64, buffer: &mut [u8]) -> Result<(), BagError> {
        let read = self.file.seek(SeekFrom::Start(offset)).and_then(|_| self.file.read_exact(buffer));
        read.map_err(|source| BagError::Io { path: self.path.clone(), source })
    }

    /// A buffer for so many bytes from that place on, which must be in the file.
    fn within(&self, offset: u64, len: usize) -> Result<(), BagError> {
        let end = offset.checked_add(len as u64);
        if end.is_some_and(|end| end <= self.len) {
            return Ok(());
        }
        let why = format!("{len} bytes at {offset} are not in the file of {} bytes", self.len);
        Err(BagError::Broken { path: self.path.clone(), why })
    }
}

/// What was recorded in the file.
pub fn topics(path: &Path) -> Result<Vec<TopicInfo>, BagError> {
    let layout = Source::open(path)?.layout()?;
    let counts: HashMap<u16, u64> = match &layout {
        Layout::Chunks(summary) => {
            let counted = summary.stats.iter().flat_map(|s| &s.channel_message_counts);
            counted.map(|(id, count)| (*id, *count)).collect()
        }
        Layout::Single(_, places) => places.iter().fold(HashMap::new(), |mut counts, place| {
            *counts.entry(place.channel).or_default() += 1;
            counts
        }),
    };
    let channels = match &layout {
        Layout::Chunks(summary) => &summary.channels,
        Layout::Single(channels, _) => channels,
    };
    let mut topics = Vec::new();
    for (id, channel) in channels {
        let topic = TopicInfo {
            name: channel.topic.clone(),
            kind: channel.schema.as_ref().map_or_else(String::new, |s| s.name.clone()),
            format: channel.message_encoding.clone(),
            count: counts.get(id).copied().unwrap_or(0),
        };
        super::topics::merge(&mut topics, vec![topic]);
    }
    Ok(topics)
}

/// The messages of a topic.
pub struct Reader {
    source: Source,
    order: Order,
    /// A chunk as it is in the file.
    chunk: Vec<u8>,
}

enum Order {
    Chunks(Box<IndexedReader>),
    Single(std::vec::IntoIter<Place>),
}

impl Reader {
    /// Finds the messages, not yet reading them.
    pub fn open(path: &Path, topic: &str) -> Result<Self, BagError> {
        let mut source = Source::open(path)?;
        let order = match source.layout()? {
            Layout::Chunks(summary) => {
                let options = IndexedReaderOptions::new().include_topics([topic]).with_record_length_limit(MAX_RECORD);
                // A file of the bag in which nothing was recorded of the topic: no topics at all would mean every one.
                if !summary.channels.values().any(|c| c.topic == topic) {
                    Order::Single(Vec::new().into_iter())
                } else {
                    let reader = IndexedReader::new_with_options(&summary, options).map_err(|e| source.error(e))?;
                    Order::Chunks(Box::new(reader))
                }
            }
            Layout::Single(channels, mut places) => {
                places.retain(|place| channels.get(&place.channel).is_some_and(|c| c.topic == topic));
                places.sort_by_key(|place| place.log_time);
                Order::Single(places.into_iter())
            }
        };
        Ok(Self { source, order, chunk: Vec::new() })
    }
}

impl Messages for Reader {
    fn next_into(&mut self, message: &mut Recorded) -> Result<bool, BagError> {
        let Self { source, order, chunk } = self;
        match order {
            Order::Single(places) => {
                let Some(place) = places.next() else { return Ok(false) };
                message.log_time = place.log_time;
                message.bytes.resize(place.len, 0);
                source.read_at(place.offset, &mut message.bytes)?;
                Ok(true)
            }
            Order::Chunks(reader) => {
                while let Some(event) = reader.next_event() {
                    match event.map_err(|e| source.error(e))? {
                        IndexedReadEvent::ReadChunkRequest { offset, length } => {
                            source.within(offset, length)?;
                            chunk.resize(length, 0);
                            source.read_at(offset, chunk)?;
                            reader.insert_chunk_record_data(offset, chunk).map_err(|e| source.error(e))?;
                        }
                        IndexedReadEvent::Message { header, data } => {
                            message.log_time = header.log_time;
                            message.bytes.clear();
                            message.bytes.extend_from_slice(data);
                            return Ok(true);
                        }
                    }
                }
                Ok(false)
            }
        }
    }
}

#[cfg(test)]
mod tests;
