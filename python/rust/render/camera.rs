//! The pinhole camera.

use numpy::PyUntypedArrayMethods;
use prehend_render::Camera;
use pyo3::prelude::*;

use crate::arrays::{Numbers, in_order};
use crate::error::{Raise, wrong};

/// A camera from its matrix of 3 × 3 \[px\] and the size (rows, columns) of its images.
pub(super) fn camera(k: &Numbers<'_>, (rows, columns): (usize, usize)) -> PyResult<Camera> {
    let values = in_order(k);
    match (k.shape(), <[f64; 9]>::try_from(&*values)) {
        ([3, 3], Ok(k)) => Camera::from_k(k, columns, rows).raise(),
        (shape, _) => Err(wrong(format!("K: a matrix of 3 × 3 is expected, not {shape:?}"))),
    }
}

/// `camera` with other fx, fy, cx and cy \[px\]; unchanged without values.
pub(super) fn with_intrinsics(camera: &Camera, values: &[f64]) -> PyResult<Camera> {
    let [fx, fy, cx, cy] = *values else { return Ok(*camera) };
    let camera = Camera { fx, fy, cx, cy, ..*camera };
    camera.check().raise()?;
    Ok(camera)
}
