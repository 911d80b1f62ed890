//! All that is known of each frame, as a table for programs of statistics: [`write_details`].
//!
//! A table has a row a frame and named columns, each of numbers or texts, of one shape in all rows. Files are NumPy archives (`.npz`) and,
//! with the feature `parquet`, Parquet (`.parquet`). `docs/EXPORT.md` lists the columns.

mod column;
mod frame;
mod npz;
#[cfg(feature = "parquet")]
mod parquet;

use std::error::Error;
use std::path::Path;

pub use frame::{FrameDetails, TrackDetails};

use column::TableColumn;
use frame::details_table;

use super::bop::{DatasetError, write_atomically};

/// Content of a file of these columns.
type Encoder = fn(&[TableColumn]) -> Result<Vec<u8>, Box<dyn Error>>;

/// Encoder of the format that the extension of `path` names: a NumPy archive has an array a column, with a row a frame along its first axis; in Parquet, arrays
/// of a row are flat lists, row-major.
fn encoder(path: &Path) -> Result<Encoder, DatasetError> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    let problem = match extension.to_ascii_lowercase().as_str() {
        "npz" => return Ok(npz::archive),
        #[cfg(feature = "parquet")]
        "parquet" => return Ok(parquet::file),
        #[cfg(not(feature = "parquet"))]
        "parquet" => {
            "this build writes no Parquet: cargo install --path crates/refine --features parquet, or write .npz"
        }
        _ => "the extension is neither .npz (NumPy) nor .parquet (Parquet)",
    };
    Err(DatasetError::writing(path, problem))
}

/// Refuses a file whose extension names no format of tables, to know before long work.
///
/// # Errors
/// If the extension is of none, or of one that needs a feature this build is without.
pub fn check_format(path: &Path) -> Result<(), DatasetError> {
    encoder(path).map(drop)
}

/// Writes the table of `frames` to `path`, in the format that its extension names. The file appears whole or not at all, and its bytes depend on the frames
/// alone.
///
/// # Errors
/// Those of [`check_format`], and if it cannot be written.
pub fn write_details(path: &Path, frames: &[FrameDetails]) -> Result<(), DatasetError> {
    let content = encoder(path)?(&details_table(frames));
    write_atomically(path, &content.map_err(|e| DatasetError::writing(path, e))?)
}
