//! Files that are read whole, and appear whole or not at all.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, ErrorKind, Read};
use std::path::Path;

use prehend_geometry::limits::MAX_TEXT_BYTES;
use prehend_geometry::{AtomicFile, plain_target, read_plain};

use super::error::DatasetError;

/// The content of a plain file of at most [`MAX_TEXT_BYTES`].
///
/// # Errors
/// [`DatasetError::Missing`], or [`DatasetError::Unusable`] for what cannot be read, is no plain file or too large.
pub(crate) fn read_bytes(file: &Path) -> Result<Vec<u8>, DatasetError> {
    read_plain(file, MAX_TEXT_BYTES).map_err(|e| DatasetError::reading(file, &e))
}

/// The text of a plain file of at most [`MAX_TEXT_BYTES`].
///
/// # Errors
/// Those of [`read_bytes`], and if it is not UTF-8.
pub(crate) fn read_text(file: &Path) -> Result<String, DatasetError> {
    String::from_utf8(read_bytes(file)?)
        .map_err(|_| DatasetError::unusable(file, "is no text in UTF-8"))
}

/// The names of what is in `folder`, sorted.
///
/// # Errors
/// If it cannot be listed.
pub(super) fn names(folder: &Path) -> Result<Vec<String>, DatasetError> {
    let listing = fs::read_dir(folder).map_err(|e| DatasetError::reading(folder, &e))?;
    let mut names: Vec<String> =
        listing.flatten().filter_map(|file| file.file_name().into_string().ok()).collect();
    names.sort_unstable();
    Ok(names)
}

/// Writes `contents` to a new file beside `path` and renames it to `path`, replacing what was there.
///
/// # Errors
/// [`DatasetError::Unusable`] naming `path`; a file that was there before is then unchanged.
pub fn write_atomically(path: &Path, contents: &[u8]) -> Result<(), DatasetError> {
    prehend_geometry::write_atomic(path, contents).map_err(|e| DatasetError::writing(path, e))
}

/// Whether [`write_atomically`] could write `path` now, to know before long work; leaves nothing behind.
///
/// # Errors
/// [`DatasetError::Unusable`] naming `path`.
pub fn check_writable(path: &Path) -> Result<(), DatasetError> {
    let fault = |problem: &dyn std::fmt::Display| DatasetError::writing(path, problem);
    if path.is_dir() {
        return Err(fault(&"is a folder"));
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    if let Some(folder) = folder.filter(|p| !p.is_dir()) {
        return Err(fault(&format!("there is no folder {}", folder.display())));
    }
    AtomicFile::create(path).map(drop).map_err(|e| fault(&e))
}

/// Makes the folder and those above it, where they are absent.
///
/// # Errors
/// [`DatasetError::Unusable`] naming `folder`.
pub fn create_folder(folder: &Path) -> Result<(), DatasetError> {
    fs::create_dir_all(folder).map_err(|e| DatasetError::writing(folder, e))
}

/// Opens the file at `path` for reading and writing, made if absent, for this process alone; also returns what it holds, nothing with `anew`. Links are
/// followed, what is no plain file is refused.
///
/// # Errors
/// If another process has it, or it cannot be opened or read.
pub(crate) fn open_locked(path: &Path, anew: bool) -> Result<(File, Vec<u8>), DatasetError> {
    let fault = |error: io::Error| DatasetError::unusable(path, error);
    let mut options = OpenOptions::new();
    options.read(true).write(true).create(true).truncate(false);
    let mut file = plain_target(path).and_then(|path| options.open(path)).map_err(fault)?;
    lock(path, &file)?;
    let mut bytes = Vec::new();
    if !anew {
        file.read_to_end(&mut bytes).map_err(fault)?;
    }
    Ok((file, bytes))
}

/// Keeps other processes from a file or folder, which errors call `path`, until it is closed.
///
/// # Errors
/// If another process has it. Where the file system knows no locks, nobody is kept away.
pub(crate) fn lock(path: &Path, opened: &File) -> Result<(), DatasetError> {
    match opened.try_lock() {
        Err(TryLockError::WouldBlock) => {
            Err(DatasetError::unusable(path, "another process is at work on it"))
        }
        Err(TryLockError::Error(e)) if e.kind() != ErrorKind::Unsupported => {
            Err(DatasetError::unusable(path, e))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_the_file_it_could_not_write() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("absent").join("out.csv");
        assert!(
            matches!(write_atomically(&path, b"x"), Err(DatasetError::Unusable { file, .. }) if file == path)
        );
        assert!(matches!(write_atomically(dir.path(), b"x"), Err(DatasetError::Unusable { .. })));
        assert!(check_writable(&path).is_err() && check_writable(dir.path()).is_err());
        assert_eq!(check_writable(&dir.path().join("new.csv")), Ok(()));
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}
