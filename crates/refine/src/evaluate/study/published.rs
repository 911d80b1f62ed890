//! Published figures.
//!
//! Source: the tables of "Geometrically Plausible Object Pose Refinement using Differentiable Simulation"; means over
//! grasps of nine YCB objects (the steps: of the mustard bottle) with an Allegro hand, simulated by the authors.

use super::kind::Kind;
use crate::evaluate::metrics::COLUMNS;

/// Means in the order of [`COLUMNS`]; what is not published is `None`.
pub(super) type Published = [Option<f64>; COLUMNS.len()];

/// A row: studies, level, name, and PE, OE, CA, IV, |ΔCA|, |ΔIV|.
type Row = (&'static [Kind], &'static str, &'static str, [f64; 6]);

/// Not published.
const NONE: f64 = f64::NAN;
use Kind::{Gradients, Main, Noise, Steps};

#[rustfmt::skip]
const ROWS: [Row; 27] = [
    (&[Main, Gradients, Noise], "low", "truth", [NONE, NONE, 36.28, 0.17, 0.0, 0.0]),
    (&[Main, Gradients, Noise], "low", "initial", [0.65, 6.98, 39.05, 2.36, 2.77, 2.19]),
    (&[Main], "low", "icp", [3.46, 43.01, 65.26, 28.73, 28.98, 28.56]),
    (&[Main], "low", "icp-best", [1.30, 13.77, 48.31, 8.71, 12.03, 8.54]),
    (&[Main, Gradients, Noise], "low", "combined", [0.62, 6.69, 41.73, 0.76, 5.45, 0.59]),
    (&[Main], "high", "truth", [NONE, NONE, 36.28, 0.17, 0.0, 0.0]),
    (&[Main, Noise], "high", "initial", [2.21, 15.25, 61.34, 21.57, 25.06, 21.40]),
    (&[Main], "high", "icp", [3.65, 42.55, 61.08, 26.10, 24.80, 25.93]),
    (&[Main], "high", "icp-best", [2.53, 23.29, 55.87, 19.57, 19.59, 19.40]),
    (&[Main, Noise], "high", "combined", [1.45, 13.14, 42.65, 2.80, 6.37, 2.63]),
    (&[Gradients], "low", "depth", [2.54, 8.72, 54.52, 14.31, 18.24, 14.14]),
    (&[Gradients], "low", "tactile", [3.24, 9.51, 90.63, 32.68, 54.35, 32.51]),
    (&[Gradients], "low", "rendering", [0.85, 6.65, 43.99, 3.60, 7.71, 3.43]),
    (&[Gradients], "low", "physics", [1.26, 6.59, 39.01, 1.26, 2.73, 1.09]),
    (&[Gradients], "low", "physics-best", [0.78, 7.62, 43.06, 0.62, 6.78, 0.45]),
    (&[Steps], "low", "initial", [0.65, 6.44, 47.10, 2.00, NONE, NONE]),
    (&[Steps], "low", "100", [0.80, 5.88, 40.65, 0.12, NONE, NONE]),
    (&[Steps], "low", "200", [0.92, 5.97, 40.21, 0.08, NONE, NONE]),
    (&[Steps], "low", "400", [1.06, 6.50, 40.30, 0.06, NONE, NONE]),
    (&[Steps], "low", "600", [1.13, 7.08, 40.01, 0.06, NONE, NONE]),
    (&[Steps], "low", "1000", [1.32, 8.41, 40.48, 0.06, NONE, NONE]),
    (&[Steps], "high", "initial", [2.31, 15.15, 73.06, 27.55, NONE, NONE]),
    (&[Steps], "high", "100", [1.75, 13.74, 47.85, 1.80, NONE, NONE]),
    (&[Steps], "high", "200", [1.73, 13.17, 44.23, 0.95, NONE, NONE]),
    (&[Steps], "high", "400", [1.73, 12.42, 42.13, 0.54, NONE, NONE]),
    (&[Steps], "high", "600", [1.72, 12.02, 40.88, 0.36, NONE, NONE]),
    (&[Steps], "high", "1000", [1.74, 11.85, 40.33, 0.22, NONE, NONE]),
];

/// The published means of a row of a study at a level of noise (`low` and `high` are the paper's).
pub(super) fn published(study: Kind, level: &str, row: &str) -> Option<Published> {
    let (.., values) = ROWS.iter().find(|r| r.0.contains(&study) && (r.1, r.2) == (level, row))?;
    let [pe, oe, ca, iv, delta_ca, delta_iv] = values.map(|v| (!v.is_nan()).then_some(v));
    Some([pe, oe, None, None, None, None, None, ca, iv, delta_ca, delta_iv, None, None])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviations_agree_with_the_truth_and_the_gains_with_the_abstract() {
        for (studies, level, row, [.., ca, iv, delta_ca, delta_iv]) in ROWS {
            if !studies.contains(&Steps) {
                assert!(((ca - 36.28).abs() - delta_ca).abs() < 0.011, "{level} {row}");
                assert!(((iv - 0.17).abs() - delta_iv).abs() < 0.011, "{level} {row}");
            }
        }
        let of = |level, row| published(Noise, level, row).unwrap();
        for (level, expected) in [("low", [-5.0, -4.0, -73.0]), ("high", [-34.0, -14.0, -88.0])] {
            for (column, expected) in [0, 1, 10].into_iter().zip(expected) {
                let (before, after) =
                    (of(level, "initial")[column].unwrap(), of(level, "combined")[column].unwrap());
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
