//! What reports of several commands have in common.

use prehend_refine::evaluate::report::{Column, Figure};
use prehend_refine::strategy::PosteriorSummary;

const ERROR: Column = Column::new("error", "error", "mm", 2);
const TURN_ERROR: Column = Column::new("turned-error", "orientation error", "°", 2);
const PROBABILITY: Column = Column::new("probability", "probability", "", 3);
const SIGMA: Column = Column::new("sigma", "σ", "mm", 2);
const TURN_SIGMA: Column = Column::new("turned-sigma", "σ of rotation", "°", 2);
pub(crate) const MOVED: Column = Column::new("moved", "moved", "mm", 1);
pub(crate) const TURNED: Column = Column::new("turned", "turned", "°", 1);
pub(crate) const INITIAL_ERROR: Column = Column::new("initial-error", "error before", "mm", 1);
pub(crate) const INITIAL_TURN: Column =
    Column::new("initial-turned-error", "orientation error before", "°", 1);
pub(crate) const SECONDS: Column = Column::new("seconds", "time", "s", 3);
pub(crate) const ITERATIONS: Column = Column::new("iterations", "iterations", "", 0);
pub(crate) const MILLISECONDS: Column = Column::new("milliseconds", "time", "ms", 1);
pub(crate) const MOMENT: Column = Column::new("moment", "moment", "s", 2);

/// What is known of a pose by its error \[m, rad\], where the truth is known, and by how sure it is.
pub(crate) fn pose_figures(
    error: Option<[f64; 2]>,
    confidence: Option<&PosteriorSummary>,
) -> Vec<Figure> {
    let length = |sigmas: [f64; 3]| sigmas.iter().map(|s| s * s).sum::<f64>().sqrt();
    vec![
        (ERROR, error.map(|[meters, _]| 1e3 * meters)),
        (TURN_ERROR, error.map(|[_, radians]| radians.to_degrees())),
        (PROBABILITY, confidence.map(|c| c.probability)),
        (SIGMA, confidence.map(|c| length(c.deviation_mm))),
        (TURN_SIGMA, confidence.map(|c| length(c.deviation_deg))),
    ]
}

/// What speaks against a pose.
pub(crate) fn flags(confidence: &PosteriorSummary) -> Vec<String> {
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
