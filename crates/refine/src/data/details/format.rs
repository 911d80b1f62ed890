//! The formats of tables.

use std::path::Path;

use super::parquet;
use crate::data::bop::DatasetError;

/// A format of tables, by the extension of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DetailsFormat {
    /// A NumPy archive, `.npz`: an array a column, with a row a frame along its first axis.
    Npz,
    /// Parquet, `.parquet`: arrays of a row are flat lists, row-major.
    Parquet,
}

impl DetailsFormat {
    /// The format of the file `path`.
    ///
    /// # Errors
    /// [`DatasetError::Write`] if the extension is of none, or of one that needs a feature this build is without.
    pub fn of(path: &Path) -> Result<Self, DatasetError> {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        match extension.to_ascii_lowercase().as_str() {
            "npz" => Ok(Self::Npz),
            "parquet" => match parquet::MISSING {
                None => Ok(Self::Parquet),
                Some(why) => Err(DatasetError::writing(path, why)),
            },
            _ => {
                let problem = "the extension is neither .npz (NumPy) nor .parquet (Parquet)";
                Err(DatasetError::writing(path, problem))
            }
        }
    }
}
