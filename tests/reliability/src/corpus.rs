//! Right files of each kind to begin with, and those that once were handled wrongly.

use std::path::{Path, PathBuf};
use std::{fs, io};

/// Where the files are.
pub fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus")
}

/// The files of a parser in the order of their names: what it reads rightly, or that was found to break it (`NAME.broken`).
///
/// # Errors
/// If they cannot be read.
pub fn files(parser: &str) -> io::Result<Vec<(PathBuf, Vec<u8>)>> {
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder().join(parser))? {
        paths.push(entry?.path());
    }
    paths.sort();
    paths.into_iter().map(|path| Ok((path.clone(), fs::read(path)?))).collect()
}
