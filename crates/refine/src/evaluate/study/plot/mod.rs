//! Plots of a study, as SVG documents.

mod bars;
mod cumulative;
mod faults;
mod page;
mod reliability;
mod steps;

use std::collections::BTreeMap;

use super::design::Design;
use super::kind::Kind;
use super::record::FrameRecord;
use super::tables::Tables;

/// File names and documents.
pub(super) fn plots(
    design: &Design,
    tables: &Tables,
    records: &BTreeMap<usize, FrameRecord>,
) -> Vec<(String, Result<String, String>)> {
    let mut out = Vec::new();
    for table in tables.overall() {
        let level = &table.level;
        if tables.study == Kind::Robustness {
            // The rows are too many for one plot; there is one a sweep instead.
            for &sweep in &design.sweeps {
                let name = format!("{sweep}-{level}.svg");
                out.push((name, faults::draw(design, tables, table, sweep)));
            }
            continue;
        }
        out.push((format!("means-{level}.svg"), bars::draw(tables, table)));
        out.push((format!("cumulative-{level}.svg"), cumulative::draw(tables, table, records)));
    }
    for calibration in &tables.calibrations {
        let level = calibration.level.as_deref().unwrap_or("all");
        let name = format!("reliability-{level}-{}.svg", calibration.method);
        out.push((name, reliability::draw(tables, calibration, records)));
    }
    if tables.study == Kind::Steps {
        out.push(("steps.svg".into(), steps::draw(tables)));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::study::tables::tests::example;

    #[test]
    fn every_plot_is_a_document_with_its_rows_and_failures() {
        let (design, records) = example();
        let tables = Tables::new(&design, &records);
        let drawn = plots(&design, &tables, &records);
        let names: Vec<&str> = drawn.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(
            names,
            ["means-low.svg", "cumulative-low.svg", "means-high.svg", "cumulative-high.svg"]
        );
        for (name, svg) in &drawn {
            let svg = svg.as_ref().unwrap();
            assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
            for word in ["initial", "combined", "icp", "PE cm", "|ΔIV| cm³"] {
                assert!(svg.contains(word), "{name}: {word}");
            }
            assert_eq!(svg.contains("failed"), name.contains("low"), "{name}");
            assert!(!svg.contains("NaN"));
        }
    }
}
