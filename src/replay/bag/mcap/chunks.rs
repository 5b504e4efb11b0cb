//! The messages in chunks, in order of time: a chunk is read when the next message may be in it.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use mcap::records::{ChunkIndex, Record, op};

use super::super::{BagError, InflateError, Recorded, inflate};
use super::{MESSAGE_HEADER, McapSource, Place, RECORD_HEADER};

/// Chunks whose times overlap are held at a time, as long as they take no more than so many of the largest messages.
const HELD: usize = 2;

/// Messages of those chunks that wait at a time, at most. One that holds an image is not so small that there could be
/// more.
const MOST_WAITING: usize = 1 << 20;

/// Why a chunk is not read.
#[derive(Debug, thiserror::Error)]
enum ChunkError {
    /// More bytes than may be.
    #[error("{len} bytes, at most {most} are allowed")]
    TooLarge { len: u64, most: usize },
    /// More bytes than may be, with those of the chunks that are open.
    #[error("its {len} bytes and {held} of those that overlap it in time are more than {HELD} x {most}")]
    Overlap { len: usize, held: usize, most: usize },
    /// Compressed in another way.
    #[error("compression '{0}' is not supported, only zstd and lz4 are")]
    Compression(String),
    #[error(transparent)]
    Inflate(#[from] InflateError),
    /// Not as long as it claims to be.
    #[error("{len} bytes, {claimed} were claimed")]
    Length { len: usize, claimed: usize },
    #[error("the record at {at} in it is truncated")]
    Record { at: usize },
    #[error("the message at {at} in it is truncated")]
    Message { at: usize },
    /// More messages wait than may.
    #[error("more than {MOST_WAITING} messages of the same time")]
    Crowded,
}

/// A message that waits for its turn: when it was recorded, where its chunk is in the file and it in the chunk, and
/// which of the open chunks that is.
type Waiting = (u64, u64, usize, usize);

/// An open chunk.
#[derive(Default)]
struct Open {
    bytes: Vec<u8>,
    /// Messages that wait.
    waiting: usize,
}

/// The messages of some channels.
pub struct Chunks {
    channels: Vec<u16>,
    /// Those that are not open yet, by the time of their first message.
    closed: std::vec::IntoIter<ChunkIndex>,
    open: Vec<Open>,
    waiting: BinaryHeap<Reverse<Waiting>>,
    /// A chunk as it is in the file.
    packed: Vec<u8>,
}

impl Chunks {
    /// Looks through the index of chunks, which must not overlap in the file: one that is listed twice would be read
    /// twice.
    pub(super) fn new(mut chunks: Vec<ChunkIndex>, channels: Vec<u16>, source: &McapSource) -> Result<Self, BagError> {
        chunks.sort_by_key(|chunk| chunk.chunk_start_offset);
        for pair in chunks.windows(2) {
            let [begin, next] = [pair[0].chunk_start_offset, pair[1].chunk_start_offset];
            if begin.checked_add(pair[0].chunk_length).is_none_or(|end| end > next) {
                let len = pair[0].chunk_length;
                return Err(source.broken(format!("the chunk at {begin} of {len} bytes overlaps the one at {next}")));
            }
        }
        // Where a file does not tell what is in a chunk, that is looked for in it.
        let holds = |chunk: &ChunkIndex| {
            let told = &chunk.message_index_offsets;
            told.is_empty() || channels.iter().any(|channel| told.contains_key(channel))
        };
        chunks.retain(|chunk| !channels.is_empty() && holds(chunk));
        chunks.sort_by_key(|chunk| (chunk.message_start_time, chunk.chunk_start_offset));
        Ok(Self {
            channels,
            closed: chunks.into_iter(),
            open: Vec::new(),
            waiting: BinaryHeap::new(),
            packed: Vec::new(),
        })
    }

    /// Overwrites `message` by the next; `false` after the last.
    pub(super) fn next_into(&mut self, source: &mut McapSource, message: &mut Recorded) -> Result<bool, BagError> {
        while let Some(chunk) = self.closed.as_slice().first()
            && self.waiting.peek().is_none_or(|Reverse((time, ..))| chunk.message_start_time < *time)
        {
            if let Some(chunk) = self.closed.next() {
                self.open(&chunk, source)?;
            }
        }
        let Some(Reverse((log_time, _, at, slot))) = self.waiting.pop() else { return Ok(false) };
        let open = &mut self.open[slot];
        message.log_time = log_time;
        message.bytes.clear();
        // All of it was there when it was found.
        message
            .bytes
            .extend_from_slice(body(&open.bytes, at).and_then(|b| b.get(MESSAGE_HEADER..)).unwrap_or_default());
        open.waiting -= 1;
        if open.waiting == 0 {
            *open = Open::default();
        }
        Ok(true)
    }

    /// Reads a chunk and finds the messages in it.
    fn open(&mut self, chunk: &ChunkIndex, source: &mut McapSource) -> Result<(), BagError> {
        let start = chunk.chunk_start_offset;
        let failed = |source: &McapSource, why: ChunkError| Err(source.broken(format!("the chunk at {start}: {why}")));
        let (len, most) = (chunk.uncompressed_size, source.most);
        let Some(len) = usize::try_from(len).ok().filter(|&len| len <= most) else {
            return failed(source, ChunkError::TooLarge { len, most });
        };
        let held: usize = self.open.iter().map(|open| open.bytes.len()).sum();
        if held + len > most.saturating_mul(HELD) {
            return failed(source, ChunkError::Overlap { len, held, most });
        }
        let offset = chunk.compressed_data_offset().map_err(|e| source.error(e))?;
        source.read(Place { opcode: op::CHUNK, offset, len: chunk.compressed_size }, &mut self.packed)?;
        let bytes = match chunk.compression.as_str() {
            "" => Ok(std::mem::take(&mut self.packed)),
            "zstd" => inflate::zstd(&self.packed, len).map_err(ChunkError::from),
            "lz4" => inflate::lz4(&self.packed, len).map_err(ChunkError::from),
            other => Err(ChunkError::Compression(other.to_owned())),
        };
        let bytes = match bytes {
            Ok(bytes) if bytes.len() == len => bytes,
            Ok(bytes) => return failed(source, ChunkError::Length { len: bytes.len(), claimed: len }),
            Err(why) => return failed(source, why),
        };
        let slot = self.open.iter().position(|open| open.waiting == 0).unwrap_or(self.open.len());
        let waiting = match self.find(&bytes, start, slot) {
            Ok(waiting) => waiting,
            Err(why) => return failed(source, why),
        };
        if slot == self.open.len() {
            self.open.push(Open::default());
        }
        if waiting > 0 {
            self.open[slot] = Open { bytes, waiting };
        }
        Ok(())
    }

    /// Adds the messages of a chunk to those that wait; says how many.
    fn find(&mut self, bytes: &[u8], start: u64, slot: usize) -> Result<usize, ChunkError> {
        let before = self.waiting.len();
        let mut at = 0;
        while at < bytes.len() {
            let Some(body) = body(bytes, at) else { return Err(ChunkError::Record { at }) };
            if bytes[at] == op::MESSAGE {
                let header = body.get(..MESSAGE_HEADER).ok_or(ChunkError::Message { at })?;
                if let Ok(Record::Message { header, .. }) = mcap::parse_record(op::MESSAGE, header)
                    && self.channels.contains(&header.channel_id)
                {
                    if self.waiting.len() == MOST_WAITING {
                        return Err(ChunkError::Crowded);
                    }
                    self.waiting.push(Reverse((header.log_time, start, at, slot)));
                }
            }
            at += RECORD_HEADER + body.len();
        }
        Ok(self.waiting.len() - before)
    }
}

/// The body of the record that begins at `at`, if all of it is there.
fn body(bytes: &[u8], at: usize) -> Option<&[u8]> {
    let (header, rest) = bytes.get(at..)?.split_first_chunk::<RECORD_HEADER>()?;
    let [_, l0, l1, l2, l3, l4, l5, l6, l7] = *header;
    let len = usize::try_from(u64::from_le_bytes([l0, l1, l2, l3, l4, l5, l6, l7])).ok()?;
    rest.get(..len)
}
