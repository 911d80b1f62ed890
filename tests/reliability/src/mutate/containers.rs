//! Changes within containers, whose lengths and checksums are made to fit again.

use super::{Dice, bytes, json, text};

/// A PLY file: its header, or what follows.
pub(super) fn header_and_bytes(original: &[u8], dice: &mut Dice) -> Vec<u8> {
    const END: &[u8] = b"end_header\n";
    let end = original.windows(END.len()).position(|window| window == END);
    let (header, body) = original.split_at(end.map_or(original.len(), |end| end + END.len()));
    let is_text = body.iter().all(|byte| byte.is_ascii());
    match dice.below(2) {
        0 => [text::mutated(header, dice), body.to_vec()].concat(),
        _ if is_text => [header.to_vec(), text::mutated(body, dice)].concat(),
        _ => [header.to_vec(), bytes::mutated(body, dice)].concat(),
    }
}

/// A chunk of a PNG file.
pub(super) fn png(original: &[u8], dice: &mut Dice) -> Vec<u8> {
    let Some((signature, mut rest)) = original.split_at_checked(8) else { return Vec::new() };
    let mut chunks: Vec<Vec<u8>> = Vec::new();
    while let Some((length, _)) = rest.split_first_chunk::<4>() {
        let length = (u32::from_be_bytes(*length) as usize).min(rest.len()) + 12;
        let (chunk, after) = rest.split_at(length.min(rest.len()));
        // Kind and content.
        chunks.push(chunk.get(4..chunk.len().saturating_sub(4)).unwrap_or_default().to_vec());
        rest = after;
    }
    if chunks.is_empty() {
        return original.to_vec();
    }
    let at = dice.below(chunks.len());
    match dice.below(6) {
        0 => drop(chunks.remove(at)),
        1 => chunks.push(chunks[at].clone()),
        2 => chunks.swap(at, 0),
        _ => {
            let kind = chunks[at].get(..4).unwrap_or_default().to_vec();
            let content = chunks[at].get(4..).unwrap_or_default();
            chunks[at] = [kind, bytes::mutated(content, dice)].concat();
        }
    }
    let mut changed = signature.to_vec();
    for chunk in chunks {
        changed.extend((chunk.len().saturating_sub(4) as u32).to_be_bytes());
        changed.extend(&chunk);
        changed.extend(crc32(&chunk).to_be_bytes());
    }
    changed
}

/// The checksum of PNG.
fn crc32(bytes: &[u8]) -> u32 {
    let step = |sum: u32, _| if sum & 1 == 1 { (sum >> 1) ^ 0xedb8_8320 } else { sum >> 1 };
    !bytes.iter().fold(!0, |sum, byte| (0..8).fold(sum ^ u32::from(*byte), step))
}

/// Anything but the hash at the end of a distance grid.
pub(super) fn grid(original: &[u8], dice: &mut Dice) -> Vec<u8> {
    let length = original.len().saturating_sub(8);
    let mut changed = bytes::mutated(&original[..length], dice);
    let hash = grid_hash(changed.get(8..).unwrap_or_default());
    changed.extend(hash.to_le_bytes());
    changed
}

/// The hash of distance grids.
fn grid_hash(bytes: &[u8]) -> u64 {
    let step = |hash: u64, word: &[u8]| {
        let word = word.iter().rev().fold(0, |word, byte| (word << 8) | u64::from(*byte));
        let mixed = (hash ^ word).wrapping_mul(0x0100_0000_01b3);
        mixed ^ (mixed >> 32)
    };
    bytes.chunks(8).fold(0xcbf2_9ce4_8422_2325, step)
}

/// The JSON or the bytes of a GLB file.
pub(super) fn glb(original: &[u8], dice: &mut Dice) -> Vec<u8> {
    let number = |at: usize| {
        let bytes = original.get(at..at + 4)?.try_into().ok()?;
        Some(u32::from_le_bytes(bytes) as usize)
    };
    let Some(document) = number(12).and_then(|length| original.get(20..20 + length)) else {
        return bytes::mutated(original, dice);
    };
    let rest = original.get(20 + document.len()..).unwrap_or_default();
    let (mut document, mut rest) = (document.to_vec(), rest.to_vec());
    if dice.one_in(4) {
        rest = bytes::mutated(&rest, dice);
    } else {
        document = json::mutated(&document, dice);
        document.resize(document.len().next_multiple_of(4), b' ');
    }
    let mut changed = original[..12].to_vec();
    changed[8..12].copy_from_slice(&((20 + document.len() + rest.len()) as u32).to_le_bytes());
    changed.extend((document.len() as u32).to_le_bytes());
    changed.extend(b"JSON");
    changed.extend(document);
    changed.extend(rest);
    changed
}

/// A record of an MCAP file.
pub(super) fn mcap(original: &[u8], dice: &mut Dice) -> Vec<u8> {
    let Some((magic, mut rest)) = original.split_at_checked(8) else { return Vec::new() };
    let mut records: Vec<Vec<u8>> = Vec::new();
    while let Some((length, _)) = rest.get(1..).and_then(|r| r.split_first_chunk::<8>()) {
        let length = usize::try_from(u64::from_le_bytes(*length)).unwrap_or(rest.len());
        let end = length.saturating_add(9).min(rest.len());
        let (record, after) = rest.split_at(end);
        records.push([&record[..1], &record[9..]].concat());
        rest = after;
    }
    if records.is_empty() {
        return bytes::mutated(original, dice);
    }
    let at = dice.below(records.len());
    match dice.below(6) {
        0 => drop(records.remove(at)),
        1 => records.insert(0, records[at].clone()),
        2 => records.swap(at, 0),
        _ => {
            let content = bytes::mutated(&records[at][1..], dice);
            records[at].truncate(1);
            records[at].extend(content);
        }
    }
    let mut changed = magic.to_vec();
    for record in records {
        changed.push(record[0]);
        changed.extend((record.len() as u64 - 1).to_le_bytes());
        changed.extend(&record[1..]);
    }
    changed.extend(rest);
    changed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_that_of_png() {
        assert_eq!(crc32(b"123456789"), 0xcbf4_3926);
        assert_eq!(crc32(b"IEND"), 0xae42_6082);
    }

    #[test]
    fn the_hash_is_that_of_grids() {
        let (content, hash) = include_bytes!("../../corpus/grid/box").split_last_chunk().unwrap();
        assert_eq!(grid_hash(&content[8..]).to_le_bytes(), *hash);
    }
}
