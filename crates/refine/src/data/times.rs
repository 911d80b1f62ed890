//! Run times by frame, in a file of their own: they differ between runs, results do not.

use std::collections::BTreeSet;
use std::path::Path;

use crate::data::bop::{DatasetError, read_text, write_atomically};

const HEADER: &str = "index,frame,method,seconds\n";

/// Writes the times \[s\] of `method` on frames, by their indices and names, as CSV; names are without commas.
///
/// # Errors
/// If the file cannot be written.
pub fn write_times(
    path: &Path,
    method: &str,
    times: impl IntoIterator<Item = (usize, String, f64)>,
) -> Result<(), DatasetError> {
    let line = |(index, frame, seconds)| format!("{index},{frame},{method},{seconds:.4}\n");
    let lines: String = times.into_iter().map(line).collect();
    write_atomically(path, format!("{HEADER}{lines}").as_bytes())
}

/// The methods that the file at `path` has times of; none where there is no such file.
pub fn timed_methods(path: &Path) -> BTreeSet<String> {
    let text = read_text(path).unwrap_or_default();
    let body = text.strip_prefix(HEADER).unwrap_or_default();
    let reader = csv::ReaderBuilder::new().has_headers(false).from_reader(body.as_bytes());
    let rows = reader.into_deserialize().flatten();
    let is_time = |row: &(usize, String, String, f64)| row.3 >= 0.0 && row.3.is_finite();
    rows.filter(is_time).map(|(_, _, method, _)| method).collect()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn methods_are_read_back() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("times.csv");
        assert!(timed_methods(&path).is_empty());
        let name = "scene 1 image 0 object 5".to_owned();
        write_times(&path, "depth", [(0, name.clone(), 1.0), (3, name, 0.25)]).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.ends_with("\n3,scene 1 image 0 object 5,depth,0.2500\n"), "{text}");
        fs::write(&path, text + "4,f,physics,7\n5,f,broken\n6,f,icp,NaN\n7,f,fused,-1\n").unwrap();
        assert!(timed_methods(&path).iter().eq(["depth", "physics"]));
        fs::write(&path, "index,frame\n1,f,depth,7\n").unwrap();
        assert!(timed_methods(&path).is_empty());
    }
}
