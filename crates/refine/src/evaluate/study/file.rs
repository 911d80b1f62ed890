//! The table of a study as a CSV file that grows by the rows of a frame at a time.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::record::{COLUMNS, Key, Record};
use crate::data::bop::{DatasetError, open_locked, write_atomically};

/// The table of a study, open for writing by this process alone. Rows count once they are whole.
pub struct StudyFile {
    path: PathBuf,
    file: File,
    records: HashMap<Key, Record>,
}

impl StudyFile {
    /// Opens the table at `path`, made if absent. With `restart` it is emptied first, whatever it holds.
    ///
    /// # Errors
    /// If it is no such table, damaged, being written by another process, or cannot be read or written.
    pub fn open(path: &Path, restart: bool) -> Result<Self, DatasetError> {
        let fault = |error: io::Error| DatasetError::unusable(path, error);
        let (mut file, bytes) = open_locked(path, restart)?;
        let header = format!("{COLUMNS}\n").into_bytes();
        // What a killed process left of its last line does not count.
        let whole = bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1);
        if !(bytes.starts_with(&header) || whole == 0 && header.starts_with(&bytes)) {
            let problem = "is no table of a study by this program (--restart replaces it)";
            return Err(DatasetError::unusable(path, problem));
        }
        let rows = bytes.get(header.len()..whole).unwrap_or_default();
        let reader = csv::ReaderBuilder::new().has_headers(false).from_reader(rows);
        let mut records = HashMap::new();
        for (line, record) in (2..).zip(reader.into_deserialize::<Record>()) {
            let record = record.map_err(|_| {
                let advice = "remove the line, or discard the whole table with --restart";
                DatasetError::unusable(path, format!("line {line} is damaged: {advice}"))
            })?;
            records.insert(record.key.clone(), record);
        }
        file.set_len(whole as u64).and_then(|()| file.seek(SeekFrom::End(0))).map_err(fault)?;
        let mut table = Self { path: path.into(), file, records };
        if whole == 0 {
            table.write(&header)?;
        }
        Ok(table)
    }

    /// Those of the rows `wanted` that the table does not have, or that have failed.
    ///
    /// # Errors
    /// If the table has one of them from another program, other inputs or settings, or another seed.
    pub fn missing(&self, mut wanted: Vec<Record>) -> Result<Vec<Record>, DatasetError> {
        for (own, found) in wanted.iter().filter_map(|own| Some((own, self.records.get(&own.key)?)))
        {
            let differences = found.differences(own);
            if !differences.is_empty() {
                let (frame, row) = (own.frame_label(), own.key.label());
                let problem = format!(
                    "has {row} of {frame} by another run (there | here):{differences}\n(--restart discards the whole table)"
                );
                return Err(DatasetError::unusable(&self.path, problem));
            }
        }
        wanted.retain(|w| self.records.get(&w.key).is_none_or(|found| found.failure().is_some()));
        Ok(wanted)
    }

    /// Adds rows, on disk when it returns.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn append(&mut self, records: Vec<Record>) -> Result<(), DatasetError> {
        let bytes = rows(&self.path, &records)?;
        self.write(&bytes)?;
        self.records.extend(records.into_iter().map(|record| (record.key.clone(), record)));
        Ok(())
    }

    /// Puts the table in order, the rows that were `wanted` last and in that order, and returns these: the same bytes, run times
    /// aside, whatever the order in which frames were finished.
    ///
    /// # Errors
    /// If it cannot be written; the table is then as it was.
    pub fn finish(
        mut self,
        wanted: impl Iterator<Item = Record>,
    ) -> Result<Vec<Record>, DatasetError> {
        // More frames may have been asked for than when a row was written.
        let found = |Record { key, frames, .. }: Record| {
            self.records.remove(&key).map(|record| Record { frames, ..record })
        };
        let own: Vec<Record> = wanted.filter_map(found).collect();
        let others = self.records.into_values().map(|other| rows(&self.path, &[other]));
        let mut others = others.collect::<Result<Vec<_>, _>>()?;
        others.sort_unstable();
        let header = format!("{COLUMNS}\n").into_bytes();
        let text = [header, others.concat(), rows(&self.path, &own)?].concat();
        write_atomically(&self.path, &text)?;
        Ok(own)
    }

    /// One call of the system, so that a kill leaves at most one broken line; and then to disk.
    fn write(&mut self, bytes: &[u8]) -> Result<(), DatasetError> {
        let written = self.file.write_all(bytes).and_then(|()| self.file.sync_data());
        written.map_err(|e| DatasetError::unusable(&self.path, e))
    }
}

fn rows(path: &Path, records: &[Record]) -> Result<Vec<u8>, DatasetError> {
    let mut writer = csv::WriterBuilder::new().has_headers(false).from_writer(Vec::new());
    let written = records.iter().try_for_each(|record| writer.serialize(record));
    written.map_err(|e| DatasetError::writing(path, e))?;
    writer.into_inner().map_err(|e| DatasetError::writing(path, e))
}

#[cfg(test)]
mod tests {
    use super::super::tables::tests::example;
    use super::*;

    #[test]
    fn every_number_returns_and_a_torn_line_is_cut_off() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("study.csv");
        let records = example();
        let mut table = StudyFile::open(&path, false).unwrap();
        let busy = StudyFile::open(&path, false).err().unwrap().to_string();
        assert!(busy.contains("another process"), "{busy}");
        // In another order.
        table.append(records[5..].to_vec()).unwrap();
        table.append(records[..5].to_vec()).unwrap();
        drop(table);
        let text = std::fs::read_to_string(&path).unwrap();
        // A row of another length would be an error.
        let count = csv::Reader::from_reader(text.as_bytes()).into_records().flatten().count();
        assert_eq!(count, records.len());
        std::fs::write(&path, &text[..text.len() - 9]).unwrap();
        let mut table = StudyFile::open(&path, false).unwrap();
        // The one that was torn, and the one that failed.
        let missing = table.missing(records.clone()).unwrap();
        let failed: Vec<&Record> = records.iter().filter(|r| r.failure().is_some()).collect();
        assert_eq!((missing.len(), &missing[0], failed), (2, &records[4], vec![&missing[1]]));
        table.append(missing).unwrap();
        assert_eq!(table.finish(records.clone().into_iter()).unwrap(), records);
        assert_eq!(std::fs::read_to_string(&path).unwrap().lines().count(), records.len() + 1);
    }

    #[test]
    fn other_runs_and_other_files_are_left_alone() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("study.csv");
        let mut table = StudyFile::open(&path, false).unwrap();
        table.append(example()).unwrap();
        let mut wanted = example();
        wanted[0].provenance[3] = "3".into();
        wanted[0].provenance[2] = "x".into();
        let said = table.missing(wanted).unwrap_err().to_string();
        assert!(said.contains("settings: 0 | x\n  seed: 0 | 3"), "{said}");
        drop(table);
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, text.replacen("main,ds", "main,ds,ds", 1)).unwrap();
        let said = StudyFile::open(&path, false).err().unwrap().to_string();
        assert!(said.contains("line 2 is damaged"), "{said}");
        std::fs::write(&path, "scene_id,im_id\n1,2\n").unwrap();
        let said = StudyFile::open(&path, false).err().unwrap().to_string();
        assert!(said.contains("is no table of a study"), "{said}");
        StudyFile::open(&path, true).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), format!("{COLUMNS}\n"));
    }
}
