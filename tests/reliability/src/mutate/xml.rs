//! Changes of XML by its elements and attributes.

use std::ops::Range;

use super::{Dice, text};

/// A changed copy.
pub(super) fn mutated(original: &[u8], dice: &mut Dice) -> Vec<u8> {
    let (elements, values) = (elements(original), values(original));
    if elements.is_empty() || values.is_empty() || dice.one_in(6) {
        return text::mutated(original, dice);
    }
    let element = dice.choose(&elements).clone();
    let value = dice.choose(&values).clone();
    match dice.below(7) {
        0 => with(original, element, b""),
        1 => with(original, element, &original[dice.choose(&elements).clone()]),
        2 => {
            let before = dice.choose(&elements).start;
            with(original, before..before, &original[element])
        }
        3 | 4 => with(original, value.clone(), &original[dice.choose(&values).clone()]),
        _ => with(original, value.clone(), &text::mutated(&original[value], dice)),
    }
}

/// A copy with `new` in place of `old`.
fn with(original: &[u8], old: Range<usize>, new: &[u8]) -> Vec<u8> {
    [&original[..old.start], new, &original[old.end..]].concat()
}

/// Where elements are, from `<` to the `>` of the end.
fn elements(text: &[u8]) -> Vec<Range<usize>> {
    let mut open = Vec::new();
    let mut all = Vec::new();
    for start in (0..text.len()).filter(|&at| text[at] == b'<') {
        let Some(length) = text[start..].iter().position(|&byte| byte == b'>') else { break };
        let end = start + length + 1;
        match &text[start + 1..end] {
            [b'!' | b'?', ..] => {}
            [b'/', ..] => all.extend(open.pop().map(|start| start..end)),
            [.., b'/', b'>'] => all.push(start..end),
            _ => open.push(start),
        }
    }
    all.sort_by_key(|element| element.start);
    all
}

/// Where values of attributes are, between their quotation marks.
fn values(text: &[u8]) -> Vec<Range<usize>> {
    let quotes: Vec<usize> = (0..text.len()).filter(|&at| text[at] == b'"').collect();
    quotes.chunks_exact(2).map(|pair| pair[0] + 1..pair[1]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use prehend_geometry::KinematicTree;

    #[test]
    fn elements_and_values_are_found() {
        let text = br#"<?xml version="1"?><a x="12"><b y=""/><!-- --><c><d/></c></a>"#;
        let found = elements(text);
        let found: Vec<_> = found.iter().map(|at| text[at.clone()].escape_ascii()).collect();
        let found: Vec<_> = found.iter().map(ToString::to_string).collect();
        assert_eq!(found.len(), 4);
        assert_eq!(found[1..], [r#"<b y=\"\"/>"#, "<c><d/></c>", "<d/>"]);
        let found: Vec<_> = values(text).iter().map(|at| &text[at.clone()]).collect();
        assert_eq!(found, [&b"1"[..], b"12", b""]);
    }

    #[test]
    fn many_changed_robots_are_well_formed() {
        let robot = include_bytes!("../../corpus/urdf/hand.urdf");
        let is_right = |seed| {
            let changed = mutated(robot, &mut Dice::new(seed));
            let text = std::str::from_utf8(&changed);
            text.is_ok_and(|text| KinematicTree::from_urdf_str(text, None).is_ok())
        };
        let count = (0..200).filter(|&seed| is_right(seed)).count();
        assert!((20..190).contains(&count), "{count}");
    }
}
