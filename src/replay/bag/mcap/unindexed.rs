//! Files without an index of what is in them, for the recorder was ended before it wrote one, or left it out: messages
//! in the order in which they were written, as far as the file goes.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufReader, Read};

use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::super::{Recorded, TopicInfo, topics};

/// Bytes that are read at a time, whatever length a record claims.
const STEP: usize = 1 << 20;

/// Such a file, from its start.
pub struct Unindexed {
    reader: LinearReader,
    file: BufReader<File>,
    /// Names of types.
    schemas: HashMap<u16, String>,
    channels: HashMap<u16, mcap::records::Channel>,
    /// Whether the end of the messages was met, and not that of the file or something that makes no sense.
    ended: bool,
}

/// What a look through the file has found.
pub struct Found {
    pub topics: Vec<TopicInfo>,
    /// The times of the first and the last message.
    pub span: Option<(u64, u64)>,
    pub ended: bool,
}

impl Unindexed {
    /// Of records that are longer than `most` nothing is read, nor of what follows them.
    pub fn new(file: File, most: usize) -> Self {
        let options = LinearReaderOptions::default().with_skip_end_magic(true).with_record_length_limit(most);
        Self {
            reader: LinearReader::new_with_options(options),
            file: BufReader::new(file),
            schemas: HashMap::new(),
            channels: HashMap::new(),
            ended: false,
        }
    }

    /// Overwrites `message` by the next, of that topic or of any; gives its channel, `None` after the last.
    pub fn next_into(&mut self, topic: Option<&str>, message: &mut Recorded) -> Option<u16> {
        loop {
            // What cannot be understood ends the file as well as its end.
            let (opcode, data) = match self.reader.next_event()?.ok()? {
                LinearReadEvent::ReadRequest(n) => {
                    let read = self.file.read(self.reader.insert(n.min(STEP))).ok()?;
                    self.reader.notify_read(read);
                    continue;
                }
                LinearReadEvent::Record { opcode, data } => (opcode, data),
            };
            match opcode {
                op::DATA_END => {
                    self.ended = true;
                    return None;
                }
                op::SCHEMA | op::CHANNEL | op::MESSAGE => {
                    match super::texts(opcode, data).and_then(|()| mcap::parse_record(opcode, data).ok())? {
                        Record::Schema { header, .. } => drop(self.schemas.insert(header.id, header.name)),
                        Record::Channel(channel) => drop(self.channels.insert(channel.id, channel)),
                        Record::Message { header, data } => {
                            let channel = self.channels.get(&header.channel_id);
                            if channel.is_some_and(|channel| topic.is_none_or(|topic| channel.topic == topic)) {
                                message.log_time = header.log_time;
                                message.bytes.clear();
                                message.bytes.extend_from_slice(&data);
                                return Some(header.channel_id);
                            }
                        }
                        _ => {}
                    }
                }
                _ => {}
            }
        }
    }

    /// Looks through the file.
    pub fn look_through(mut self) -> Found {
        let mut counts: HashMap<u16, u64> = HashMap::new();
        let mut span: Option<(u64, u64)> = None;
        let mut message = Recorded::default();
        while let Some(channel) = self.next_into(None, &mut message) {
            *counts.entry(channel).or_default() += 1;
            let time = message.log_time;
            span = Some(span.map_or((time, time), |(first, last)| (first.min(time), last.max(time))));
        }
        let mut all = Vec::new();
        for (id, channel) in self.channels {
            let topic = TopicInfo {
                name: channel.topic,
                kind: self.schemas.get(&channel.schema_id).cloned().unwrap_or_default(),
                format: channel.message_encoding,
                count: counts.get(&id).copied().unwrap_or(0),
            };
            topics::merge(&mut all, vec![topic]);
        }
        Found { topics: all, span, ended: self.ended }
    }
}
