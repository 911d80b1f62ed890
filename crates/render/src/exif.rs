//! The orientation of stored images: how the camera was held, as EXIF metadata have it.

use std::io::{BufRead, Read, Seek, SeekFrom};

use image::metadata::Orientation;
use image::{ImageDecoder, ImageFormat, ImageReader};

const PNG_SIGNATURE: u64 = 8;

/// Orientation that a PNG or JPEG file says its pixels are to be shown in; as they are stored where it says nothing.
pub(crate) fn orientation(file: impl BufRead + Seek) -> Orientation {
    stated(file).unwrap_or(Orientation::NoTransforms)
}

fn stated(file: impl BufRead + Seek) -> Option<Orientation> {
    let reader = ImageReader::new(file).with_guessed_format().ok()?;
    let exif = match reader.format()? {
        // The decoder knows the chunks before the pixels alone.
        ImageFormat::Png => exif_chunk(reader.into_inner()),
        _ => reader.into_decoder().ok()?.exif_metadata().ok()?,
    };
    Orientation::from_exif(orientation_tag(&exif?)?)
}

/// Tag 274 of the first directory, whatever the type of its number (EXIF 2.32, 4.6.2): some programs write one of 32 bits.
fn orientation_tag(exif: &[u8]) -> Option<u8> {
    let is_little = match exif.get(..4)? {
        b"II*\0" => true,
        b"MM\0*" => false,
        _ => return None,
    };
    let number = |at: usize, bytes: usize| {
        let own = exif.get(at..at.checked_add(bytes)?)?.iter();
        let push = |all: u32, byte: &u8| all << 8 | u32::from(*byte);
        Some(if is_little { own.rev().fold(0, push) } else { own.fold(0, push) })
    };
    let directory = number(4, 4)? as usize;
    let entries = (0..number(directory, 2)? as usize).map(|k| directory + 2 + 12 * k);
    let entry = entries.take_while(|at| *at < exif.len()).find(|&at| number(at, 2) == Some(274))?;
    let bytes = match number(entry + 2, 2)? {
        1 => 1,
        3 => 2,
        4 => 4,
        _ => return None,
    };
    u8::try_from(number(entry + 8, bytes)?).ok()
}

/// The chunk `eXIf` of a PNG file, wherever it is.
fn exif_chunk(mut file: impl BufRead + Seek) -> Option<Vec<u8>> {
    file.seek(SeekFrom::Start(PNG_SIGNATURE)).ok()?;
    loop {
        let mut head = [0; 8];
        file.read_exact(&mut head).ok()?;
        let (length, name) = head.split_first_chunk::<4>()?;
        let length = u32::from_be_bytes(*length);
        match name {
            b"eXIf" => {
                let mut chunk = Vec::new();
                file.take(length.into()).read_to_end(&mut chunk).ok()?;
                return Some(chunk);
            }
            b"IEND" => return None,
            // Past its data and its checksum.
            _ => file.seek_relative(i64::from(length) + 4).ok()?,
        }
    }
}

/// Whether columns become rows.
pub(crate) fn swaps_sides(orientation: Orientation) -> bool {
    matches!(
        orientation,
        Orientation::Rotate90
            | Orientation::Rotate270
            | Orientation::Rotate90FlipH
            | Orientation::Rotate270FlipH
    )
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::image::{Mask, RgbImage, image_size};

    /// EXIF with an orientation and nothing else, little-endian.
    fn exif(orientation: u8) -> Vec<u8> {
        let mut exif = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0".to_vec();
        exif.extend([orientation, 0, 0, 0, 0, 0, 0, 0]);
        exif
    }

    #[test]
    fn numbers_of_any_type_and_order() {
        let little = |kind: u8| {
            let mut exif = exif(6);
            exif[12] = kind;
            exif
        };
        let big = |kind: u8, value: [u8; 4]| {
            let head = b"MM\0*\0\0\0\x08\0\x02\x01\0\0\x03\0\0\0\x01\0\x05\0\0\x01\x12\0";
            [head.as_slice(), &[kind, 0, 0, 0, 1], &value, &[0; 4]].concat()
        };
        for exif in [little(1), little(3), little(4), big(3, [0, 6, 0, 0]), big(4, [0, 0, 0, 6])] {
            assert_eq!(super::orientation_tag(&exif), Some(6), "{exif:?}");
            for end in 0..exif.len() - 4 {
                assert!(super::orientation_tag(&exif[..end]).is_none_or(|found| found == 6));
            }
        }
        assert_eq!(super::orientation_tag(&little(2)), None);
        assert_eq!(super::orientation_tag(b"II*\0\xff\xff\xff\xff"), None);
    }

    fn crc(bytes: &[u8]) -> u32 {
        let table = |byte: u32| {
            (0..8).fold(byte, |c, _| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 })
        };
        !bytes.iter().fold(!0, |c: u32, b| table((c ^ u32::from(*b)) & 0xff) ^ (c >> 8))
    }

    /// `png` with the orientation behind its header, or before its end.
    fn with_chunk(png: &[u8], orientation: u8, late: bool) -> Vec<u8> {
        let mut named = b"eXIf".to_vec();
        named.extend(exif(orientation));
        let mut chunk = (named.len() as u32 - 4).to_be_bytes().to_vec();
        chunk.extend(&named);
        chunk.extend(crc(&named).to_be_bytes());
        let at = if late { png.len() - 12 } else { 8 + 25 };
        [&png[..at], &chunk, &png[at..]].concat()
    }

    fn with_segment(jpeg: &[u8], orientation: u8) -> Vec<u8> {
        let exif = [b"Exif\0\0".as_slice(), &exif(orientation)].concat();
        let length = (exif.len() as u16 + 2).to_be_bytes();
        [&jpeg[..2], &[0xff, 0xe1], &length, &exif, &jpeg[2..]].concat()
    }

    /// Where the top left of an upright image of 3 by 2 pixels is stored, for each orientation: EXIF 2.32, tag 274.
    const STORED: [(u8, [usize; 2], bool); 8] = [
        (1, [0, 0], false),
        (2, [2, 0], false),
        (3, [2, 1], false),
        (4, [0, 1], false),
        (5, [0, 0], true),
        (6, [0, 2], true),
        (7, [1, 2], true),
        (8, [1, 0], true),
    ];

    #[test]
    fn images_are_read_upright() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("image.png");
        for (orientation, [x, y], swapped) in STORED {
            let (width, height) = if swapped { (2, 3) } else { (3, 2) };
            let mut mask = Mask::filled(width, height, false);
            mask.pixels_mut()[y * width + x] = true;
            mask.save(&path).unwrap();
            let png = std::fs::read(&path).unwrap();
            for late in [false, true] {
                std::fs::write(&path, with_chunk(&png, orientation, late)).unwrap();
                assert_eq!(image_size(&path).unwrap(), (3, 2), "{orientation}");
                let color = RgbImage::load(&path).unwrap();
                let bright: Vec<bool> = color.pixels().iter().map(|p| p[0] > 0.5).collect();
                assert_eq!(bright, [true, false, false, false, false, false], "{orientation}");
                assert_eq!(Mask::load(&path).unwrap().pixels(), bright);
            }
        }
    }

    #[test]
    fn photographs_are_read_upright() {
        for (orientation, [x, y], swapped) in STORED {
            let (width, height) = if swapped { (32, 48) } else { (48, 32) };
            let mut color = RgbImage::filled(width, height, [0.0; 3]);
            for (i, pixel) in color.pixels_mut().iter_mut().enumerate() {
                let [column, row] = [i % width, i / width].map(|k| k / 16);
                *pixel = if [column, row] == [x, y] { [1.0; 3] } else { [0.0; 3] };
            }
            let jpeg = with_segment(&color.to_jpeg(95).unwrap(), orientation);
            let read = RgbImage::decode(&jpeg, Path::new("photograph")).unwrap();
            assert_eq!((read.width(), read.height()), (48, 32), "{orientation}");
            assert!(read.get(8, 8).unwrap()[0] > 0.9, "{orientation}");
            assert!(read.get(40, 24).unwrap()[0] < 0.1, "{orientation}");
        }
    }
}
