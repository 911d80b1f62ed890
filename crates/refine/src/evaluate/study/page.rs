//! The page of a study.

use std::path::{Path, PathBuf};

use super::design::Design;
use super::document::{Body, row_label, sections};
use super::kind::TRUTH;
use super::record::{FrameRecord, Records, RowOutcome};
use super::tables::Tables;
use crate::data::bop::DatasetError;
use crate::evaluate::metrics::PoseScore;
use crate::evaluate::report::{Column, FrameReport, Report};

/// A metric of a frame: its column, and its value.
type Metric = (Column, fn(&PoseScore) -> Option<f64>);

const fn metric(
    key: &'static str,
    name: &'static str,
    unit: &'static str,
    value: fn(&PoseScore) -> Option<f64>,
) -> Metric {
    (Column { key, name, unit, digits: 2 }, value)
}

/// The metrics of the table of frames.
const METRICS: [Metric; 6] = [
    metric("error", "error", "mm", |s| s.pe_cm.map(|cm| 10.0 * cm)),
    metric("turned-error", "turned wrong", "°", |s| s.oe_symmetric_deg),
    metric("adi", "ADI", "mm", |s| s.adi_mm),
    metric("mssd", "MSSD", "mm", |s| s.mssd_mm),
    metric("contact", "|ΔCA|", "cm²", |s| s.delta_ca_cm2),
    metric("volume", "|ΔIV|", "cm³", |s| s.delta_iv_cm3),
];

/// Writes the page of a study to a folder and returns its path: tables, plots with their names, and all poses, by frame.
pub(super) fn write_page(
    folder: &Path,
    (design, records): (&Design, &Records),
    tables: &Tables,
    plots: &[(String, String)],
) -> Result<PathBuf, DatasetError> {
    let mut report = Report::create(folder, tables.study.title())?;
    report.add_fact("dataset", design.dataset.clone());
    report.add_fact("frames", records.len().to_string());
    report.add_fact("version", env!("CARGO_PKG_VERSION"));
    for (name, svg) in plots {
        report.add_svg(name.trim_end_matches(".svg"), svg);
    }
    for (title, body) in sections(tables) {
        match body {
            Body::Table(table) => {
                let (headings, rows) = table.into_parts();
                report.add_table(&title, headings, rows);
            }
            Body::List(lines) => {
                report.add_table(&title, [""], lines.into_iter().map(|line| vec![line]).collect());
            }
        }
    }
    for record in records.values() {
        let outcomes = record.outcomes.iter().filter(|outcome| outcome.row != TRUTH);
        outcomes.for_each(|outcome| report.add_frame(row(design, record, outcome), None));
    }
    report.finish()
}

/// What a method has made of a frame.
fn row(design: &Design, record: &FrameRecord, outcome: &RowOutcome) -> FrameReport {
    let value = |(column, value): Metric| column.figure(outcome.score.as_ref().and_then(value));
    FrameReport {
        name: record.label(),
        status: row_label(design.study, &outcome.row),
        flags: outcome.failed.iter().map(|_| "failed".to_owned()).collect(),
        remarks: outcome.failed.iter().cloned().collect(),
        figures: METRICS.map(value).into(),
        posterior: None,
    }
}
