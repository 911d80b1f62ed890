//! Estimates, as Python's dataclasses.

use nalgebra::Isometry3;
use prehend_refine::Refined;
use prehend_refine::strategy::{Posterior, PosteriorSummary};
use prehend_refine::tracker::Tracked;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{array, matrix};
use crate::threads::detached;

/// Calls the dataclass of that name in `prehend.refinement`.
fn dataclass<'py>(name: &str, fields: &Bound<'py, PyDict>) -> PyResult<Bound<'py, PyAny>> {
    let module = fields.py().import("prehend.refinement")?;
    module.getattr(name)?.call((), Some(fields))
}

/// Puts what a posterior says among the `fields`, or None where there is none.
fn describe(fields: &Bound<'_, PyDict>, posterior: Option<&Posterior>) -> PyResult<()> {
    let py = fields.py();
    let Some(posterior) = posterior else {
        for name in ["covariance", "probability"] {
            fields.set_item(name, py.None())?;
        }
        return fields.set_item("modes", Vec::<f64>::new());
    };
    let covariance = posterior.covariance().as_slice().to_vec();
    // Symmetric: the order of rows and columns is all the same.
    fields.set_item("covariance", array(py, covariance, &[6, 6])?)?;
    fields.set_item("probability", posterior.probability())?;
    let modes = posterior.modes.iter();
    let modes = modes.map(|h| Ok((matrix(py, &h.t_cam_object)?, h.weight)));
    fields.set_item("modes", modes.collect::<PyResult<Vec<_>>>()?)
}

/// An `Estimate`, of a refinement that began at `initial`.
pub(super) fn estimate<'py>(
    py: Python<'py>,
    refined: &Refined<'_>,
    initial: &Isometry3<f64>,
) -> PyResult<Bound<'py, PyAny>> {
    let fields = PyDict::new(py);
    let (found, posterior) = (&refined.estimate, refined.estimate.posterior.as_ref());
    fields.set_item("pose", matrix(py, found.t_cam_object())?)?;
    describe(&fields, posterior)?;
    let warnings = detached(py, || refined.input.warnings(initial).concat())?;
    let warnings: Vec<String> = warnings.iter().map(ToString::to_string).collect();
    fields.set_item("warnings", warnings)?;
    fields.set_item("iterations", found.trace.iterations.len().saturating_sub(1))?;
    if let Some(summary) = posterior.map(PosteriorSummary::from) {
        fields.set_item("fit", summary.fit)?;
        fields.set_item("misfits", summary.misfits)?;
        fields.set_item("inconsistencies", summary.inconsistencies)?;
        fields.set_item("scales", summary.scales)?;
        fields.set_item("model_scale", summary.model_scale)?;
        let unobservable: Vec<f64> = summary.unobservable_mm.iter().map(|mm| 1e-3 * mm).collect();
        fields.set_item("unobservable", unobservable)?;
        fields.set_item("termination", summary.termination)?;
    }
    dataclass("Estimate", &fields)
}

/// A `Tracked`.
pub(super) fn tracked<'py>(py: Python<'py>, tracked: &Tracked) -> PyResult<Bound<'py, PyAny>> {
    let fields = PyDict::new(py);
    fields.set_item("pose", matrix(py, &tracked.t_cam_object)?)?;
    describe(&fields, tracked.posterior.as_ref())?;
    fields.set_item("status", tracked.status.name())?;
    fields.set_item("rejection", tracked.rejection.map(|rejection| rejection.to_string()))?;
    fields.set_item("iterations", tracked.iterations)?;
    fields.set_item("seconds", tracked.timing.total().as_secs_f64())?;
    dataclass("Tracked", &fields)
}
