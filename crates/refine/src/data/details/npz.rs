//! Columns as a NumPy archive: a ZIP file of `.npy` files, stored as they are.

use std::io::{Cursor, Write};

use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use super::column::Column;
use super::npy;

/// The content of the file. Entries have no time, so that the same columns are the same bytes.
pub(super) fn archive(columns: &[Column]) -> Result<Vec<u8>, ZipError> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .last_modified_time(DateTime::default());
    for column in columns.iter().filter(|column| column.width() > 0) {
        archive.start_file(format!("{}.npy", column.name), options)?;
        archive.write_all(&npy::array(column))?;
    }
    Ok(archive.finish()?.into_inner())
}
