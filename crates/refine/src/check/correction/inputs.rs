//! Inputs of a frame that a correction may change.

use nalgebra::{Isometry3, Quaternion, UnitQuaternion};
use prehend_render::Camera;

use super::kind::Correction;

/// A frame's inputs but for its images, lengths in units of the model as it was read.
#[derive(Clone, Copy, Debug)]
pub(super) struct CheckInputs {
    pub(super) camera: Camera,
    /// Object → camera.
    pub(super) t_cam_object: Isometry3<f64>,
    /// Depth over that of the image.
    pub(super) depth_scale: f64,
    /// True if pixels that are not masked are the object's.
    pub(super) mask_inverted: bool,
    /// Meters of a unit of length.
    pub(super) meters: f64,
    /// The translation is not known.
    pub(super) is_placed: bool,
}

impl CheckInputs {
    pub(super) fn new(camera: Camera, t_cam_object: Isometry3<f64>) -> Self {
        Self {
            camera,
            t_cam_object,
            depth_scale: 1.0,
            mask_inverted: false,
            meters: 1.0,
            is_placed: true,
        }
    }

    /// With the translation `factor` times as long.
    fn moved(mut self, factor: f64) -> Self {
        self.t_cam_object.translation.vector *= factor;
        self
    }

    /// With the model `factor` times as large.
    fn sized(self, factor: f64) -> Self {
        let Self { depth_scale, meters, .. } = self;
        Self {
            depth_scale: depth_scale / factor,
            meters: meters * factor,
            ..self.moved(factor.recip())
        }
    }

    fn turned(mut self, rotation: UnitQuaternion<f64>) -> Self {
        self.t_cam_object.rotation = rotation;
        self
    }

    /// With axes of graphics engines (x right, y up, z back) made those of the camera.
    fn flipped(self) -> Self {
        // Half a turn about x.
        let t_cv_gl = UnitQuaternion::new_unchecked(Quaternion::new(0.0, 1.0, 0.0, 0.0));
        Self { t_cam_object: t_cv_gl * self.t_cam_object, ..self }
    }

    fn seen_by(self, camera: Camera) -> Self {
        Self { camera, ..self }
    }

    /// With a correction, whose factor is `value`.
    pub(super) fn corrected(self, correction: Correction, value: f64) -> Self {
        use Correction::*;
        let Self { camera, t_cam_object: pose, .. } = self;
        let Camera { fx, fy, cx, cy, width, height } = camera;
        let q = pose.rotation.into_inner().coords;
        let inverse = Self { t_cam_object: pose.inverse(), ..self };
        let quaternion = |w, x, y, z| UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
        match correction {
            PoseUnit => self.moved(value),
            ModelUnit | ModelScale => self.sized(value),
            ModelAndPoseUnit => self.moved(value).sized(value),
            DepthUnit | DepthScale => Self { depth_scale: self.depth_scale * value, ..self },
            PoseInverted => inverse,
            PoseInvertedOpenGl => inverse.flipped(),
            RotationTransposed => self.turned(pose.rotation.inverse()),
            // (x, y, z, w) was read as (w, x, y, z), and the other way round.
            QuaternionXyzw => self.turned(quaternion(q.z, q.w, q.x, q.y)),
            QuaternionWxyz => self.turned(quaternion(q.x, q.y, q.z, q.w)),
            OpenGlAxes => self.flipped(),
            OpenGlRotation => self.turned(self.flipped().t_cam_object.rotation),
            PrincipalPointSwapped => self.seen_by(Camera { cx: cy, cy: cx, ..camera }),
            CameraOfOtherSize => self.seen_by(Camera { width, height, ..camera.scaled(value) }),
            FocalLength => self.seen_by(Camera { fx: fx * value, fy: fy * value, ..camera }),
            MaskInverted => Self { mask_inverted: !self.mask_inverted, ..self },
            Translation => Self { is_placed: false, ..self },
            ChannelsSwapped | Rotation => self,
        }
    }
}
