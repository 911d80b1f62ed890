//! Plots of a study, as SVG documents.

mod bars;
mod cumulative;
mod faults;
mod page;
mod reliability;
mod steps;

use super::design::Design;
use super::kind::Kind;
use super::record::Records;
use super::tables::Tables;

/// File names and documents.
pub(super) fn plots(
    design: &Design,
    tables: &Tables,
    records: &Records,
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
    use crate::evaluate::study::calibration::ELLIPSOIDS;
    use crate::evaluate::study::calibration::tests::calibrated;
    use crate::evaluate::study::design::Trial;
    use crate::evaluate::study::posterior::EVENTS;
    use crate::evaluate::study::record::RowOutcome;
    use crate::evaluate::study::sweep::Sweep;
    use crate::evaluate::study::tables::tests::example;

    /// The plots of a study, each of which must be a document that has all `words`.
    fn drawn((design, records): &(Design, Records), words: &[&str]) -> Vec<(String, String)> {
        let check = |(name, svg): (String, Result<String, String>)| {
            let svg = svg.unwrap();
            assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
            assert!(!svg.contains("NaN"), "{name}");
            let lacking: Vec<_> = words.iter().filter(|word| !svg.contains(**word)).collect();
            assert!(lacking.is_empty(), "{name}: {lacking:?}");
            (name, svg)
        };
        let plots = plots(design, &Tables::new(design, records), records);
        plots.into_iter().map(check).collect()
    }

    #[test]
    fn every_plot_has_its_rows_and_failures() {
        let drawn = drawn(&example(), &["initial", "combined", "robust-icp", "PE cm", "|ΔIV| cm³"]);
        let names: Vec<&str> = drawn.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(
            names,
            ["means-low.svg", "cumulative-low.svg", "means-high.svg", "cumulative-high.svg"]
        );
        for (name, svg) in &drawn {
            assert_eq!(svg.contains("failed"), name.contains("low"), "{name}");
        }
    }

    #[test]
    fn every_sweep_has_a_plot_that_says_what_failed() {
        let (mut design, mut records) = example();
        design.study = Kind::Robustness;
        design.sweeps = vec![Sweep::Visibility, Sweep::MissingDepth];
        for record in records.values_mut() {
            let like = |trial: &Trial| RowOutcome {
                row: trial.rows[0].clone(),
                ..record.outcome(&trial.method).unwrap().clone()
            };
            let made: Vec<RowOutcome> = design.trials().iter().map(like).collect();
            record.outcomes.truncate(2);
            record.outcomes.extend(made);
        }
        let drawn =
            drawn(&(design, records), &["combined", "robust-icp", "mean PE cm", "median OE °"]);
        let names: Vec<&str> = drawn.iter().map(|(name, _)| name.as_str()).collect();
        let levels = ["low", "high"].map(|level| {
            ["visibility", "missing-depth"].map(|sweep| format!("{sweep}-{level}.svg"))
        });
        assert_eq!(names, levels.concat());
        for (name, svg) in &drawn {
            assert_eq!(svg.contains("robust-icp failed: 2 at"), name.contains("low"), "{name}");
        }
    }

    #[test]
    fn every_level_has_a_diagram_with_all_events_and_ellipsoids() {
        let drawn = drawn(&calibrated(30), &[]);
        for level in ["low", "high", "all"] {
            let name = format!("reliability-{level}-combined.svg");
            let (_, svg) = drawn.iter().find(|(n, _)| *n == name).unwrap();
            for event in &EVENTS {
                assert!(svg.contains(&format!("{} (ECE", event.name)), "{}", event.name);
            }
            for (name, _) in ELLIPSOIDS {
                assert!(svg.contains(&format!("{name} (χ²")), "{name}");
            }
        }
    }
}
