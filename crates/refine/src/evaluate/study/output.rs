//! What a study leaves in its folder.

use std::path::{Path, PathBuf};

use super::csv::{calibration_csv, csv};
use super::design::Design;
use super::document::{markdown, text};
use super::page::write_page;
use super::plot::plots;
use super::record::Records;
use super::tables::{Failure, Tables};
use crate::data::bop::{DatasetError, write_atomically};

/// The journal of a study, in order once it is complete: what `merge` reads.
pub const RECORDS: &str = "records.jsonl";
/// Seconds by frame and method.
pub const TIMES: &str = "times.csv";

/// Writes the tables (`tables.txt`, `.md`, `.csv`, `.json`, and `calibration.csv` where something was believed) and the plots (`*.svg`) of a study to a folder, and all of
/// it as a page to the folder `report` if that is given, and returns what failed, and the files.
///
/// # Errors
/// If a file cannot be written; each appears whole or not at all.
pub fn write_outputs(
    folder: &Path,
    design: &Design,
    records: &Records,
    report: Option<&Path>,
) -> Result<(Vec<Failure>, Vec<PathBuf>), DatasetError> {
    let tables = Tables::new(design, records);
    let json = serde_json::to_string_pretty(&tables).map_err(|e| e.to_string());
    let mut outputs: Vec<(String, Result<Vec<u8>, String>)> = vec![
        ("tables.txt".into(), Ok(text(&tables).into_bytes())),
        ("tables.md".into(), Ok(markdown(&tables).into_bytes())),
        ("tables.csv".into(), csv(&tables).map_err(|e| e.to_string())),
        ("tables.json".into(), json.map(|json| (json + "\n").into_bytes())),
    ];
    if !tables.calibrations.is_empty() {
        let bytes = calibration_csv(&tables.calibrations).map_err(|e| e.to_string());
        outputs.push(("calibration.csv".into(), bytes));
    }
    let plots = plots(design, &tables, records);
    let drawn = plots.iter().filter_map(|(name, svg)| Some((name.clone(), svg.clone().ok()?)));
    let drawn: Vec<(String, String)> = drawn.collect();
    outputs.extend(plots.into_iter().map(|(name, svg)| (name, svg.map(String::into_bytes))));
    let mut files = Vec::new();
    for (name, bytes) in outputs {
        let file = folder.join(name);
        let bytes = bytes.map_err(|problem| DatasetError::Write { file: file.clone(), problem })?;
        files.push((file, bytes));
    }
    for (file, bytes) in &files {
        write_atomically(file, bytes)?;
    }
    let mut files: Vec<PathBuf> = files.into_iter().map(|(file, _)| file).collect();
    if let Some(report) = report {
        files.push(write_page(report, (design, records), &tables, &drawn)?);
    }
    Ok((tables.failures, files))
}
