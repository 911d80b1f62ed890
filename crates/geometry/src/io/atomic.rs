//! Atomic writes: a reader sees the old file or the new one.

use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Writes `content` to a new file beside `path` and gives it that name, replacing what was there: no reader ever sees
/// half a file.
///
/// # Errors
/// The error of the operating system; a file that was there before is then unchanged, and no other is left.
pub fn write_atomic(path: &Path, content: &[u8]) -> io::Result<()> {
    AtomicFile::write(path, content)?.commit()
}

/// Content written under a temporary name in the target's folder; dropped without [`AtomicFile::commit`],
/// it vanishes.
pub(super) struct AtomicFile {
    temporary: PathBuf,
    target: PathBuf,
}

impl AtomicFile {
    /// Writes `content` beside `target` and brings it to disk.
    pub(super) fn write(target: &Path, content: &[u8]) -> io::Result<Self> {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        let name = target
            .file_name()
            .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "no file name"))?;
        let unique =
            format!(".{}-{}.tmp", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed));
        let mut hidden = std::ffi::OsString::from(".");
        hidden.push(name);
        hidden.push(unique);
        let temporary = target.with_file_name(hidden);
        let mut file: File = OpenOptions::new().write(true).create_new(true).open(&temporary)?;
        let whole = Self { temporary, target: target.into() };
        file.write_all(content)?;
        file.sync_all()?;
        Ok(whole)
    }

    /// Gives the file its name, replacing what was there.
    pub(super) fn commit(self) -> io::Result<()> {
        std::fs::rename(&self.temporary, &self.target)
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        // After a commit the temporary name is gone and this finds nothing to remove.
        let _ = std::fs::remove_file(&self.temporary);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_left_without_a_commit() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a.bin");
        drop(AtomicFile::write(&target, b"x").unwrap());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        write_atomic(&target, b"a much longer first version").unwrap();
        write_atomic(&target, b"second").unwrap();
        assert_eq!(std::fs::read(&target).unwrap(), b"second");
        assert!(write_atomic(&folder.path().join("no/a.bin"), b"y").is_err());
        // A folder in the way stops the rename.
        let taken = folder.path().join("taken");
        std::fs::create_dir(&taken).unwrap();
        assert!(write_atomic(&taken, b"y").is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }
}
