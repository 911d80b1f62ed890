//! Changes of files that are lists of parts, whose lengths, counts and checksums are made to fit again.

use super::{Dice, bytes, text};

/// Changes one of `parts`, of which the first `kept` bytes say its kind, or their order.
fn change(parts: &mut Vec<Vec<u8>>, kept: usize, dice: &mut Dice) {
    let at = dice.below(parts.len());
    match dice.below(6) {
        0 => drop(parts.remove(at)),
        1 => parts.insert(dice.below(parts.len()), parts[at].clone()),
        2 => parts.swap(at, 0),
        _ => {
            let (kind, content) = parts[at].split_at(kept.min(parts[at].len()));
            parts[at] = [kind, &bytes::mutated(content, dice)].concat();
        }
    }
}

/// A chunk of a PNG file.
pub(super) fn png(original: &[u8], dice: &mut Dice) -> Vec<u8> {
    let Some((signature, mut rest)) = original.split_at_checked(8) else { return Vec::new() };
    // Kind and content.
    let mut chunks = Vec::new();
    while let Some((length, _)) = rest.split_first_chunk::<4>() {
        let length = (u32::from_be_bytes(*length) as usize).min(rest.len()) + 12;
        let (chunk, after) = rest.split_at(length.min(rest.len()));
        chunks.push(chunk.get(4..chunk.len().saturating_sub(4)).unwrap_or_default().to_vec());
        rest = after;
    }
    if chunks.is_empty() {
        return original.to_vec();
    }
    change(&mut chunks, 4, dice);
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

/// A segment of a JPEG file, or the bytes of the picture.
pub(super) fn jpeg(original: &[u8], dice: &mut Dice) -> Vec<u8> {
    /// Begins the segment before the picture.
    const SCAN: u8 = 0xda;
    let Some((start, mut rest)) = original.split_at_checked(2) else { return Vec::new() };
    // Kind and content.
    let mut segments = Vec::new();
    while let [0xff, kind, high, low, after @ ..] = rest {
        let length = usize::from(u16::from_be_bytes([*high, *low])).saturating_sub(2);
        let (content, after) = after.split_at(length.min(after.len()));
        segments.push([&[*kind], content].concat());
        rest = after;
        if *kind == SCAN {
            break;
        }
    }
    let mut picture = rest.to_vec();
    if segments.is_empty() || dice.one_in(4) {
        picture = bytes::mutated(&picture, dice);
    } else {
        change(&mut segments, 1, dice);
    }
    let mut changed = start.to_vec();
    for segment in segments {
        let (kind, content) = segment.split_first().unwrap_or((&0, &[]));
        changed.extend([0xff, *kind]);
        changed.extend((content.len() as u16).wrapping_add(2).to_be_bytes());
        changed.extend(content);
    }
    changed.extend(picture);
    changed
}

/// A triangle of a binary STL file, or the header; words of one of text.
pub(super) fn stl(original: &[u8], dice: &mut Dice) -> Vec<u8> {
    let (Some((header, triangles)), false) =
        (original.split_at_checked(84), original.starts_with(b"solid"))
    else {
        return text::mutated(original, dice);
    };
    let mut triangles: Vec<Vec<u8>> = triangles.chunks(50).map(<[u8]>::to_vec).collect();
    if triangles.is_empty() || dice.one_in(8) {
        return [&bytes::mutated(header, dice), triangles.concat().as_slice()].concat();
    }
    change(&mut triangles, 0, dice);
    let count = (triangles.len() as u32).to_le_bytes();
    [&header[..80], &count, &triangles.concat()].concat()
}

/// A record of an MCAP file.
pub(super) fn mcap(original: &[u8], dice: &mut Dice) -> Vec<u8> {
    let Some((magic, mut rest)) = original.split_at_checked(8) else { return Vec::new() };
    // Kind and content.
    let mut records = Vec::new();
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
    change(&mut records, 1, dice);
    let mut changed = magic.to_vec();
    for record in records {
        let (kind, content) = record.split_first().unwrap_or((&0, &[]));
        changed.push(*kind);
        changed.extend((content.len() as u64).to_le_bytes());
        changed.extend(content);
    }
    changed.extend(rest);
    changed
}

#[cfg(test)]
mod tests {
    use super::*;
    use prehend_geometry::TriMesh;
    use prehend_render::RgbImage;

    #[test]
    fn the_checksum_is_that_of_png() {
        assert_eq!(crc32(b"123456789"), 0xcbf4_3926);
        assert_eq!(crc32(b"IEND"), 0xae42_6082);
    }

    #[test]
    fn one_changed_part_leaves_many_files_readable() {
        let readable = |form: fn(&[u8], &mut Dice) -> Vec<u8>, file: &[u8], name: &str| {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join(name);
            let is_right = |seed| {
                std::fs::write(&path, form(file, &mut Dice::new(seed))).unwrap();
                match name {
                    "m.stl" => TriMesh::load(&path).is_ok(),
                    _ => RgbImage::load(&path).is_ok(),
                }
            };
            (0..200).filter(|&seed| is_right(seed)).count()
        };
        let [png_file, jpeg_file, stl_file]: [&[u8]; 3] = [
            include_bytes!("../../corpus/png/color.png"),
            include_bytes!("../../corpus/jpeg/color.jpg"),
            include_bytes!("../../corpus/stl/binary.stl"),
        ];
        let counts = [
            readable(png, png_file, "c.png"),
            readable(jpeg, jpeg_file, "c.jpg"),
            readable(stl, stl_file, "m.stl"),
        ];
        assert!(counts.iter().all(|count| (20..200).contains(count)), "{counts:?}");
    }
}
