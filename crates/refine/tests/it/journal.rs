//! Journals of interrupted work.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use prehend_refine::data::{Identity, Journal};
use serde_json::json;

type Entries = BTreeMap<usize, Vec<f64>>;

fn identity(seed: u64) -> Identity {
    Identity::of(&json!({ "seed": seed }))
}

fn entry(index: usize) -> Vec<f64> {
    vec![0.1 + index as f64 / 3.0, -1e-300, f64::MAX]
}

#[test]
fn resumes_whatever_was_cut_off() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.journal");
    let (mut journal, none): (_, Entries) = Journal::open(&path, &identity(1), false).unwrap();
    assert!(none.is_empty());
    for index in [2, 0, 1] {
        assert_eq!(journal.append(index, &entry(index)).unwrap(), entry(index));
    }
    drop(journal);
    let whole = fs::read(&path).unwrap();
    let ends: Vec<usize> = (0..whole.len()).filter(|&i| whole[i] == b'\n').collect();
    assert_eq!(ends.len(), 4);
    let cut = dir.path().join("cut.journal");
    for length in 0..=whole.len() {
        fs::write(&cut, &whole[..length]).unwrap();
        let (mut journal, found): (_, Entries) = Journal::open(&cut, &identity(1), false).unwrap();
        let kept = ends.iter().filter(|&&end| end < length).count().saturating_sub(1);
        let expected: Entries = [2, 0, 1][..kept].iter().map(|&i| (i, entry(i))).collect();
        assert_eq!(found, expected, "cut at {length}");
        for index in [2, 0, 1].into_iter().filter(|i| !found.contains_key(i)) {
            journal.append(index, &entry(index)).unwrap();
        }
        drop(journal);
        assert_eq!(fs::read(&cut).unwrap(), whole, "cut at {length}");
    }
}

/// Why the journal at `path` cannot be opened for the run of this seed.
fn refused(path: &Path, seed: u64) -> String {
    Journal::open::<Vec<f64>>(path, &identity(seed), false).unwrap_err().to_string()
}

#[test]
fn refuses_other_runs_other_files_and_other_processes() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.journal");
    let (mut journal, _): (_, Entries) = Journal::open(&path, &identity(1), false).unwrap();
    journal.append(0, &entry(0)).unwrap();
    let busy = refused(&path, 1);
    assert!(busy.ends_with("x.journal: another process is at work on it"), "{busy}");
    // What does not read back is not written either.
    let before = fs::read(&path).unwrap();
    let error = journal.append(3, &vec![f64::NAN]).unwrap_err().to_string();
    assert!(error.contains("x.journal: frame 3 cannot be recorded: "), "{error}");
    assert_eq!(fs::read(&path).unwrap(), before);
    drop(journal);
    let other = refused(&path, 2);
    assert!(other.contains("x.journal: is of another run"), "{other}");
    assert!(other.contains("(there | here):\n  seed: 1 | 2\n(--restart"), "{other}");
    let (journal, found): (_, Entries) = Journal::open(&path, &identity(2), true).unwrap();
    assert!(found.is_empty());
    journal.discard().unwrap();
    assert!(!path.exists());
    for text in ["precious", "precious\n", "{\"precious\": 1}"] {
        fs::write(&path, text).unwrap();
        assert!(refused(&path, 1).ends_with("x.journal: is no journal of this program"));
        assert_eq!(fs::read_to_string(&path).unwrap(), text);
    }
}

#[test]
fn a_damaged_line_is_named_and_nothing_is_lost() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.journal");
    let (mut journal, _): (_, Entries) = Journal::open(&path, &identity(1), false).unwrap();
    for index in 0..3 {
        journal.append(index, &entry(index)).unwrap();
    }
    drop(journal);
    let text = fs::read_to_string(&path).unwrap().replace("\"index\":1", "\"index\":x");
    fs::write(&path, &text).unwrap();
    let error = refused(&path, 1);
    assert!(error.contains("x.journal: line 3 is damaged"), "{error}");
    assert_eq!(fs::read_to_string(&path).unwrap(), text);
}
