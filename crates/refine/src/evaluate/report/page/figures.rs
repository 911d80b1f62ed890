//! Figures and flags of poses, common to all reports.

use std::collections::BTreeSet;

use super::document::Column;
use crate::strategy::PosteriorSummary;

const ERROR: Column = Column::new("error", "error", "mm", 2);
const TURN_ERROR: Column = Column::new("turned-error", "orientation error", "°", 2);
const PROBABILITY: Column = Column::new("probability", "probability", "", 3);
const SIGMA: Column = Column::new("sigma", "σ", "mm", 2);
const TURN_SIGMA: Column = Column::new("turned-sigma", "σ of rotation", "°", 2);
pub(super) const MOVED: Column = Column::new("moved", "moved", "mm", 1);
pub(super) const TURNED: Column = Column::new("turned", "turned", "°", 1);
pub(super) const INITIAL_ERROR: Column = Column::new("initial-error", "error before", "mm", 1);
pub(super) const INITIAL_TURN: Column =
    Column::new("initial-turned-error", "orientation error before", "°", 1);
pub(super) const SECONDS: Column = Column::new("seconds", "time", "s", 3);
pub(super) const ITERATIONS: Column = Column::new("iterations", "iterations", "", 0);

/// Figures of a pose: its error \[m, rad\], where the truth is known, and how sure it is.
pub fn pose_figures(
    error: Option<[f64; 2]>,
    confidence: Option<&PosteriorSummary>,
) -> Vec<(Column, Option<f64>)> {
    let length = |sigmas: [f64; 3]| sigmas.iter().map(|s| s * s).sum::<f64>().sqrt();
    vec![
        (ERROR, error.map(|[meters, _]| 1e3 * meters)),
        (TURN_ERROR, error.map(|[_, radians]| radians.to_degrees())),
        (PROBABILITY, confidence.map(|c| c.probability)),
        (SIGMA, confidence.map(|c| length(c.deviation_mm))),
        (TURN_SIGMA, confidence.map(|c| length(c.deviation_deg))),
    ]
}

/// Flags of a pose, each naming something that speaks against it.
pub fn flags(confidence: &PosteriorSummary) -> Vec<String> {
    let rival = confidence.weights.iter().skip(1).any(|weight| *weight > 0.1);
    let known = [
        (confidence.probability < 0.5, "improbable"),
        (!confidence.misfits.is_empty(), "misfit"),
        (!confidence.inconsistencies.is_empty(), "inconsistency"),
        (rival, "ambiguous"),
        (!confidence.unobservable_mm.is_empty(), "unobservable direction"),
    ];
    known.iter().filter(|(is, _)| *is).map(|(_, flag)| (*flag).to_owned()).collect()
}

/// Frames that are drawn at most: pages stay small enough to be opened.
const DRAWN: usize = 200;

/// Numbers of the frames to draw: all, or those whose poses are the least probable.
pub fn least_sure(probabilities: impl Iterator<Item = f64>) -> BTreeSet<usize> {
    let mut all: Vec<(usize, f64)> = probabilities.enumerate().collect();
    all.sort_by(|(_, a), (_, b)| a.total_cmp(b));
    all.into_iter().take(DRAWN).map(|(number, _)| number).collect()
}
