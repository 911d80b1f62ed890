//! Poses as matrices.

use nalgebra::Isometry3;
use numpy::PyUntypedArrayMethods;
use prehend_refine::Hypotheses;
use pyo3::prelude::*;

use crate::arrays::{Numbers, in_order};
use crate::error::{Raise, wrong};

/// The pose of a matrix of 4 × 4, whose rotation may be off by rounding.
pub(super) fn pose(array: &Numbers<'_>, what: &str) -> PyResult<Isometry3<f64>> {
    match array.shape() {
        [4, 4] => pose_of(&in_order(array), what),
        shape => Err(wrong(format!("{what}: a matrix of 4 × 4 is expected, not {shape:?}"))),
    }
}

/// The pose of a matrix's sixteen numbers.
fn pose_of(numbers: &[f64], what: &str) -> PyResult<Isometry3<f64>> {
    let rows = <&[f64; 16]>::try_from(numbers).raise()?;
    prehend_refine::data::pose_from_matrix(rows).map_err(|e| wrong(format!("{what}: {e}")))
}

/// A pose, 4 × 4, without alternatives; or the first of poses of n × 4 × 4, and the others.
pub(super) fn hypotheses(array: &Numbers<'_>) -> PyResult<Hypotheses> {
    if array.shape().len() != 3 {
        return Ok(pose(array, "pose")?.into());
    }
    let mut poses = poses(array, "pose")?.into_iter();
    let best = poses.next().ok_or_else(|| wrong("pose: there is none"))?;
    Ok(Hypotheses { best, alternatives: Some(poses.collect()) })
}

/// Poses in an array of n × 4 × 4.
pub(super) fn poses(array: &Numbers<'_>, what: &str) -> PyResult<Vec<Isometry3<f64>>> {
    match array.shape() {
        [_, 4, 4] => {
            let numbers = in_order(array);
            let each = numbers.chunks(16).enumerate();
            each.map(|(k, numbers)| pose_of(numbers, &format!("{what}[{k}]"))).collect()
        }
        // An empty list.
        [0] => Ok(Vec::new()),
        shape => Err(wrong(format!("{what}: an array of n × 4 × 4 is expected, not {shape:?}"))),
    }
}
