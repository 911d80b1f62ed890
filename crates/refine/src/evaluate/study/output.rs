//! What a study leaves in its folder.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::calibration;
use super::csv::csv;
use super::design::Design;
use super::document::{markdown, text};
use super::plot::plots;
use super::record::FrameRecord;
use super::tables::{Failure, Tables};
use crate::data::bop::{DatasetError, write_atomically};

/// The journal of a study, in order once it is complete: what `merge` reads.
pub const RECORDS: &str = "records.jsonl";
/// Seconds by frame and method.
pub const TIMES: &str = "times.csv";

/// Writes the tables (`tables.txt`, `.md`, `.csv`, `.json`, and `calibration.csv` where something was believed) and the plots (`*.svg`) of a study to a folder and returns what failed, and the files.
///
/// # Errors
/// If a file cannot be written; each appears whole or not at all.
pub fn write_outputs(
    folder: &Path,
    design: &Design,
    records: &BTreeMap<usize, FrameRecord>,
) -> Result<(Vec<Failure>, Vec<PathBuf>), DatasetError> {
    let tables = Tables::new(design, records);
    let fault = |file: &Path, problem: String| DatasetError::Write { file: file.into(), problem };
    let mut files: Vec<(PathBuf, Vec<u8>)> = vec![
        (folder.join("tables.txt"), text(&tables).into_bytes()),
        (folder.join("tables.md"), markdown(&tables).into_bytes()),
    ];
    let file = folder.join("tables.csv");
    let bytes = csv(&tables).map_err(|e| fault(&file, e.to_string()))?;
    files.push((file, bytes));
    let file = folder.join("tables.json");
    let json = serde_json::to_string_pretty(&tables).map_err(|e| fault(&file, e.to_string()))?;
    files.push((file, (json + "\n").into_bytes()));
    if !tables.calibrations.is_empty() {
        let file = folder.join("calibration.csv");
        let bytes =
            calibration::csv(&tables.calibrations).map_err(|e| fault(&file, e.to_string()))?;
        files.push((file, bytes));
    }
    for (name, plot) in plots(design, &tables, records) {
        let file = folder.join(name);
        let svg = plot.map_err(|e| fault(&file, e))?;
        files.push((file, svg.into_bytes()));
    }
    for (file, bytes) in &files {
        write_atomically(file, bytes)?;
    }
    Ok((tables.failures, files.into_iter().map(|(file, _)| file).collect()))
}
