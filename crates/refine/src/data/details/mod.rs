//! All that is known of each frame, as a table for programs of statistics: [`write_details`].
//!
//! A table has a row a frame and named columns, each of numbers, flags or texts, of one shape in all rows. Files are NumPy archives (`.npz`) and,
//! with the feature `parquet`, Parquet (`.parquet`). `docs/EXPORT.md` lists the columns.

mod column;
mod format;
mod frame;
mod npy;
mod npz;
#[cfg_attr(not(feature = "parquet"), path = "no_parquet.rs")]
mod parquet;

use std::path::Path;

pub use column::{Column, Values};
pub use format::DetailsFormat;
pub use frame::{FrameDetails, TrackDetails, details_table};

use super::bop::{DatasetError, write_atomically};

/// Writes the table of `frames` to `path`, in the format that its extension names. The file appears whole or not at all, and its bytes depend on the frames
/// alone.
///
/// # Errors
/// Those of [`DetailsFormat::of`], and [`DatasetError::Write`].
pub fn write_details(path: &Path, frames: &[FrameDetails]) -> Result<(), DatasetError> {
    let format = DetailsFormat::of(path)?;
    let columns = details_table(frames);
    let content = match format {
        DetailsFormat::Npz => npz::archive(&columns).map_err(|e| DatasetError::writing(path, e)),
        DetailsFormat::Parquet => {
            parquet::file(&columns).map_err(|e| DatasetError::writing(path, e))
        }
    };
    write_atomically(path, &content?)
}
