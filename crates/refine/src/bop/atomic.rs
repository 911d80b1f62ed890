//! Files that appear whole or not at all.

use std::path::Path;

use super::error::DatasetError;

/// Writes `contents` to a new file beside `path` and renames it to `path`, replacing what was there.
///
/// # Errors
/// [`DatasetError::Write`] naming `path`; a file that was there before is then unchanged.
pub fn write_atomically(path: &Path, contents: &[u8]) -> Result<(), DatasetError> {
    prehend_geometry::write_whole(path, contents)
        .map_err(|e| DatasetError::Write { file: path.to_path_buf(), problem: e.to_string() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_the_file_it_could_not_write() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("absent").join("out.csv");
        assert!(
            matches!(write_atomically(&path, b"x"), Err(DatasetError::Write { file, .. }) if file == path)
        );
        assert!(matches!(write_atomically(dir.path(), b"x"), Err(DatasetError::Write { .. })));
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}
