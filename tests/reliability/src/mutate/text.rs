//! Changes of words and numbers.

use super::Dice;

/// In place of a number.
const NUMBERS: [&str; 17] = [
    "0",
    "-0",
    "-1",
    "1",
    "2",
    "255",
    "256",
    "4294967295",
    "4294967296",
    "18446744073709551616",
    "1e308",
    "-1e308",
    "1e-320",
    "1e999",
    "nan",
    "-inf",
    "0.1.2",
];

/// In place of a word.
const WORDS: [&str; 8] =
    ["", "\0", "a", "../../etc/passwd", "é\u{202e}", "%s%n", "\u{b}", "\u{a0}"];

/// A copy of a part is no longer \[bytes\].
const LONGEST: usize = 1 << 20;

/// A changed copy.
pub(super) fn mutated(original: &[u8], dice: &mut Dice) -> Vec<u8> {
    let mut tokens = tokens(original);
    if tokens.is_empty() {
        return dice.choose(&WORDS).as_bytes().to_vec();
    }
    let at = dice.below(tokens.len());
    let end = (at + 1 + dice.below(24)).min(tokens.len());
    let other = dice.below(tokens.len());
    match dice.below(8) {
        0 => drop(tokens.drain(at..end)),
        1 => {
            let times = if dice.one_in(8) { 200 } else { 1 };
            // Repeated time and again, a text would fill all memory.
            let size: usize = tokens[at..end].iter().map(|token| token.len()).sum();
            let copy = tokens[at..end].repeat(times.min(LONGEST / size.max(1)));
            tokens.splice(other..other, copy);
        }
        2 => tokens.swap(at, other),
        3 => tokens[at] = tokens[other],
        4 => tokens[at] = dice.choose(&WORDS).as_bytes(),
        5 => tokens.truncate(at),
        _ => {
            let is_number = |token: &&[u8]| token[0].is_ascii_digit();
            let number = (0..tokens.len()).map(|k| (at + k) % tokens.len());
            let number = { number }.find(|k| tokens.get(*k).is_some_and(is_number));
            tokens[number.unwrap_or(at)] = dice.choose(&NUMBERS).as_bytes();
        }
    }
    tokens.concat()
}

/// Numbers, words, and what is between them.
fn tokens(text: &[u8]) -> Vec<&[u8]> {
    let kind = |byte: &u8| match byte {
        b'0'..=b'9' | b'.' => 0,
        b'a'..=b'z' | b'A'..=b'Z' | b'_' | b':' | b'/' => 1,
        b' ' | b'\n' | b'\t' | b'\r' => 2,
        // Punctuation, each alone.
        other => 3 + i32::from(*other),
    };
    text.chunk_by(|a, b| kind(a) == kind(b)).collect()
}
