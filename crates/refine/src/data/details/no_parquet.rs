//! What stands for Parquet in builds without it.

use super::column::Column;

/// Why there is none.
pub(super) const MISSING: Option<&str> = Some(
    "this build writes no Parquet: cargo install --path crates/refine --features parquet, or write .npz",
);

/// Is never asked for: no path has the format.
pub(super) fn file(_: &[Column]) -> Result<Vec<u8>, &'static str> {
    Err("this build writes no Parquet")
}
