//! Rendering and the loss of a pose, as functions of arrays with their derivatives.

mod camera;
mod image;
mod inputs;
pub(crate) mod light;
mod mesh;
mod mode;
pub(crate) mod pose;
pub(crate) mod pose_loss;
pub(crate) mod pullback;
pub(crate) mod renderer;
mod scenes;

use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// A named tuple of Python's module `prehend.render`.
fn named<'py>(
    py: Python<'py>,
    name: &str,
    fields: impl pyo3::call::PyCallArgs<'py> + IntoPyObject<'py, Target = PyTuple>,
) -> PyResult<Bound<'py, PyAny>> {
    py.import("prehend.render")?.getattr(name)?.call1(fields)
}
