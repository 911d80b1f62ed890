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
use thiserror::Error;

use crate::data::bop::{DatasetError, write_atomically};
use crate::data::identity::Identity;

/// Why a journal cannot be used.
#[derive(Debug, Error)]
pub enum JournalError {
    /// The journal is of a run with other settings or inputs.
    #[error(
        "{}: is of another run, which is not finished (there | here):\n  {}\n(--restart discards it)",
        file.display(), differences.join("\n  ")
    )]
    OtherRun {
        /// The journal.
        file: PathBuf,
        /// What differs, a line each.
        differences: Vec<String>,
    },
    /// The file is something else.
    #[error("{}: is no journal of this program", file.display())]
    Foreign {
        /// The file.
        file: PathBuf,
    },
    /// A whole line is no entry: something else wrote into the file.
    #[error("{}: line {line} is damaged (--restart discards the whole journal)", file.display())]
    Damaged {
        /// The journal.
        file: PathBuf,
        /// Number of the line, from 1.
        line: usize,
    },
    /// Another process is writing it.
    #[error("{}: another process is at work on it", file.display())]
    Busy {
        /// The journal.
        file: PathBuf,
    },
    /// The system refuses.
    #[error("{}: {source}", file.display())]
    Io {
        /// The journal.
        file: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// An entry cannot be written such that it reads back.
    #[error("{}: frame {index} cannot be recorded: {source}", file.display())]
    Entry {
        /// The journal.
        file: PathBuf,
        /// The frame.
        index: usize,
        /// What is wrong with it.
        source: serde_json::Error,
    },
    /// The journal cannot be put in order.
    #[error(transparent)]
    Write(#[from] DatasetError),
}

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
    /// [`JournalError::OtherRun`] unless it is of a run with the same facts, [`JournalError::Foreign`],
    /// [`JournalError::Damaged`], [`JournalError::Busy`] and [`JournalError::Io`].
    pub fn open<E: DeserializeOwned>(
        path: &Path,
        identity: &Identity,
        restart: bool,
    ) -> Result<(Self, BTreeMap<usize, E>), JournalError> {
        let fault = |source| JournalError::Io { file: path.into(), source };
        let mut options = OpenOptions::new();
        let mut file = options
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .map_err(fault)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => return Err(JournalError::Busy { file: path.into() }),
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
        if let Some(header) = &header {
            let differences = header.differences(identity, &[]);
            if !differences.is_empty() {
                return Err(JournalError::OtherRun { file: path.into(), differences });
            }
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
    /// [`JournalError::Io`], [`JournalError::Foreign`] and [`JournalError::Damaged`].
    pub fn read<E: DeserializeOwned>(
        path: &Path,
    ) -> Result<(Identity, BTreeMap<usize, E>), JournalError> {
        let bytes =
            std::fs::read(path).map_err(|source| JournalError::Io { file: path.into(), source })?;
        let Parsed { header, entries, .. } = parse(path, &bytes, "")?;
        Ok((header.ok_or_else(|| JournalError::Foreign { file: path.into() })?, entries))
    }

    /// Records a finished frame on disk and returns it as a resumed run would read it.
    ///
    /// # Errors
    /// [`JournalError::Entry`] if it does not read back, and nothing is written; [`JournalError::Io`].
    pub fn append<E: Serialize + DeserializeOwned>(
        &mut self,
        index: usize,
        entry: &E,
    ) -> Result<E, JournalError> {
        let fault = |source| JournalError::Entry { file: self.path.clone(), index, source };
        let text = serde_json::to_string(&Line { index, entry }).map_err(fault)?;
        let back: Line<E> = serde_json::from_str(&text).map_err(fault)?;
        self.write_line(&text)?;
        Ok(back.entry)
    }

    /// Replaces the journal by one with these entries in the order of their frames: the same bytes whatever
    /// the order in which they were finished.
    ///
    /// # Errors
    /// If it cannot be written; the journal is then as it was.
    pub fn compact<E: Serialize>(self, entries: &BTreeMap<usize, E>) -> Result<(), JournalError> {
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
    ) -> Result<(), JournalError> {
        let mut text = header(path, identity)? + "\n";
        for (&index, entry) in entries {
            let line = serde_json::to_string(&Line { index, entry })
                .map_err(|source| JournalError::Entry { file: path.into(), index, source })?;
            text.push_str(&line);
            text.push('\n');
        }
        Ok(write_atomically(path, text.as_bytes())?)
    }

    /// Removes the journal of a run whose output is complete.
    ///
    /// # Errors
    /// If it cannot be removed.
    pub fn discard(self) -> Result<(), JournalError> {
        std::fs::remove_file(&self.path)
            .map_err(|source| JournalError::Io { file: self.path, source })
    }

    /// One call of the system a line, so that a kill leaves at most one broken line; and then to disk.
    fn write_line(&mut self, text: &str) -> Result<(), JournalError> {
        let line = format!("{text}\n");
        self.file
            .write_all(line.as_bytes())
            .and_then(|()| self.file.sync_data())
            .map_err(|source| JournalError::Io { file: self.path.clone(), source })
    }
}

/// The first line of a run's journal.
fn header(path: &Path, identity: &Identity) -> Result<String, JournalError> {
    let fault = |source| JournalError::Entry { file: path.into(), index: 0, source };
    serde_json::to_string(identity).map_err(fault)
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
) -> Result<Parsed<E>, JournalError> {
    let foreign = || JournalError::Foreign { file: path.into() };
    let mut entries = BTreeMap::new();
    let mut lines = bytes.split_inclusive(|&b| b == b'\n').filter(|l| l.ends_with(b"\n"));
    let Some(first) = lines.next() else {
        return if own.as_bytes().starts_with(bytes) {
            Ok(Parsed { header: None, entries, length: 0 })
        } else {
            Err(foreign())
        };
    };
    let header = serde_json::from_slice(first).map_err(|_| foreign())?;
    let mut length = first.len();
    for (number, line) in (2..).zip(lines) {
        let Line { index, entry } = serde_json::from_slice(line)
            .map_err(|_| JournalError::Damaged { file: path.into(), line: number })?;
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

    #[test]
    fn refuses_other_runs_other_files_and_other_processes() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x.journal");
        let (mut journal, _): (_, Entries) = Journal::open(&path, &identity(1), false).unwrap();
        journal.append(0, &entry(0)).unwrap();
        let busy = Journal::open::<Vec<f64>>(&path, &identity(1), false).unwrap_err();
        assert!(matches!(&busy, JournalError::Busy { file } if *file == path));
        drop(journal);
        match Journal::open::<Vec<f64>>(&path, &identity(2), false).unwrap_err() {
            JournalError::OtherRun { differences, .. } => assert_eq!(differences, ["seed: 1 | 2"]),
            other => panic!("{other}"),
        }
        let (journal, found): (_, Entries) = Journal::open(&path, &identity(2), true).unwrap();
        assert!(found.is_empty());
        journal.discard().unwrap();
        assert!(!path.exists());
        for text in ["precious", "precious\n", "{\"precious\": 1}"] {
            fs::write(&path, text).unwrap();
            let error = Journal::open::<Vec<f64>>(&path, &identity(1), false).unwrap_err();
            assert!(matches!(error, JournalError::Foreign { .. }));
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
        let error = Journal::open::<Vec<f64>>(&path, &identity(1), false).unwrap_err();
        assert!(matches!(error, JournalError::Damaged { line: 3, .. }), "{error}");
        assert_eq!(fs::read_to_string(&path).unwrap(), text);
    }

    #[test]
    fn what_does_not_read_back_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x.journal");
        let (mut journal, _): (_, Entries) = Journal::open(&path, &identity(1), false).unwrap();
        let before = fs::read(&path).unwrap();
        let error = journal.append(3, &vec![f64::NAN]).unwrap_err();
        assert!(matches!(error, JournalError::Entry { index: 3, .. }));
        assert_eq!(fs::read(&path).unwrap(), before);
    }
}
