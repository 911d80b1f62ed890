//! Changes of bytes.

use super::Dice;

/// Lengths and counts that programs stumble over.
const NUMBERS: [u32; 12] = [
    0,
    1,
    2,
    0x7f,
    0x80,
    0xff,
    0xffff,
    0x0001_0000,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_fffe,
    0xffff_ffff,
];

/// Numbers of single precision likewise.
const FLOATS: [f32; 6] = [f32::NAN, f32::INFINITY, f32::MAX, -1.0, 1e-45, 1e30];

/// A changed copy.
pub(super) fn mutated(original: &[u8], dice: &mut Dice) -> Vec<u8> {
    let mut bytes = original.to_vec();
    let at = dice.below(bytes.len());
    let end = (at + 1 + dice.below(64)).min(bytes.len());
    match dice.below(8) {
        0 => bytes.truncate(at),
        1 => drop(bytes.drain(at..end)),
        2 => {
            let copy = bytes[at..end].to_vec();
            let to = dice.below(bytes.len() + 1);
            bytes.splice(to..to, copy);
        }
        3 | 4 => put(&mut bytes, at, &dice.choose(&NUMBERS).to_le_bytes()),
        5 => put(&mut bytes, at, &dice.choose(&FLOATS).to_le_bytes()),
        6 => bytes.insert(at, dice.below(256) as u8),
        _ => {
            if let Some(byte) = bytes.get_mut(at) {
                *byte ^= 1 << dice.below(8);
            }
        }
    }
    bytes
}

/// Overwrites what is there from `at` on.
fn put(bytes: &mut [u8], at: usize, new: &[u8]) {
    bytes.iter_mut().skip(at).zip(new).for_each(|(to, from)| *to = *from);
}
