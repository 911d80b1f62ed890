//! Folders of a dataset in the making.

use std::fs;
use std::path::Path;

use crate::data::bop::DatasetError;

/// Makes the folder and those above it, where they are absent.
pub(super) fn make(folder: &Path) -> Result<(), DatasetError> {
    fs::create_dir_all(folder).map_err(|e| fault(folder, &e))
}

/// Removes the folder with all it holds, if it is there.
pub(super) fn remove(folder: &Path) -> Result<(), DatasetError> {
    match fs::remove_dir_all(folder) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(fault(folder, &e)),
        _ => Ok(()),
    }
}

/// Removes what was being written in the folder when a process ended: such files are hidden and end in `.tmp`.
pub(super) fn sweep(folder: &Path) -> Result<(), DatasetError> {
    let Ok(entries) = fs::read_dir(folder) else { return Ok(()) };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name.starts_with('.') && name.ends_with(".tmp") {
            fs::remove_file(entry.path()).map_err(|e| fault(&entry.path(), &e))?;
        }
    }
    Ok(())
}

pub(super) fn fault(path: &Path, error: &std::io::Error) -> DatasetError {
    DatasetError::Write { file: path.to_owned(), problem: error.to_string() }
}
