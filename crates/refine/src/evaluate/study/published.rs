//! Published figures.
//!
//! Source: the tables of "Geometrically Plausible Object Pose Refinement using Differentiable Simulation"; means over
//! grasps of nine YCB objects (the steps: of the mustard bottle) with an Allegro hand, simulated by the authors.

use super::kind::Kind;
use crate::evaluate::metrics::COLUMNS;

/// Means in the order of [`COLUMNS`]; what is not published is `None`.
pub(super) type Published = [Option<f64>; COLUMNS.len()];

/// A row: studies, level, name, and the means of some metrics. `python/studies` reads it, too.
const ROWS: &str = include_str!("published.csv");

/// The published means of the row `label` of a study at a level of noise (`low` and `high` are the paper's).
pub(super) fn published(study: Kind, level: &str, label: &str) -> Option<Published> {
    let mut rows = ROWS.lines().map(|row| row.split(',').collect::<Vec<_>>());
    let columns = rows.next()?;
    let study = study.to_string();
    let is_it = |row: &Vec<&str>| {
        row[0].split(' ').any(|own| own == study) && (row[1], row[2]) == (level, label)
    };
    let row = rows.find(is_it)?;
    let of = |metric: &str| row[columns.iter().position(|column| *column == metric)?].parse().ok();
    Some(COLUMNS.map(of))
}

#[cfg(test)]
mod tests {
    use super::*;
    use Kind::{Main, Noise, Steps};

    #[test]
    fn deviations_agree_with_the_truth_and_the_gains_with_the_abstract() {
        let mut count = 0;
        for study in [Kind::Main, Kind::Gradients, Noise, Steps] {
            for level in ["low", "high"] {
                let names =
                    study.methods().into_iter().chain(["truth", "initial"].map(str::to_owned));
                let steps = [100, 200, 400, 600, 1000].map(|n| format!("{n} steps"));
                for label in names.chain(steps) {
                    let Some(means) = published(study, level, &label) else { continue };
                    count += 1;
                    let [ca, iv, delta_ca, delta_iv] = [7, 8, 9, 10].map(|k| means[k]);
                    assert!(ca.is_some() && iv.is_some());
                    let Some((delta_ca, delta_iv)) = delta_ca.zip(delta_iv) else {
                        assert_eq!(study, Steps);
                        continue;
                    };
                    assert!(((ca.unwrap() - 36.28).abs() - delta_ca).abs() < 0.011, "{label}");
                    assert!(((iv.unwrap() - 0.17).abs() - delta_iv).abs() < 0.011, "{label}");
                }
            }
        }
        // Of the 27 rows three are in three studies, and two in two.
        assert_eq!((count, ROWS.lines().count()), (27 + 3 * 2 + 2, 28));
        let of = |level, row| published(Noise, level, row).unwrap();
        for (level, expected) in [("low", [-5.0, -4.0, -73.0]), ("high", [-34.0, -14.0, -88.0])] {
            for (column, expected) in [0, 1, 10].into_iter().zip(expected) {
                let [before, after] =
                    ["initial", "combined"].map(|row| of(level, row)[column].unwrap());
                assert!(
                    (100.0 * (after / before - 1.0) - expected).abs() < 1.0,
                    "{level} {column}"
                );
            }
        }
        assert_eq!(COLUMNS[7..11], ["CA cm²", "IV cm³", "|ΔCA| cm²", "|ΔIV| cm³"]);
        assert!(published(Main, "low", "guess").is_none());
    }
}
