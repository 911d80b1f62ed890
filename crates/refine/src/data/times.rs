//! Run times by frame and method, in a file of their own: they differ between runs, results do not.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use prehend_geometry::limits::MAX_NUMBER;

use crate::data::bop::{DatasetError, read_text, write_atomically};

const HEADER: &str = "index,frame,method,seconds\n";

/// Index of a frame, its name, method and time \[s\].
type TimeRow = (usize, String, String, f64);

/// A CSV file of seconds by frame and method, appended to as frames are finished; it appears with the first of them.
#[derive(Debug)]
pub struct Times {
    path: PathBuf,
    seconds: BTreeMap<(usize, String), f64>,
}

impl Times {
    /// The file at `path`; with `keep` what it holds is kept, as far as its lines are whole, else it is removed.
    ///
    /// # Errors
    /// If it cannot be read or written.
    pub fn open(path: &Path, keep: bool) -> Result<Self, DatasetError> {
        let rows = if keep { rows(path)? } else { Vec::new() };
        if !rows.is_empty() {
            let lines =
                rows.iter().map(|(index, frame, name, time)| line(*index, frame, name, *time));
            write_atomically(path, (HEADER.to_owned() + &lines.collect::<String>()).as_bytes())?;
        } else if path.exists() {
            fs::remove_file(path).map_err(|e| DatasetError::writing(path, e))?;
        }
        let entry = |(index, _, method, seconds)| ((index, method), seconds);
        Ok(Self { path: path.into(), seconds: rows.into_iter().map(entry).collect() })
    }

    /// The methods that the file at `path` has times of; none where there is no such file.
    pub fn methods(path: &Path) -> BTreeSet<String> {
        rows(path).into_iter().flatten().map(|(.., method, _)| method).collect()
    }

    /// Adds the time of a frame; `frame` and `method` are without commas.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn add(
        &mut self,
        index: usize,
        frame: &str,
        method: &str,
        seconds: f64,
    ) -> Result<(), DatasetError> {
        self.seconds.insert((index, method.into()), seconds);
        let header = if self.path.exists() { "" } else { HEADER };
        let text = format!("{header}{}", line(index, frame, method, seconds));
        let file = OpenOptions::new().append(true).create(true).open(&self.path);
        file.and_then(|mut file| file.write_all(text.as_bytes()))
            .map_err(|e| DatasetError::writing(&self.path, e))
    }

    /// Time of `method` on a frame \[s\], if known.
    pub fn of(&self, index: usize, method: &str) -> Option<f64> {
        self.seconds.get(&(index, method.to_owned())).copied()
    }

    /// Mean time of a frame by method \[s\], and the number of frames.
    pub fn means(&self) -> BTreeMap<&str, (f64, usize)> {
        let mut means: BTreeMap<&str, (f64, usize)> = BTreeMap::new();
        for ((_, method), seconds) in &self.seconds {
            let (mean, count) = means.entry(method).or_default();
            *count += 1;
            *mean += (seconds - *mean) / *count as f64;
        }
        means
    }
}

/// The rows of a file that are whole and have a time; none of another file, or where there is none.
fn rows(path: &Path) -> Result<Vec<TimeRow>, DatasetError> {
    let text = match read_text(path) {
        Err(DatasetError::Missing { .. }) => String::new(),
        text => text?,
    };
    let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
    let Some(body) = whole.strip_prefix(HEADER) else { return Ok(Vec::new()) };
    let reader = csv::ReaderBuilder::new().has_headers(false).from_reader(body.as_bytes());
    let rows = reader.into_deserialize().flatten();
    Ok(rows.filter(|(.., seconds): &TimeRow| (0.0..=MAX_NUMBER).contains(seconds)).collect())
}

fn line(index: usize, frame: &str, method: &str, seconds: f64) -> String {
    format!("{index},{frame},{method},{seconds:.4}\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn survive_an_interruption() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("times.csv");
        let mut times = Times::open(&path, false).unwrap();
        times.add(0, "scene 1 image 0 object 5", "depth", 1.0).unwrap();
        times.add(1, "scene 1 image 1 object 5", "depth", 2.0).unwrap();
        times.add(1, "scene 1 image 1 object 5", "physics", 7.0).unwrap();
        assert_eq!(times.means()["depth"], (1.5, 2));
        assert!(Times::methods(&path).iter().eq(["depth", "physics"]));
        assert!(Times::methods(&dir.path().join("none.csv")).is_empty());
        drop(times);
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, &text[..text.len() - 3]).unwrap();
        let times = Times::open(&path, true).unwrap();
        assert_eq!(times.of(1, "depth"), Some(2.0));
        assert_eq!(times.of(1, "physics"), None);
        drop(times);
        assert!(Times::open(&path, false).unwrap().means().is_empty());
    }

    #[test]
    fn what_is_no_time_is_left_out() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("times.csv");
        let rows = "0,f,a,NaN\n1,f,a,1e308\n2,f,a,-1\n3,f,a,2\n4,f,a,inf\n5,f,a\n";
        fs::write(&path, format!("{HEADER}{rows}")).unwrap();
        assert_eq!(Times::open(&path, true).unwrap().means()["a"], (2.0, 1));
    }
}
