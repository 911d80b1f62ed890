//! Lengths within a record of a log.

use mcap::records::op;

/// Whether all that `record` says the length of ends within it, in schemas, channels and chunks that are not compressed. The package
/// makes room for a text before it sees that the record ends first, and overflows where a record of a chunk ends after the chunk.
pub(super) fn fit(opcode: u8, record: &[u8]) -> bool {
    match opcode {
        op::SCHEMA => schema(record),
        op::CHANNEL => channel(record),
        op::CHUNK => chunk(record),
        _ => Some(()),
    }
    .is_some()
}

/// A number, a name and an encoding.
fn schema(record: &[u8]) -> Option<()> {
    let (_, rest) = text(record.get(2..)?)?;
    text(rest).map(drop)
}

/// Two numbers, a topic, an encoding and pairs of texts.
fn channel(record: &[u8]) -> Option<()> {
    let (_, rest) = text(record.get(4..)?)?;
    let (_, rest) = text(rest)?;
    let (mut pairs, _) = text(rest)?;
    while !pairs.is_empty() {
        (_, pairs) = text(pairs)?;
    }
    Some(())
}

/// Two times, a size and a checksum, the kind of compression, and records.
fn chunk(record: &[u8]) -> Option<()> {
    let (compression, rest) = text(record.get(28..)?)?;
    let (mut records, _) = counted(rest)?;
    // The package looks at what comes of compressed ones.
    while compression.is_empty() && !records.is_empty() {
        (_, records) = counted(records.get(1..)?)?;
    }
    Some(())
}

/// Bytes after a number of four bytes that says how many they are, and what follows.
fn text(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (count, rest) = bytes.split_first_chunk()?;
    rest.split_at_checked(u32::from_le_bytes(*count) as usize)
}

/// Bytes with a length prefix of eight bytes, and the rest.
fn counted(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (count, rest) = bytes.split_first_chunk()?;
    rest.split_at_checked(usize::try_from(u64::from_le_bytes(*count)).ok()?)
}

#[cfg(test)]
mod tests {
    use mcap::parse_record;

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
        let message = [vec![op::MESSAGE], 22_u64.to_le_bytes().to_vec(), vec![0; 22]].concat();
        let size = (message.len() as u64).to_le_bytes().to_vec();
        let chunk = [vec![0; 28], text(""), size, message].concat();
        // Where the numbers of bytes are.
        for (opcode, record, places) in [
            (op::SCHEMA, schema, vec![2, 18]),
            (op::CHANNEL, channel, vec![4, 14, 21, 25, 32]),
            (op::CHUNK, chunk, vec![28, 32, 41]),
        ] {
            assert!(fit(opcode, &record) && parse_record(opcode, &record).is_ok());
            for place in places {
                let mut broken = record.clone();
                broken[place..place + 4].copy_from_slice(&0xeb00_0000_u32.to_le_bytes());
                assert!(!fit(opcode, &broken), "{opcode} at {place}");
            }
            assert!(!fit(opcode, &record[..3]));
        }
    }
}
