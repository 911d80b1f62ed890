//! The parser that `PREHEND_PARSER` names, given what libFuzzer and our own changes make of its corpus.

#![no_main]

use std::cell::OnceCell;
use std::sync::LazyLock;

use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};
use prehend_reliability::mutate::{Dice, mutated};
use prehend_reliability::parsers::{PARSERS, Parser, find};
use prehend_reliability::small_dataset::SmallDataset;

static PARSER: LazyLock<&Parser> = LazyLock::new(|| {
    let name = std::env::var("PREHEND_PARSER").unwrap_or_default();
    let known = PARSERS.iter().map(|parser| parser.name).collect::<Vec<_>>().join(", ");
    find(&name).unwrap_or_else(|| panic!("PREHEND_PARSER is {name:?}, none of {known}"))
});

thread_local! {
    static DATASET: OnceCell<SmallDataset> = const { OnceCell::new() };
}

fuzz_target!(|bytes: &[u8]| {
    DATASET.with(|dataset| {
        let dataset = dataset.get_or_init(|| SmallDataset::new().expect("no folder for files"));
        // What is wrong with them is theirs.
        let _ = (PARSER.read)(dataset, bytes);
    });
});

fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    let mut dice = Dice::new(u64::from(seed));
    if dice.below(3) == 0 {
        return fuzzer_mutate(data, size, max_size);
    }
    let changed = mutated(&data[..size], PARSER.form, &mut dice);
    let size = changed.len().min(max_size);
    data[..size].copy_from_slice(&changed[..size]);
    size
});
