//! The messages of a log, one after the other.

use std::borrow::Cow;
use std::io::{Cursor, ErrorKind, Read};
use std::iter;

use mcap::read::ChannelAccumulator;
use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{McapError, McapResult, Message, parse_record};

use super::lengths;

/// The longest record, compressed or not \[bytes\]: a broken length must not take all memory.
const LONGEST: usize = 1 << 29;

/// Length of what is read at once \[bytes\], for the same reason.
const BLOCK: usize = 1 << 20;

/// Messages in the order of the file; nothing after the first error. What else there is, attachments and indices, is not looked at.
pub(super) struct MessageReader<'a> {
    /// Records of the file, and of the chunk of it that is being read.
    open: Vec<Records<'a>>,
    channels: ChannelAccumulator<'static>,
}

/// Kind and content of records, in their order.
type Records<'a> = Box<dyn Iterator<Item = McapResult<(u8, Vec<u8>)>> + Send + 'a>;

impl<'a> MessageReader<'a> {
    pub(super) fn new(source: impl Read + Send + 'a) -> Self {
        let options = LinearReaderOptions::default().with_emit_chunks(true);
        Self { open: vec![records(source, options)], channels: ChannelAccumulator::default() }
    }

    fn read(&mut self) -> McapResult<Option<Message<'static>>> {
        while let Some(source) = self.open.last_mut() {
            let Some((opcode, record)) = source.next().transpose()? else {
                self.open.pop();
                continue;
            };
            if !lengths::fit(opcode, &record) {
                return Err(McapError::UnexpectedEof);
            }
            if opcode == op::CHUNK {
                // With its kind and length before it, as in a file.
                let length = (record.len() as u64).to_le_bytes();
                let chunk = Cursor::new([&[op::CHUNK], &length[..], record.as_slice()].concat());
                let options = LinearReaderOptions::default()
                    .with_skip_start_magic(true)
                    .with_skip_end_magic(true)
                    .with_validate_chunk_crcs(true);
                self.open.push(records(chunk, options));
            } else if matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE) {
                let message = message(&mut self.channels, parse_record(opcode, &record)?)?;
                if message.is_some() {
                    return Ok(message);
                }
            }
        }
        Ok(None)
    }
}

impl Iterator for MessageReader<'_> {
    type Item = McapResult<Message<'static>>;

    fn next(&mut self) -> Option<Self::Item> {
        let next = self.read().transpose();
        if matches!(next, Some(Err(_))) {
            self.open.clear();
        }
        next
    }
}

fn records<'a>(mut source: impl Read + Send + 'a, options: LinearReaderOptions) -> Records<'a> {
    let options = options.with_record_length_limit(LONGEST);
    let mut reader = LinearReader::new_with_options(options);
    Box::new(iter::from_fn(move || {
        loop {
            match reader.next_event()? {
                Ok(LinearReadEvent::ReadRequest(count)) => {
                    match source.read(reader.insert(count.min(BLOCK))) {
                        Ok(read) => reader.notify_read(read),
                        Err(error) if error.kind() == ErrorKind::Interrupted => {}
                        Err(error) => return Some(Err(error.into())),
                    }
                }
                Ok(LinearReadEvent::Record { opcode, data }) => {
                    return Some(Ok((opcode, data.to_vec())));
                }
                Err(error) => return Some(Err(error)),
            }
        }
    }))
}

/// The message that a record is, if it is one; `channels` learn of schemas and channels.
fn message(
    channels: &mut ChannelAccumulator<'static>,
    record: Record<'_>,
) -> McapResult<Option<Message<'static>>> {
    match record {
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
        assert!(matches!(read[..], [Err(McapError::UnexpectedEof)]), "{read:?}");
    }
}
