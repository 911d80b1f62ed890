//! Files that appear whole or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use super::error::DatasetError;

/// Writes `contents` to a new file beside `path` and renames it to `path`, replacing what was there.
///
/// # Errors
/// [`DatasetError::Write`] naming `path`; a file that was there before is then unchanged.
pub fn write_atomically(path: &Path, contents: &[u8]) -> Result<(), DatasetError> {
    let fail =
        |e: io::Error| DatasetError::Write { file: path.to_path_buf(), problem: e.to_string() };
    if path.is_dir() {
        return Err(fail(io::Error::other("is a folder")));
    }
    let (mut file, temporary) = create_beside(path).map_err(fail)?;
    let written = file.write_all(contents).and_then(|()| file.sync_all());
    drop(file);
    written.and_then(|()| fs::rename(&temporary, path)).map_err(|e| {
        // The first failure is the one to report; a leftover that cannot be removed adds nothing to it.
        let _ = fs::remove_file(&temporary);
        fail(e)
    })
}

/// Whether [`write_atomically`] could write `path` now, to know before long work; leaves nothing behind.
///
/// # Errors
/// [`DatasetError::Write`] naming `path`.
pub fn check_writable(path: &Path) -> Result<(), DatasetError> {
    let fail =
        |e: io::Error| DatasetError::Write { file: path.to_path_buf(), problem: e.to_string() };
    if path.is_dir() {
        return Err(fail(io::Error::other("is a folder")));
    }
    let (_, temporary) = create_beside(path).map_err(fail)?;
    fs::remove_file(temporary).map_err(fail)
}

/// A new hidden file in the folder of `path`: a rename is atomic only within one file system.
fn create_beside(path: &Path) -> io::Result<(File, PathBuf)> {
    static SERIAL: AtomicU32 = AtomicU32::new(0);
    let name = path.file_name().ok_or_else(|| io::Error::other("the path names no file"))?;
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    if let Some(folder) = folder.filter(|p| !p.is_dir()) {
        return Err(io::Error::other(format!("there is no folder {}", folder.display())));
    }
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(name);
    hidden.push(format!(".{}-{}.tmp", std::process::id(), SERIAL.fetch_add(1, Ordering::Relaxed)));
    let temporary = path.with_file_name(hidden);
    let file = OpenOptions::new().write(true).create_new(true).open(&temporary)?;
    Ok((file, temporary))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replaces_the_whole_file_and_leaves_no_other() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("out.csv");
        write_atomically(&path, b"a much longer first version").unwrap();
        write_atomically(&path, b"second").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn names_the_file_it_could_not_write() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("absent").join("out.csv");
        assert!(
            matches!(write_atomically(&path, b"x"), Err(DatasetError::Write { file, .. }) if file == path)
        );
        assert!(matches!(write_atomically(dir.path(), b"x"), Err(DatasetError::Write { .. })));
        let told = check_writable(&path).unwrap_err();
        assert_eq!(Err(told), write_atomically(&path, b"x"));
        assert!(check_writable(dir.path()).is_err());
        assert_eq!(check_writable(&dir.path().join("new.csv")), Ok(()));
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}
