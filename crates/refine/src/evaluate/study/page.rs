//! The page of a study.

use std::path::{Path, PathBuf};

use super::record::{Record, TRUTH};
use crate::data::bop::DatasetError;
use crate::evaluate::metrics::Table;
use crate::evaluate::report::{Column, FrameReport, Report};

/// The metrics of the table of frames by their place in [`Record::metrics`], with the factor of their unit.
const METRICS: [(Column, usize, f64); 6] = [
    (Column::new("error", "error", "mm", 2), 0, 10.0),
    (Column::new("turned-error", "orientation error", "°", 2), 2, 1.0),
    (Column::new("adi", "ADI", "mm", 2), 4, 1.0),
    (Column::new("mssd", "MSSD", "mm", 2), 5, 1.0),
    (Column::new("contact", "|ΔCA|", "cm²", 2), 9, 1.0),
    (Column::new("volume", "|ΔIV|", "cm³", 2), 10, 1.0),
];

/// Writes the page of a study to a folder and returns its path: its tables, and all poses.
///
/// # Errors
/// If it cannot be written.
pub fn write_page(
    folder: &Path,
    title: &str,
    tables: Vec<(String, Table)>,
    records: &[Record],
) -> Result<PathBuf, DatasetError> {
    let mut report = Report::create(folder, title)?;
    report.add_fact("version", env!("CARGO_PKG_VERSION"));
    for (title, table) in tables {
        let (headings, rows) = table.into_parts();
        report.add_table(&title, headings, rows);
    }
    for record in records.iter().filter(|record| record.key.method != TRUTH) {
        let value = |metric: usize, factor: f64| Some(factor * record.metrics[metric]?);
        let figure = |(column, metric, factor)| (column, value(metric, factor));
        let failed = (!record.is_scored()).then(|| record.status.clone());
        let frame = FrameReport {
            name: record.frame_label(),
            status: record.key.label(),
            flags: failed.iter().map(|_| "failed".to_owned()).collect(),
            remarks: failed.into_iter().collect(),
            figures: METRICS.map(figure).into(),
            posterior: None,
            drawing: None,
        };
        report.add_frame(frame);
    }
    report.finish()
}
