//! Files that appear whole or not at all.

use std::path::Path;

use super::error::DatasetError;

/// Writes `contents` to a new file beside `path` and renames it to `path`, replacing what was there.
///
/// # Errors
/// [`DatasetError::Write`] naming `path`; a file that was there before is then unchanged.
pub fn write_atomically(path: &Path, contents: &[u8]) -> Result<(), DatasetError> {
    prehend_geometry::write_atomic(path, contents).map_err(|e| DatasetError::writing(path, e))
}

/// Whether [`write_atomically`] could write `path` now, to know before long work; leaves nothing behind.
///
/// # Errors
/// [`DatasetError::Write`] naming `path`.
pub fn check_writable(path: &Path) -> Result<(), DatasetError> {
    let fault = |problem: &dyn std::fmt::Display| DatasetError::writing(path, problem);
    if path.is_dir() {
        return Err(fault(&"is a folder"));
    }
    let name = path.file_name().ok_or_else(|| fault(&"the path names no file"))?;
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    if let Some(folder) = folder.filter(|p| !p.is_dir()) {
        return Err(fault(&format!("there is no folder {}", folder.display())));
    }
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(name);
    hidden.push(format!(".{}.probe", std::process::id()));
    let probe = path.with_file_name(hidden);
    std::fs::write(&probe, []).and_then(|()| std::fs::remove_file(&probe)).map_err(|e| fault(&e))
}

/// Makes the folder and those above it, where they are absent.
///
/// # Errors
/// [`DatasetError::Write`] naming `folder`.
pub fn create_folder(folder: &Path) -> Result<(), DatasetError> {
    std::fs::create_dir_all(folder).map_err(|e| DatasetError::writing(folder, e))
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
        assert!(check_writable(&path).is_err() && check_writable(dir.path()).is_err());
        assert_eq!(check_writable(&dir.path().join("new.csv")), Ok(()));
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}
