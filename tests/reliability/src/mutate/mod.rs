//! Changes of files that leave most of their structure, so that what is behind the first check is reached.

mod bytes;
mod containers;
mod json;
mod parts;
mod text;
mod xml;

use prehend_geometry::SplitMix64;

use crate::parsers::Form;

/// Random number generator of changes.
pub struct Dice(SplitMix64);

impl Dice {
    /// Generator with this seed.
    pub fn new(seed: u64) -> Self {
        Self(SplitMix64::new(seed))
    }

    /// A whole number below `count`; 0 of none.
    pub fn below(&mut self, count: usize) -> usize {
        ((self.0.uniform() * count as f64) as usize).min(count.saturating_sub(1))
    }

    /// One of `all`, which are not none.
    fn choose<'a, T>(&mut self, all: &'a [T]) -> &'a T {
        &all[self.below(all.len())]
    }

    /// Whether one of `count` is drawn.
    fn one_in(&mut self, count: usize) -> bool {
        self.below(count) == 0
    }
}

/// A changed copy of `original`, whose content has the form `form`.
pub fn mutated(original: &[u8], form: Form, dice: &mut Dice) -> Vec<u8> {
    let mut changed = original.to_vec();
    for _ in 0..1 + dice.below(4) {
        changed = match form {
            // Any structure may be broken, too.
            _ if dice.one_in(8) => bytes::mutated(&changed, dice),
            Form::Text => text::mutated(&changed, dice),
            Form::Xml => xml::mutated(&changed, dice),
            Form::Json => json::mutated(&changed, dice),
            Form::HeaderAndBytes => containers::header_and_bytes(&changed, dice),
            Form::Png => parts::png(&changed, dice),
            Form::Jpeg => parts::jpeg(&changed, dice),
            Form::Stl => parts::stl(&changed, dice),
            Form::Glb => containers::glb(&changed, dice),
            Form::Grid => containers::grid(&changed, dice),
            Form::Mcap => parts::mcap(&changed, dice),
        };
    }
    changed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_the_same_for_a_seed_and_keep_structure() {
        let json = br#"{"a": [1, 2.5, {"b": null}], "c": "text"}"#;
        let changed = |seed| mutated(json, Form::Json, &mut Dice::new(seed));
        assert_eq!(changed(1), changed(1));
        let all: std::collections::BTreeSet<Vec<u8>> = (0..200).map(changed).collect();
        assert!(all.len() > 100, "{}", all.len());
        let parsed = (0..200)
            .map(changed)
            .filter(|c| serde_json::from_slice::<serde_json::Value>(c).is_ok());
        assert!(parsed.count() > 80);
    }
}
