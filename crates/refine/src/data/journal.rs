//! An append-only record of finished frames, so that a run may be interrupted at any moment.
//!
//! The first line of the file is the run's [`Identity`], every other one `{"index":…,"entry":…}`. A line counts once it
//! is whole: what a killed process left of its last line is cut off when the journal is opened again.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::data::bop::{DatasetError, write_atomically};
use crate::data::identity::Identity;

/// A journal that is open for writing, by this process alone.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
    identity: Identity,
}

#[derive(Serialize, Deserialize)]
struct Line<E> {
    index: usize,
    entry: E,
}

impl Journal {
    /// Opens the journal of a run, made if absent, and returns what it holds by frame; the last entry of a frame counts.
    /// With `restart` it is emptied first, whatever it holds.
    ///
    /// # Errors
    /// If it is of a run with other facts, no journal, damaged, being written by another process, or cannot be read or
    /// written.
    pub fn open<E: DeserializeOwned>(
        path: &Path,
        identity: &Identity,
        restart: bool,
    ) -> Result<(Self, BTreeMap<usize, E>), DatasetError> {
        let fault = |error: io::Error| DatasetError::unusable(path, error);
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false);
        let mut file = options.open(path).map_err(fault)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => {
                return Err(DatasetError::unusable(path, "another process is at work on it"));
            }
            // Some network file systems have no locks.
            Err(TryLockError::Error(e)) if e.kind() != ErrorKind::Unsupported => {
                return Err(fault(e));
            }
            _ => {}
        }
        let mut bytes = Vec::new();
        if !restart {
            file.read_to_end(&mut bytes).map_err(fault)?;
        }
        let own = header(path, identity)?;
        let Parsed { header, entries, length } = parse(path, &bytes, &own)?;
        let differences = header.as_ref().map_or_else(Vec::new, |h| h.differences(identity, &[]));
        if !differences.is_empty() {
            let problem = format!(
                "is of another run, which is not finished (there | here):\n  {}\n(--restart discards it)",
                differences.join("\n  ")
            );
            return Err(DatasetError::unusable(path, problem));
        }
        file.set_len(length as u64).map_err(fault)?;
        file.seek(SeekFrom::End(0)).map_err(fault)?;
        let mut journal = Self { path: path.into(), file, identity: identity.clone() };
        if header.is_none() {
            journal.write_line(&own)?;
        }
        Ok((journal, entries))
    }

    /// What a journal says of its run, and its entries; for reading alone.
    ///
    /// # Errors
    /// If it cannot be read, is no journal, or is damaged.
    pub fn read<E: DeserializeOwned>(
        path: &Path,
    ) -> Result<(Identity, BTreeMap<usize, E>), DatasetError> {
        let bytes = std::fs::read(path).map_err(|e| DatasetError::unusable(path, e))?;
        let Parsed { header, entries, .. } = parse(path, &bytes, "")?;
        Ok((header.ok_or_else(|| foreign(path))?, entries))
    }

    /// Records a finished frame on disk and returns it as a resumed run would read it.
    ///
    /// # Errors
    /// If it does not read back, and nothing is written; or if it cannot be written.
    pub fn append<E: Serialize + DeserializeOwned>(
        &mut self,
        index: usize,
        entry: &E,
    ) -> Result<E, DatasetError> {
        let text = line(&self.path, index, entry)?;
        let back: Line<E> =
            serde_json::from_str(&text).map_err(|e| unrecorded(&self.path, index, e))?;
        self.write_line(&text)?;
        Ok(back.entry)
    }

    /// Replaces the journal by one with these entries in the order of their frames: the same bytes whatever
    /// the order in which they were finished.
    ///
    /// # Errors
    /// If it cannot be written; the journal is then as it was.
    pub fn compact<E: Serialize>(self, entries: &BTreeMap<usize, E>) -> Result<(), DatasetError> {
        Self::write(&self.path, &self.identity, entries)
    }

    /// Writes a whole journal to `path`, in place of what was there.
    ///
    /// # Errors
    /// If it cannot be written; what was there is then as it was.
    pub fn write<E: Serialize>(
        path: &Path,
        identity: &Identity,
        entries: &BTreeMap<usize, E>,
    ) -> Result<(), DatasetError> {
        let mut text = header(path, identity)? + "\n";
        for (&index, entry) in entries {
            text += &line(path, index, entry)?;
            text.push('\n');
        }
        write_atomically(path, text.as_bytes())
    }

    /// Removes the journal of a run whose output is complete.
    ///
    /// # Errors
    /// If it cannot be removed.
    pub fn discard(self) -> Result<(), DatasetError> {
        std::fs::remove_file(&self.path).map_err(|e| DatasetError::unusable(&self.path, e))
    }

    /// One call of the system a line, so that a kill leaves at most one broken line; and then to disk.
    fn write_line(&mut self, text: &str) -> Result<(), DatasetError> {
        let line = format!("{text}\n");
        self.file
            .write_all(line.as_bytes())
            .and_then(|()| self.file.sync_data())
            .map_err(|e| DatasetError::unusable(&self.path, e))
    }
}

/// The first line of a run's journal.
fn header(path: &Path, identity: &Identity) -> Result<String, DatasetError> {
    serde_json::to_string(identity).map_err(|e| unrecorded(path, 0, e))
}

/// The line of a frame.
fn line<E: Serialize>(path: &Path, index: usize, entry: &E) -> Result<String, DatasetError> {
    serde_json::to_string(&Line { index, entry }).map_err(|e| unrecorded(path, index, e))
}

fn unrecorded(path: &Path, index: usize, error: serde_json::Error) -> DatasetError {
    DatasetError::unusable(path, format!("frame {index} cannot be recorded: {error}"))
}

fn foreign(path: &Path) -> DatasetError {
    DatasetError::unusable(path, "is no journal of this program")
}

/// What is whole in a journal.
struct Parsed<E> {
    /// `None` if not even the first line is whole.
    header: Option<Identity>,
    entries: BTreeMap<usize, E>,
    /// How many bytes are whole lines.
    length: usize,
}

/// `own` is the first line that this run would write: of a file without a whole line, what may be overwritten is a part of it.
fn parse<E: DeserializeOwned>(
    path: &Path,
    bytes: &[u8],
    own: &str,
) -> Result<Parsed<E>, DatasetError> {
    let mut entries = BTreeMap::new();
    let mut lines = bytes.split_inclusive(|&b| b == b'\n').filter(|l| l.ends_with(b"\n"));
    let Some(first) = lines.next() else {
        return if own.as_bytes().starts_with(bytes) {
            Ok(Parsed { header: None, entries, length: 0 })
        } else {
            Err(foreign(path))
        };
    };
    let header = serde_json::from_slice(first).map_err(|_| foreign(path))?;
    let mut length = first.len();
    for (number, line) in (2..).zip(lines) {
        let Line { index, entry } = serde_json::from_slice(line).map_err(|_| {
            let problem =
                format!("line {number} is damaged (--restart discards the whole journal)");
            DatasetError::unusable(path, problem)
        })?;
        entries.insert(index, entry);
        length += line.len();
    }
    Ok(Parsed { header: Some(header), entries, length })
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
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
            let (mut journal, found): (_, Entries) =
                Journal::open(&cut, &identity(1), false).unwrap();
            let kept = ends.iter().filter(|&&end| end < length).count().saturating_sub(1);
            let expected: Entries = [2, 0, 1][..kept].iter().map(|&i| (i, entry(i))).collect();
            assert_eq!(found, expected, "cut at {length}");
            for index in [2, 0, 1].into_iter().filter(|i| !found.contains_key(i)) {
                journal.append(index, &entry(index)).unwrap();
            }
            drop(journal);
            assert_eq!(fs::read(&cut).unwrap(), whole, "cut at {length}");
        }
        // Compacted, it is in order, and still a journal.
        let (journal, all): (_, Entries) = Journal::open(&path, &identity(1), false).unwrap();
        journal.compact(&all).unwrap();
        let (said, again): (_, Entries) = Journal::read(&path).unwrap();
        assert_eq!((said, again), (identity(1), all));
        assert!(fs::read_to_string(&path).unwrap().contains("}\n{\"index\":0,"));
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
        let entries: Entries = (0..3).map(|i| (i, entry(i))).collect();
        Journal::write(&path, &identity(1), &entries).unwrap();
        let text = fs::read_to_string(&path).unwrap().replace("\"index\":1", "\"index\":x");
        fs::write(&path, &text).unwrap();
        let error = refused(&path, 1);
        assert!(error.contains("x.journal: line 3 is damaged"), "{error}");
        assert_eq!(fs::read_to_string(&path).unwrap(), text);
    }
}
