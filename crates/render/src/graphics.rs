//! Poses and cameras as graphics engines have them: glam's types, and cameras that look along −z with y up.
//!
//! Bevy, rend3 and most programs on wgpu keep transforms in glam's [`Mat4`], [`Affine3A`], [`Quat`] and [`Vec3`], and project with a
//! matrix of the frustum. [`ModelView`] converts poses, [`Camera::from_perspective`] cameras. (Vectors,
//! rotations and matrices by themselves convert between glam and nalgebra with `From`, in the same axes. Types of another version of glam
//! than 0.33, which is re-exported as `prehend_render::glam`, go through their arrays, such as `to_cols_array`.)
//!
//! ```
//! use glam::camera::rh::{proj::directx::perspective, view::look_at_affine3a};
//! use glam::{Affine3A, Quat, Vec3};
//! use prehend_render::{Camera, ModelView};
//!
//! # fn main() -> Result<(), prehend_render::MatrixError> {
//! let projection = perspective(0.8, 640.0 / 480.0, 0.01, 10.0);
//! let camera = Camera::from_perspective(&projection, 640, 480)?;
//! let view = look_at_affine3a(Vec3::new(0.3, 0.2, 0.5), Vec3::ZERO, Vec3::Y);
//! let model = Affine3A::from_rotation_translation(Quat::from_rotation_y(0.4), Vec3::X * 0.05);
//! let t_cam_model = ModelView::try_from(view * model)?.t_cam_model;
//! // The model's origin is in front of the camera, to the right of where it looks.
//! let seen = camera.project(&t_cam_model.translation.vector.into());
//! assert!(seen.is_some_and(|uv| uv.x > 319.5));
//! # Ok(())
//! # }
//! ```

use glam::{Affine3A, DMat3, DMat4, DQuat, DVec3, Mat4, Quat, Vec3};
use nalgebra::{Isometry3, Quaternion, UnitQuaternion};

use crate::camera::{Camera, CameraError};

/// A matrix is taken as rigid if its columns are orthonormal to this: a thousand roundings of single precision.
const RIGID: f64 = 1e-4;

/// A model's pose in the view space of a graphics engine (x right, y up, z back): what its model-view matrix says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelView {
    /// Pose, model to camera frame of this crate (x right, y down, z forward) \[m\].
    pub t_cam_model: Isometry3<f64>,
}

/// Why a matrix is no pose or no camera.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MatrixError {
    /// An entry is infinite or not a number.
    #[error("entry of row {row}, column {column} is {value}, expected a finite number")]
    NotFinite {
        /// From 0.
        row: usize,
        /// From 0.
        column: usize,
        /// The entry.
        value: f32,
    },
    /// The matrix scales, shears or mirrors: poses are rigid. Scale the mesh instead.
    #[error(
        "matrix is not a rigid transform (its columns are orthonormal to {deviation:.1e} only, or it mirrors)"
    )]
    NotRigid {
        /// Largest entry of |RᵀR − 1|.
        deviation: f64,
    },
    /// The last row of a pose is not (0, 0, 0, 1), or that of a projection not (0, 0, −1, 0).
    #[error("last row is {found:?}, expected {expected:?}")]
    LastRow {
        /// The row.
        found: [f32; 4],
        /// As it should be.
        expected: [f32; 4],
    },
    /// The projection also shifts what it projects: it holds (a part of) a view matrix, or is one eye's of a pair.
    #[error("projection shifts points by ({x}, {y}) before it projects them; expected no shift")]
    Shifted {
        /// Along the image's rows, in clip space.
        x: f32,
        /// Along its columns.
        y: f32,
    },
    /// The projection is skewed, or its camera is none of this crate.
    #[error(transparent)]
    Camera(#[from] CameraError),
}

impl ModelView {
    fn in_view(t_view_model: Isometry3<f64>) -> Self {
        Self { t_cam_model: half_turn() * t_view_model }
    }
}

/// Turns the axes of one side into those of the other: half a turn about x.
fn half_turn() -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(0.0, 1.0, 0.0, 0.0))
}

fn check(matrix: &Mat4, last: [f32; 4]) -> Result<(), MatrixError> {
    let entries = matrix.to_cols_array();
    if let Some(at) = entries.iter().position(|v| !v.is_finite()) {
        return Err(MatrixError::NotFinite { row: at % 4, column: at / 4, value: entries[at] });
    }
    let found = matrix.row(3).to_array();
    let same = found.iter().zip(last).all(|(a, b)| (a - b).abs() <= RIGID as f32);
    same.then_some(()).ok_or(MatrixError::LastRow { found, expected: last })
}

impl TryFrom<Mat4> for ModelView {
    type Error = MatrixError;

    fn try_from(matrix: Mat4) -> Result<Self, MatrixError> {
        check(&matrix, [0.0, 0.0, 0.0, 1.0])?;
        let matrix = matrix.as_dmat4();
        let columns = DMat3::from_mat4(matrix);
        let deviation = (columns.transpose() * columns - DMat3::IDENTITY).to_cols_array();
        let deviation = deviation.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        if deviation > RIGID || columns.determinant() < 0.0 {
            return Err(MatrixError::NotRigid { deviation });
        }
        Ok(Self::in_view((matrix.w_axis.truncate(), DQuat::from_mat3(&columns)).into()))
    }
}

impl TryFrom<Affine3A> for ModelView {
    type Error = MatrixError;

    fn try_from(affine: Affine3A) -> Result<Self, MatrixError> {
        Mat4::from(affine).try_into()
    }
}

/// A translation, and a rotation, which is normalized; one of length zero, or not finite, gives a pose that is not finite.
impl From<(Vec3, Quat)> for ModelView {
    fn from((translation, rotation): (Vec3, Quat)) -> Self {
        Self::in_view((translation.as_dvec3(), rotation.as_dquat()).into())
    }
}

impl From<ModelView> for Mat4 {
    fn from(pose: ModelView) -> Self {
        DMat4::from(half_turn() * pose.t_cam_model).as_mat4()
    }
}

impl From<ModelView> for Affine3A {
    fn from(pose: ModelView) -> Self {
        Self::from_mat4(pose.into())
    }
}

impl From<ModelView> for (Vec3, Quat) {
    fn from(pose: ModelView) -> Self {
        let (translation, rotation): (DVec3, DQuat) = (half_turn() * pose.t_cam_model).into();
        (translation.as_vec3(), rotation.as_quat())
    }
}

impl Camera {
    /// The camera of `width` by `height` pixels with this projection, whatever it makes of depth (reversed or infinite too).
    ///
    /// # Errors
    /// When the matrix is not finite, no perspective of a right-handed view space, skewed or shifted, or the
    /// image is empty.
    pub fn from_perspective(
        projection: &Mat4,
        width: usize,
        height: usize,
    ) -> Result<Self, MatrixError> {
        check(projection, [0.0, 0.0, -1.0, 0.0])?;
        let (x, y) = (projection.w_axis.x, projection.w_axis.y);
        if x.abs().max(y.abs()) > RIGID as f32 {
            return Err(MatrixError::Shifted { x, y });
        }
        let matrix = projection.as_dmat4();
        let (half_width, half_height) = (0.5 * width as f64, 0.5 * height as f64);
        let k = [
            matrix.x_axis.x * half_width,
            matrix.y_axis.x * half_width,
            (1.0 - matrix.z_axis.x) * half_width - 0.5,
            matrix.x_axis.y * half_height,
            matrix.y_axis.y * half_height,
            (1.0 + matrix.z_axis.y) * half_height - 0.5,
            0.0,
            0.0,
            1.0,
        ];
        Ok(Self::from_k(k, width, height)?)
    }
}
