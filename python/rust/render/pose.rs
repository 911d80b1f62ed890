//! Poses as matrices of 4 × 4, and derivatives by them.

use nalgebra::{
    Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3, Vector6,
};
use numpy::PyArray;
use numpy::ndarray::IxDyn;
use prehend_autodiff::lie::perturb_about;
use pyo3::prelude::*;

use super::inputs::{Input, batch_of};
use crate::arrays::{Numbers, array};
use crate::error::wrong;

/// Shape of a pose.
pub(super) const SHAPE: [usize; 2] = [4, 4];

/// How far the columns of a rotation may be from orthonormal: what single precision leaves of a product of many.
const ORTHONORMAL: f64 = 1e-4;

/// The pose of a matrix, whose rotation is the nearest one to its upper left block.
pub(super) fn pose(rows: &[f64], what: &str) -> PyResult<Isometry3<f64>> {
    let mut rotation = Matrix3::from_fn(|i, j| rows[4 * i + j]);
    let off = (rotation * rotation.transpose() - Matrix3::identity()).amax();
    let last = rows[12..].iter().zip([0.0, 0.0, 0.0, 1.0]).map(|(a, b)| (a - b).abs());
    let translation = Vector3::new(rows[3], rows[7], rows[11]);
    let proper = off < ORTHONORMAL
        && rotation.determinant() > 0.0
        && last.fold(0.0, f64::max) < ORTHONORMAL
        && translation.iter().all(|x| x.is_finite());
    if !proper {
        return Err(wrong(format!("{what}: the matrix is no rotation and translation")));
    }
    // Newton's iteration for the polar factor (Higham, "Computing the polar decomposition with applications", 1986): the error is squared
    // each time.
    for _ in 0..4 {
        let Some(inverse) = rotation.try_inverse() else { break };
        rotation = 0.5 * (rotation + inverse.transpose());
    }
    let rotation =
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    Ok(Isometry3::from_parts(Translation3::from(translation), rotation))
}

/// Derivatives by the entries of the matrix of `pose`, row by row, from those by a left twist about `center` (camera frame \[m\]).
///
/// For a change dR of the rotation, the nearest rotation turns by the axial vector ω of (dR Rᵀ − R dRᵀ) / 2; so a torque τ about the origin
/// of the object, τ·ω, is [τ]× R / 2 by R. The last row has no influence.
pub(super) fn by_matrix(
    twist: &Vector6<f64>,
    pose: &Isometry3<f64>,
    center: &Point3<f64>,
) -> [f64; 16] {
    let force = Vector3::new(twist[0], twist[1], twist[2]);
    let torque = Vector3::new(twist[3], twist[4], twist[5])
        + (center.coords - pose.translation.vector).cross(&force);
    let by_rotation = 0.5 * torque.cross_matrix() * pose.rotation.to_rotation_matrix().into_inner();
    let mut rows = [0.0; 16];
    for i in 0..3 {
        (0..3).for_each(|j| rows[4 * i + j] = by_rotation[(i, j)]);
        rows[4 * i + 3] = force[i];
    }
    rows
}

/// A pose (4 × 4, or a batch of them), moved by a twist from the left: the first three numbers translate [m], the last three turn about `center`
/// [rad], along the axes of the frame that the pose maps into. `center` is a point in that frame [m], the origin if none is given. Gradients and Gauss–Newton
/// matrices by poses are those by this twist at zero.
#[pyfunction]
#[pyo3(signature = (pose, twist, center=None))]
pub(crate) fn perturb<'py>(
    py: Python<'py>,
    pose: Numbers<'py>,
    twist: Numbers<'py>,
    center: Option<Numbers<'py>>,
) -> PyResult<Bound<'py, PyArray<f64, IxDyn>>> {
    let poses = Input::new(&pose, &SHAPE, "pose")?;
    let twists = Input::new(&twist, &[6], "twist")?;
    let centers = center.as_ref().map(|c| Input::new(c, &[3], "center")).transpose()?;
    let batch = batch_of(&[
        ("pose", poses.batch()),
        ("twist", twists.batch()),
        ("center", centers.as_ref().and_then(Input::batch)),
    ])?;
    let mut all = Vec::new();
    for k in 0..batch.unwrap_or(1) {
        let center =
            centers.as_ref().map_or(Vector3::zeros(), |c| Vector3::from_column_slice(c.of(k)));
        let twist = Vector6::from_column_slice(twists.of(k));
        let moved = perturb_about(&self::pose(poses.of(k), "pose")?, &center, &twist);
        all.extend(moved.to_homogeneous().transpose().iter());
    }
    array(py, all, &batch.into_iter().chain(SHAPE).collect::<Vec<_>>())
}
