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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_is_that_of_grids() {
        let (content, hash) = include_bytes!("../../corpus/grid/box").split_last_chunk().unwrap();
        assert_eq!(grid_hash(&content[8..]).to_le_bytes(), *hash);
    }
}
