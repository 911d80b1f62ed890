//! The messages of a log, one after the other.

use std::borrow::Cow;
use std::io::{Cursor, Read};

use mcap::read::ChannelAccumulator;
use mcap::records::{Record, op};
use mcap::{McapError, McapResult, Message, parse_record};

use super::lengths;
use super::records::RecordReader;

/// Messages in the order of the file; nothing after the first error. What else there is, attachments and indices, is not looked at.
pub(super) struct MessageReader<R> {
    file: RecordReader<R>,
    /// The chunk that is being read.
    chunk: Option<RecordReader<Cursor<Vec<u8>>>>,
    channels: ChannelAccumulator<'static>,
    done: bool,
}

/// What is in a file.
enum Part {
    Message(Message<'static>),
    Chunk(Vec<u8>),
}

impl<R: Read> MessageReader<R> {
    pub(super) fn new(source: R) -> Self {
        let file = RecordReader::of_file(source);
        Self { file, chunk: None, channels: ChannelAccumulator::default(), done: false }
    }

    fn read(&mut self) -> Option<McapResult<Message<'static>>> {
        let channels = &mut self.channels;
        loop {
            if let Some(chunk) = &mut self.chunk {
                let found = chunk.find_map(|opcode, record| message(channels, opcode, record));
                if found.is_some() {
                    return found;
                }
                self.chunk = None;
            }
            let part = |opcode, record: &[u8]| match opcode {
                op::CHUNK => chunk(record).map(|chunk| Some(Part::Chunk(chunk))),
                _ => Ok(message(channels, opcode, record)?.map(Part::Message)),
            };
            match self.file.find_map(part)? {
                Ok(Part::Message(message)) => return Some(Ok(message)),
                Ok(Part::Chunk(chunk)) => {
                    self.chunk = Some(RecordReader::of_chunk(Cursor::new(chunk)))
                }
                Err(error) => return Some(Err(error)),
            }
        }
    }
}

impl<R: Read> Iterator for MessageReader<R> {
    type Item = McapResult<Message<'static>>;

    fn next(&mut self) -> Option<Self::Item> {
        let next = if self.done { None } else { self.read() };
        self.done = !matches!(next, Some(Ok(_)));
        next
    }
}

/// A chunk's record with its kind and length before it.
fn chunk(record: &[u8]) -> McapResult<Vec<u8>> {
    match lengths::fit(op::CHUNK, record) {
        true => Ok([&[op::CHUNK], &(record.len() as u64).to_le_bytes()[..], record].concat()),
        false => Err(McapError::UnexpectedEoc),
    }
}

/// The message that a record is, if it is one; `channels` learn of schemas and channels.
fn message(
    channels: &mut ChannelAccumulator<'static>,
    opcode: u8,
    record: &[u8],
) -> McapResult<Option<Message<'static>>> {
    if !matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE) {
        return Ok(None);
    }
    if !lengths::fit(opcode, record) {
        return Err(McapError::UnexpectedEof);
    }
    match parse_record(opcode, record)? {
        Record::Schema { header, data } => channels.add_schema_from_slice(header, &data)?,
        Record::Channel(channel) => channels.add_channel(channel)?,
        Record::Message { header, data } => {
            let unknown = McapError::UnknownChannel(header.sequence, header.channel_id);
            return Ok(Some(Message {
                channel: channels.get(header.channel_id).ok_or(unknown)?,
                sequence: header.sequence,
                log_time: header.log_time,
                publish_time: header.publish_time,
                data: Cow::Owned(data.into_owned()),
            }));
        }
        _ => {}
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use mcap::{Compression, WriteOptions};

    use super::*;

    /// Two messages in a chunk.
    fn log(compression: Option<Compression>) -> Vec<u8> {
        let mut file = Cursor::new(Vec::new());
        let options = WriteOptions::new().compression(compression);
        let mut writer = options.create(&mut file).unwrap();
        let channel = writer.add_channel(0, "/topic", "cdr", &BTreeMap::new()).unwrap();
        for sequence in 0..2 {
            let header = mcap::records::MessageHeader {
                channel_id: channel,
                sequence,
                log_time: 7,
                publish_time: 7,
            };
            writer.write_to_known_channel(&header, &[11; 60]).unwrap();
        }
        writer.finish().unwrap();
        drop(writer);
        file.into_inner()
    }

    #[test]
    fn messages_of_chunks_are_read() {
        for compression in [None, Some(Compression::Lz4), Some(Compression::Zstd)] {
            let log = log(compression);
            let messages: McapResult<Vec<_>> = MessageReader::new(&log[..]).collect();
            let messages = messages.unwrap();
            assert_eq!(messages.iter().map(|m| m.sequence).collect::<Vec<_>>(), [0, 1]);
            assert!(messages.iter().all(|m| *m.data == [11; 60] && m.channel.topic == "/topic"));
            // One bit of the messages is wrong, or the file ends within them.
            let at = { log.windows(8) }.position(|bytes| bytes == [11; 8]).unwrap_or(90);
            let mut broken = log.clone();
            broken[at] ^= 1;
            assert!(MessageReader::new(&broken[..]).any(|message| message.is_err()));
            assert!(MessageReader::new(&log[..at]).any(|message| message.is_err()));
        }
    }

    #[test]
    fn a_record_longer_than_its_chunk_is_refused() {
        let mut log = log(None);
        let length = (22_u64 + 60).to_le_bytes();
        let message = [&[op::MESSAGE], &length[..]].concat();
        let at = log.windows(9).rposition(|bytes| bytes == message).unwrap();
        log[at + 2] = 1;
        let read: Vec<_> = MessageReader::new(&log[..]).collect();
        assert!(matches!(read[..], [Err(McapError::UnexpectedEoc)]), "{read:?}");
    }
}
