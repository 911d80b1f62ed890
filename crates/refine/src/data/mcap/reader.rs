//! The messages of a log, one after the other.

use std::borrow::Cow;
use std::io::{ErrorKind, Read};

use mcap::read::ChannelAccumulator;
use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{McapError, McapResult, Message, parse_record};

/// The longest record, compressed or not \[bytes\]: a broken length must not take all memory.
const LONGEST: usize = 1 << 29;

/// Messages in the order of the file; nothing after the first error. What else there is, attachments and indices, is not looked at.
pub(super) struct MessageReader<R> {
    source: R,
    reader: LinearReader,
    channels: ChannelAccumulator<'static>,
    done: bool,
}

impl<R: Read> MessageReader<R> {
    pub(super) fn new(source: R) -> Self {
        let options = LinearReaderOptions::default()
            .with_record_length_limit(LONGEST)
            .with_validate_chunk_crcs(true);
        let reader = LinearReader::new_with_options(options);
        Self { source, reader, channels: ChannelAccumulator::default(), done: false }
    }

    fn read(&mut self) -> Option<McapResult<Message<'static>>> {
        loop {
            match self.reader.next_event()? {
                Ok(LinearReadEvent::ReadRequest(count)) => {
                    match self.source.read(self.reader.insert(count)) {
                        Ok(read) => self.reader.notify_read(read),
                        Err(error) if error.kind() == ErrorKind::Interrupted => {}
                        Err(error) => return Some(Err(error.into())),
                    }
                }
                Ok(LinearReadEvent::Record { opcode, data }) => {
                    match message(&mut self.channels, opcode, data) {
                        Ok(None) => {}
                        Ok(Some(message)) => return Some(Ok(message)),
                        Err(error) => return Some(Err(error)),
                    }
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

/// The message that a record is, if it is one; `channels` learn of schemas and channels.
fn message(
    channels: &mut ChannelAccumulator<'static>,
    opcode: u8,
    record: &[u8],
) -> McapResult<Option<Message<'static>>> {
    if !matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE) {
        return Ok(None);
    }
    // The package would make room for a text before it sees that the record ends first.
    if !texts_fit(opcode, record) {
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

/// Whether the texts of a schema or a channel end within its record.
fn texts_fit(opcode: u8, record: &[u8]) -> bool {
    let fit = || -> Option<()> {
        // Of a schema its number, a name and an encoding; of a channel two numbers, a topic, an encoding and pairs of texts.
        let mut rest = match opcode {
            op::SCHEMA => record.get(2..)?,
            op::CHANNEL => record.get(4..)?,
            _ => return Some(()),
        };
        rest = counted(counted(rest)?.1)?.1;
        if opcode == op::CHANNEL {
            let mut pairs = counted(rest)?.0;
            while !pairs.is_empty() {
                pairs = counted(pairs)?.1;
            }
        }
        Some(())
    };
    fit().is_some()
}

/// Bytes after a number of four bytes that says how many they are, and what follows.
fn counted(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (count, rest) = bytes.split_first_chunk::<4>()?;
    rest.split_at_checked(u32::from_le_bytes(*count) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(text: &str) -> Vec<u8> {
        [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
    }

    #[test]
    fn texts_longer_than_their_record_are_refused() {
        let pairs = [text("key"), text("value")].concat();
        let count = (pairs.len() as u32).to_le_bytes().to_vec();
        let schema = [vec![1, 0], text("pkg/msg/Type"), text("ros2msg"), text("")].concat();
        let channel = [vec![1, 0, 1, 0], text("/topic"), text("cdr"), count, pairs].concat();
        // Where the numbers of bytes are.
        for (opcode, record, places) in
            [(op::SCHEMA, schema, vec![2, 18]), (op::CHANNEL, channel, vec![4, 14, 21, 25, 32])]
        {
            assert!(texts_fit(opcode, &record) && parse_record(opcode, &record).is_ok());
            for place in places {
                let mut broken = record.clone();
                broken[place..place + 4].copy_from_slice(&0xeb00_0000_u32.to_le_bytes());
                let found = message(&mut ChannelAccumulator::default(), opcode, &broken);
                assert!(matches!(found, Err(McapError::UnexpectedEof)), "{opcode} at {place}");
            }
            assert!(!texts_fit(opcode, &record[..3]));
        }
    }
}
