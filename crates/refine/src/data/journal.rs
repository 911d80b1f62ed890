//! An append-only record of finished frames, so that a run may be interrupted at any moment.
//!
//! The first line of the file is the run's [`Identity`], every other one `{"index":…,"entry":…}`. A line counts once it
//! is whole: what a killed process left of its last line is cut off when the journal is opened again.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::data::bop::{DatasetError, open_locked};
use crate::data::identity::Identity;

/// A journal that is open for writing, by this process alone.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
}

#[derive(Serialize, Deserialize)]
struct JournalLine<E> {
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
        let fault = |problem: &dyn Display| DatasetError::unusable(path, problem);
        let foreign = || fault(&"is no journal of this program");
        let (mut file, bytes) = open_locked(path, restart)?;
        let own = serde_json::to_string(identity).map_err(|e| unrecorded(path, 0, e))?;
        let mut lines = bytes.split_inclusive(|&b| b == b'\n').filter(|l| l.ends_with(b"\n"));
        let first = lines.next();
        if let Some(first) = first {
            let header: Identity = serde_json::from_slice(first).map_err(|_| foreign())?;
            let differences = header.differences(identity);
            if !differences.is_empty() {
                let problem = format!(
                    "is of another run, which is not finished (there | here):\n  {}\n(--restart discards it)",
                    differences.join("\n  ")
                );
                return Err(fault(&problem));
            }
        } else if !own.as_bytes().starts_with(&bytes) {
            // What may be overwritten without a whole line is a part of the first one.
            return Err(foreign());
        }
        let (mut entries, mut length) = (BTreeMap::new(), first.map_or(0, <[u8]>::len));
        for (number, line) in (2..).zip(lines) {
            let JournalLine { index, entry } = serde_json::from_slice(line).map_err(|_| {
                fault(&format!("line {number} is damaged (--restart discards the whole journal)"))
            })?;
            entries.insert(index, entry);
            length += line.len();
        }
        file.set_len(length as u64).map_err(|e| fault(&e))?;
        file.seek(SeekFrom::End(0)).map_err(|e| fault(&e))?;
        let mut journal = Self { path: path.into(), file };
        if first.is_none() {
            journal.write_line(&own)?;
        }
        Ok((journal, entries))
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
        let fault = |error| unrecorded(&self.path, index, error);
        let text = serde_json::to_string(&JournalLine { index, entry }).map_err(fault)?;
        let back: JournalLine<E> = serde_json::from_str(&text).map_err(fault)?;
        self.write_line(&text)?;
        Ok(back.entry)
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

fn unrecorded(path: &Path, index: usize, error: serde_json::Error) -> DatasetError {
    DatasetError::unusable(path, format!("frame {index} cannot be recorded: {error}"))
}
