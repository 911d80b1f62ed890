//! Shards of a study put together.

use std::path::{Path, PathBuf};

use thiserror::Error;

use super::design::{Design, Shard};
use super::output::RECORDS;
use super::record::{FrameRecord, Records};
use crate::data::bop::DatasetError;
use crate::data::{Identity, Journal};

/// Why shards do not make a study.
#[derive(Debug, Error)]
pub enum MergeError {
    /// The records of a shard cannot be read.
    #[error(transparent)]
    Journal(#[from] DatasetError),
    /// The shards are not those of one study, or not all of them.
    #[error("{0}")]
    Shards(String),
}

/// Facts in which shards of one study may differ: where they ran, and which part they are.
const FREE: [&str; 2] = ["dataset", "shard"];

/// The whole study that shards in `folders` make: its design and its records.
///
/// # Errors
/// If a folder holds no records, or they are of different studies, or frames are missing.
pub fn merge(folders: &[PathBuf]) -> Result<(Design, Records), MergeError> {
    let mut first: Option<(PathBuf, Identity, Design)> = None;
    let mut records = Records::new();
    let mut shards = Vec::new();
    for folder in folders {
        let file = folder.join(RECORDS);
        let (identity, found) = Journal::read::<FrameRecord>(&file)?;
        let design = design(&file, &identity)?;
        shards.push(format!("{}: {}", folder.display(), design.shard));
        for (index, record) in found {
            // Of two attempts at a frame, the one that succeeded.
            if records.get(&index).is_none_or(FrameRecord::failed) {
                records.insert(index, record);
            }
        }
        if let Some((one, known, _)) = &first {
            let differences = known.differences(&identity, &FREE);
            if !differences.is_empty() {
                return Err(MergeError::Shards(format!(
                    "{} and {} are of different studies:\n  {}",
                    one.display(),
                    file.display(),
                    differences.join("\n  ")
                )));
            }
        } else {
            first = Some((file, identity, design));
        }
    }
    let (.., mut design) =
        first.ok_or_else(|| MergeError::Shards("no shards were given".into()))?;
    design.shard = Shard::WHOLE;
    let frames = design.frames();
    let missing: Vec<usize> = (0..frames).filter(|index| !records.contains_key(index)).collect();
    match missing.first() {
        None => Ok((design, records)),
        Some(first) => Err(MergeError::Shards(format!(
            "{} of {frames} frames are in none of the shards, the first is frame {first} ({})",
            missing.len(),
            shards.join(", ")
        ))),
    }
}

fn design(file: &Path, identity: &Identity) -> Result<Design, MergeError> {
    let design = serde_json::to_value(identity).and_then(serde_json::from_value);
    let problem = || format!("{}: not the records of a study", file.display());
    design.map_err(|_| MergeError::Shards(problem()))
}
