//! Lines of text files of whatever program.

use std::borrow::Cow;

/// Lines of `text`, each with its number from 1: with the line ends of any system, and whole where a backslash broke one that is no comment.
pub(super) fn lines(text: &str) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    // `\r\n` is one end.
    let ends = text.split_inclusive(['\n', '\r']).scan('\n', |before, line| {
        let is_rest = *before == '\r' && line == "\n";
        *before = line.chars().next_back().unwrap_or_default();
        Some((is_rest, line.trim_end_matches(['\n', '\r'])))
    });
    let mut physical = ends.filter_map(|(is_rest, line)| (!is_rest).then_some(line)).enumerate();
    std::iter::from_fn(move || {
        let (index, first) = physical.next()?;
        if !first.ends_with('\\') || first.contains('#') {
            return Some((index + 1, Cow::Borrowed(first)));
        }
        let mut whole = first.to_owned();
        while whole.ends_with('\\') {
            whole.pop();
            whole.push(' ');
            whole.push_str(physical.next().map_or("", |(_, next)| next));
        }
        Some((index + 1, Cow::Owned(whole)))
    })
}

/// Text in UTF-8 or, with a byte order mark, UTF-16; without that mark.
pub(super) fn decoded(bytes: &[u8]) -> Cow<'_, str> {
    let wide = |decode: fn([u8; 2]) -> u16| {
        let units = bytes[2..].as_chunks().0.iter().map(|pair| decode(*pair));
        let text = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER));
        Cow::Owned(text.collect::<String>())
    };
    match bytes {
        [0xff, 0xfe, ..] => wide(u16::from_le_bytes),
        [0xfe, 0xff, ..] => wide(u16::from_be_bytes),
        _ => String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn line_ends_and_encodings() {
        let text = "a\\\nb\n\nc d";
        let right = [(1, "a b"), (3, ""), (4, "c d")].map(|(at, line)| (at, Cow::Borrowed(line)));
        let wide = |text: &str, bytes: fn(u16) -> [u8; 2]| -> Vec<u8> {
            text.encode_utf16().flat_map(bytes).collect()
        };
        for ends in ["\n", "\r\n", "\r"] {
            let text = text.replace('\n', ends);
            let marked = [b"\xef\xbb\xbf", text.as_bytes()].concat();
            let big = wide(&format!("\u{feff}{text}"), u16::to_be_bytes);
            let little = wide(&format!("\u{feff}{text}"), u16::to_le_bytes);
            for bytes in [text.into_bytes(), marked, big, little] {
                assert!(lines(&decoded(&bytes)).eq(right.iter().cloned()));
            }
        }
        assert!(lines("a\\").eq([(1, Cow::Borrowed("a "))]));
        // Ends of several systems, and paths in comments.
        let mixed = "# D:\\parts\\\na\rb\r\nc # \\\nd";
        let right = [(1, "# D:\\parts\\"), (2, "a"), (3, "b"), (4, "c # \\"), (5, "d")];
        assert!(lines(mixed).eq(right.map(|(at, line)| (at, Cow::Borrowed(line)))));
        assert_eq!(lines(&"\\\n".repeat(200_000)).count(), 1);
    }
}
