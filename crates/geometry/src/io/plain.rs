//! Plain files: neither a pipe, which may never end, nor a device.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// As many links may lead to one another, as Linux has it.
const MOST_LINKS: usize = 40;

/// Opens a plain file for reading.
///
/// # Errors
/// The error of the operating system; [`io::ErrorKind::InvalidInput`] for what is no plain file.
pub fn open_plain(path: &Path) -> io::Result<File> {
    // Asked before opening, since opening a pipe waits for its other end.
    if !fs::metadata(path)?.is_file() {
        return Err(not_plain());
    }
    File::open(path)
}

/// The content of a plain file of at most `limit` bytes.
///
/// # Errors
/// Those of [`open_plain`]; [`io::ErrorKind::FileTooLarge`] beyond the limit.
pub fn read_plain(path: &Path, limit: usize) -> io::Result<Vec<u8>> {
    let too_large = |size: u64| {
        let message = format!("{size} bytes, more than the limit of {limit}");
        io::Error::new(io::ErrorKind::FileTooLarge, message)
    };
    let file = open_plain(path)?;
    let size = file.metadata()?.len();
    if size > limit as u64 {
        return Err(too_large(size));
    }
    let mut content = Vec::with_capacity(size as usize);
    // The file may grow in the meantime.
    file.take(limit as u64 + 1).read_to_end(&mut content)?;
    if content.len() > limit {
        return Err(too_large(content.len() as u64));
    }
    Ok(content)
}

/// Target of a write to `path`: the end of the symbolic links that begin there. It need not exist.
///
/// # Errors
/// [`io::ErrorKind::InvalidInput`] where something other than a plain file is in the way, or `path` names no file;
/// [`io::ErrorKind::TooManyLinks`] for links in a circle.
pub fn plain_target(path: &Path) -> io::Result<PathBuf> {
    // Where links lead that are no paths, as those of pipes, too.
    if fs::metadata(path).is_ok_and(|there| !there.is_file()) {
        return Err(not_plain());
    }
    let mut target = path.to_owned();
    for _ in 0..MOST_LINKS {
        if !target.is_symlink() {
            return match target.file_name() {
                Some(_) => Ok(target),
                None => Err(io::Error::new(io::ErrorKind::InvalidInput, "names no file")),
            };
        }
        let next = fs::read_link(&target)?;
        // Joining an absolute path replaces what is joined to.
        target = target.parent().unwrap_or(Path::new("")).join(next);
    }
    Err(io::Error::new(io::ErrorKind::TooManyLinks, "symbolic links in a circle"))
}

fn not_plain() -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, "not a plain file")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_plain_files_of_limited_size_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f");
        fs::write(&path, b"12345").unwrap();
        assert_eq!(read_plain(&path, 5).unwrap(), b"12345");
        assert_eq!(read_plain(&path, 4).unwrap_err().kind(), io::ErrorKind::FileTooLarge);
        assert!(read_plain(folder.path(), 100).is_err());
        #[cfg(unix)]
        assert!(read_plain(Path::new("/dev/zero"), 100).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn targets_are_at_the_end_of_links_and_plain() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("sub")).unwrap();
        symlink("sub/absent", at("a")).unwrap();
        symlink(at("a"), at("b")).unwrap();
        assert_eq!(plain_target(&at("b")).unwrap(), at("sub/absent"));
        assert_eq!(plain_target(&at("new")).unwrap(), at("new"));
        symlink("d", at("c")).unwrap();
        symlink("c", at("d")).unwrap();
        assert_eq!(plain_target(&at("c")).unwrap_err().kind(), io::ErrorKind::TooManyLinks);
        symlink("/dev/null", at("null")).unwrap();
        for other in [Path::new("/dev/null"), &at("null"), &at("sub"), &at("sub/..")] {
            assert!(plain_target(other).is_err(), "{}", other.display());
        }
    }
}
