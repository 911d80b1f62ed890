//! Atomic writes: a reader sees the old file or the new one.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use super::plain::plain_target;

/// Writes `content` to a new file beside `path` and gives it that name, replacing what was there: no reader ever sees
/// half a file.
///
/// # Errors
/// Those of [`AtomicFile`]; a file that was there before is then unchanged, and no other is left.
pub fn write_atomic(path: &Path, content: &[u8]) -> io::Result<()> {
    AtomicFile::write(path, content)?.commit()
}

/// A file that takes its name when it is whole: until [`AtomicFile::commit`] it has a hidden one in the same folder, and
/// dropped before, it vanishes.
///
/// A symbolic link stays one, and what it leads to is replaced; permissions of a file that is replaced are kept.
#[derive(Debug)]
pub struct AtomicFile {
    temporary: PathBuf,
    target: PathBuf,
    file: File,
}

impl AtomicFile {
    /// An empty file that will be at `path`.
    ///
    /// # Errors
    /// The error of the operating system; [`io::ErrorKind::InvalidInput`] where something that is no plain file is there.
    pub fn create(path: &Path) -> io::Result<Self> {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        let target = plain_target(path)?;
        loop {
            let mut hidden = OsString::from(".");
            hidden.push(target.file_name().unwrap_or_default());
            let number = NEXT.fetch_add(1, Ordering::Relaxed);
            hidden.push(format!(".{}-{number}.tmp", std::process::id()));
            let temporary = target.with_file_name(hidden);
            let file = match OpenOptions::new().write(true).create_new(true).open(&temporary) {
                // Of a process of the same number that was killed.
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists => continue,
                opened => opened?,
            };
            // Where there are no permissions, or others, the file is as good.
            #[cfg(unix)]
            if let Ok(replaced) = fs::metadata(&target) {
                let _ = file.set_permissions(replaced.permissions());
            }
            return Ok(Self { temporary, target, file });
        }
    }

    /// A file with that content, all of it.
    ///
    /// # Errors
    /// Those of [`AtomicFile::create`].
    pub(super) fn write(path: &Path, content: &[u8]) -> io::Result<Self> {
        let mut whole = Self::create(path)?;
        whole.file.write_all(content)?;
        Ok(whole)
    }

    /// Brings what was written to disk and gives the file its name, replacing what was there.
    ///
    /// # Errors
    /// The error of the operating system; what was there before is then unchanged.
    pub fn commit(self) -> io::Result<()> {
        self.file.sync_all()?;
        fs::rename(&self.temporary, &self.target)
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl io::Seek for AtomicFile {
    fn seek(&mut self, to: io::SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        // After a commit the temporary name is gone and this finds nothing to remove.
        let _ = fs::remove_file(&self.temporary);
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
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        write_atomic(&target, b"a much longer first version").unwrap();
        write_atomic(&target, b"second").unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"second");
        assert!(write_atomic(&folder.path().join("no/a.bin"), b"y").is_err());
        let taken = folder.path().join("taken");
        fs::create_dir(&taken).unwrap();
        assert!(write_atomic(&taken, b"y").is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[cfg(unix)]
    #[test]
    fn links_stay_links_and_devices_devices() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let (target, link) = (folder.path().join("target"), folder.path().join("link"));
        symlink("target", &link).unwrap();
        write_atomic(&link, b"new").unwrap();
        fs::set_permissions(&target, PermissionsExt::from_mode(0o600)).unwrap();
        write_atomic(&link, b"newer").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&target).unwrap(), b"newer");
        assert_eq!(fs::metadata(&target).unwrap().permissions().mode() & 0o777, 0o600);
        assert_eq!(
            write_atomic(Path::new("/dev/null"), b"x").unwrap_err().kind(),
            io::ErrorKind::InvalidInput
        );
        let pipe = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
        assert!(made.success());
        assert!(
            write_atomic(&pipe, b"x").is_err() && super::super::plain::open_plain(&pipe).is_err()
        );
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
    }
}
