//! All that is known of each frame, as a table for programs of statistics: [`write_details`].
//!
//! A table has a row a frame and named columns, each of numbers or texts, of one shape in all rows. Files are NumPy archives (`.npz`) and,
//! with the feature `parquet`, Parquet (`.parquet`). `docs/EXPORT.md` lists the columns.

mod column;
mod frame;
mod npz;
#[cfg(feature = "parquet")]
mod parquet;

use std::path::Path;

pub use column::{TableColumn, Values};
pub use frame::{FrameDetails, TrackDetails, details_table};

use super::bop::{DatasetError, write_atomically};

/// A format of tables, by the extension of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DetailsFormat {
    /// A NumPy archive, `.npz`: an array a column, with a row a frame along its first axis.
    Npz,
    /// Parquet, `.parquet`: arrays of a row are flat lists, row-major.
    #[cfg(feature = "parquet")]
    Parquet,
}

impl DetailsFormat {
    /// The format of the file `path`.
    ///
    /// # Errors
    /// [`DatasetError::Unusable`] if the extension is of none, or of one that needs a feature this build is without.
    pub fn of(path: &Path) -> Result<Self, DatasetError> {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        let problem = match extension.to_ascii_lowercase().as_str() {
            "npz" => return Ok(Self::Npz),
            #[cfg(feature = "parquet")]
            "parquet" => return Ok(Self::Parquet),
            #[cfg(not(feature = "parquet"))]
            "parquet" => {
                "this build writes no Parquet: cargo install --path crates/refine --features parquet, or write .npz"
            }
            _ => "the extension is neither .npz (NumPy) nor .parquet (Parquet)",
        };
        Err(DatasetError::writing(path, problem))
    }
}

/// Writes the table of `frames` to `path`, in the format that its extension names. The file appears whole or not at all, and its bytes depend on the frames
/// alone.
///
/// # Errors
/// Those of [`DetailsFormat::of`], and [`DatasetError::Unusable`].
pub fn write_details(path: &Path, frames: &[FrameDetails]) -> Result<(), DatasetError> {
    let columns = details_table(frames);
    let content = match DetailsFormat::of(path)? {
        DetailsFormat::Npz => npz::archive(&columns).map_err(|e| DatasetError::writing(path, e)),
        #[cfg(feature = "parquet")]
        DetailsFormat::Parquet => {
            parquet::file(&columns).map_err(|e| DatasetError::writing(path, e))
        }
    };
    write_atomically(path, &content?)
}
