//! State of a problem: named blocks of parameters.

use nalgebra::{DVector, Isometry3, Point3, UnitQuaternion, Vector3, Vector6};
use prehend_autodiff::lie::{perturb_about, so3_log};

use crate::error::RefineError;

use crate::scene::{CameraCalibrationError, Frame, Object, PreparedFrame, ViewCalibrationError};

/// A named block of a [`State`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Block {
    /// The object's pose: a left twist about its center, in the camera frame \[m; rad\].
    ObjectPose,
    /// The hand's base pose: a left twist about the object's center, in the camera frame \[m; rad\].
    ///
    /// About the object's center because that is where an error of the camera–hand calibration acts.
    HandPose,
    /// So many joint positions of the hand \[rad or m\].
    Joints(usize),
    /// How the camera differs from what is said of it: see [`CameraCalibrationError`].
    Camera,
    /// How another camera, so many after the first, differs from what is said of it: see [`ViewCalibrationError`].
    View(usize),
}

impl Block {
    /// Number of parameters.
    pub fn dimension(self) -> usize {
        match self {
            Self::ObjectPose | Self::HandPose => 6,
            Self::Joints(count) => count,
            Self::Camera => CameraCalibrationError::DIMENSION,
            Self::View(_) => ViewCalibrationError::DIMENSION,
        }
    }
}

/// A point in the space that factors are functions of.
#[derive(Clone, Debug)]
pub struct State {
    /// Object coordinates → camera coordinates \[m\].
    pub t_cam_object: Isometry3<f64>,
    /// Center of the object's bounding box, in object coordinates \[m\].
    pub object_center: Point3<f64>,
    /// Hand base coordinates → camera coordinates \[m\].
    pub t_cam_hand: Isometry3<f64>,
    /// Joint positions of the hand \[rad or m\]; none without a hand.
    pub joints: Vec<f64>,
    /// Calibration error of the camera.
    pub camera: CameraCalibrationError,
    /// Calibration errors of the other cameras, whether or not they see the object.
    pub views: Vec<ViewCalibrationError>,
}

impl State {
    /// The state that a refinement of `initial` (object → camera \[m\]) begins with: everything else is where `frame` measured it.
    ///
    /// # Errors
    /// If the pose is not finite, or behind the camera.
    pub fn new(frame: &PreparedFrame<'_>, initial: &Isometry3<f64>) -> Result<Self, RefineError> {
        Self::measured(frame.observation(), frame.object(), initial)
    }

    /// State of an object in `observation` at the pose `initial`; everything else is where it was measured.
    ///
    /// # Errors
    /// See [`new`](Self::new).
    pub(crate) fn measured(
        observation: &Frame,
        object: &Object,
        initial: &Isometry3<f64>,
    ) -> Result<Self, RefineError> {
        let rotation = initial.rotation.coords.iter();
        if !rotation.chain(initial.translation.vector.iter()).all(|v| v.is_finite()) {
            return Err(RefineError::NotFinite);
        }
        let hand = observation.hand.as_ref();
        let state = Self {
            t_cam_object: Isometry3::from_parts(
                initial.translation,
                UnitQuaternion::new_normalize(*initial.rotation.quaternion()),
            ),
            object_center: object.center,
            t_cam_hand: hand.map_or_else(Isometry3::identity, |h| h.t_cam_hand),
            joints: hand.map_or_else(Vec::new, |h| h.joints.clone()),
            camera: CameraCalibrationError::default(),
            views: vec![ViewCalibrationError::default(); observation.views.len()],
        };
        let depth = state.center().z;
        if depth <= 0.0 {
            return Err(RefineError::BehindCamera { depth });
        }
        Ok(state)
    }

    /// The object's center in the camera frame \[m\]: the point that twists turn about.
    pub fn center(&self) -> Vector3<f64> {
        (self.t_cam_object * self.object_center).coords
    }

    /// All its blocks: object, hand, joints, camera, other cameras.
    pub(crate) fn blocks(&self) -> Vec<Block> {
        let first =
            [Block::ObjectPose, Block::HandPose, Block::Joints(self.joints.len()), Block::Camera];
        first.into_iter().chain((0..self.views.len()).map(Block::View)).collect()
    }

    /// The object's pose with another rotation, its center where it is.
    pub(crate) fn rotated_to(&self, rotation: &UnitQuaternion<f64>) -> Isometry3<f64> {
        let origin = self.center() - rotation * self.object_center.coords;
        Isometry3::from_parts(origin.into(), *rotation)
    }

    /// How far the calibrations are from those `said`: displacement of the point that is said to be at the object's center and rotation
    /// vector of the hand \[m; rad\], joints, camera, other cameras.
    pub(crate) fn calibration_deviation(&self, said: &Self) -> DVector<f64> {
        let center = said.center();
        let motion = self.t_cam_hand * said.t_cam_hand.inverse();
        let off = (motion * Point3::from(center)).coords - center;
        let turn = so3_log(&motion.rotation);
        let joints = self.joints.iter().zip(&said.joints).map(|(q, said)| q - said);
        let camera = self.camera.parameters().into_iter().zip(said.camera.parameters());
        let hand = off.iter().chain(&turn).copied();
        let views = self.views.iter().zip(&said.views);
        let views = views.flat_map(|(is, said)| is.parameters().into_iter().zip(said.parameters()));
        let cameras = camera.chain(views).map(|(is, said)| is - said);
        let all: Vec<f64> = hand.chain(joints).chain(cameras).collect();
        DVector::from_vec(all)
    }

    /// The state after a step of the tangent space of `blocks`, their parts of `delta` one after the other; twists are about
    /// [`center`](Self::center).
    ///
    /// # Panics
    /// If `delta` is shorter than the blocks together.
    pub fn retract(&self, blocks: &[Block], delta: &[f64]) -> Self {
        let mut state = self.clone();
        let center = self.center();
        let mut rest = delta;
        for &block in blocks {
            let (part, others) = rest.split_at(block.dimension());
            rest = others;
            let pose = match block {
                Block::ObjectPose => &mut state.t_cam_object,
                Block::HandPose => &mut state.t_cam_hand,
                Block::Joints(_) => {
                    state.joints.iter_mut().zip(part).for_each(|(joint, change)| *joint += change);
                    continue;
                }
                Block::Camera => {
                    state.camera = state.camera.changed(part);
                    continue;
                }
                Block::View(k) => {
                    state.views[k] = state.views[k].changed(part);
                    continue;
                }
            };
            *pose = perturb_about(pose, &center, &Vector6::from_column_slice(part));
            // Thousands of small steps must not let the quaternion drift off the unit sphere.
            pose.rotation.renormalize();
        }
        state
    }
}
