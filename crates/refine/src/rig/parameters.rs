//! Calibration parameters of a rig.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, UnitQuaternion, Vector3};
use prehend_autodiff::lie::{cross_matrix, so3_log};
use prehend_render::Camera;
use serde::{Deserialize, Serialize};

use crate::error::RefineError;
use crate::factor::PriorSettings;
use crate::problem::{Block, ImageWarp, RADIAL, State, radial_as_camera};
use crate::scene::{CameraCalibrationError, RemapCache, SurfaceDeviation};

/// Standard deviations of what changes from frame to frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Play {
    /// Standard deviation of the hand's place in each direction \[m\].
    #[serde(rename = "hand_translation_m")]
    pub hand_translation: f64,
    /// Standard deviation of the hand's rotation about each axis \[rad\].
    #[serde(rename = "hand_rotation_rad")]
    pub hand_rotation: f64,
    /// Standard deviation of each joint \[rad or m\].
    pub joints: f64,
}

/// Changes that bring what is said and measured in the frames of a rig to what is true, the same in all of them.
#[derive(Clone, Debug)]
pub struct Rig {
    /// Calibration error of the camera and its depth.
    pub camera: CameraCalibrationError,
    /// k1 and k2 of the radial distortion (Brown and Conrady) that the corrected camera has beside that which is said of its lens.
    pub distortion: [f64; RADIAL],
    pub(crate) warp: Arc<ImageWarp>,
    /// Undistortion maps of the last cameras.
    pub(crate) remaps: Arc<RemapCache>,
    /// Depth offsets beside scale and bias: coefficients of a smooth field over the image, to be added \[m\].
    pub(crate) depth_offsets: Vec<f64>,
    /// The hand's pose in the frame of where it is said to be, as if it were mounted so.
    pub in_hand: Isometry3<f64>,
    /// Its displacement and its rotation about its own origin in the axes of the camera, as if that were mounted so.
    pub in_camera: Isometry3<f64>,
    /// To be added to joint positions \[rad or m\].
    pub joints: Vec<f64>,
    /// Standard deviations of the errors that change from frame to frame.
    pub play: Play,
    /// Covariance of the parameters: displacement and rotation vector of `in_hand` and of `in_camera` \[m, rad\], joints, camera,
    /// distortion, coefficients of depth's field.
    pub covariance: DMatrix<f64>,
    /// By what the surface of each object differs from its model, by the object's number.
    pub objects: BTreeMap<u32, SurfaceDeviation>,
}

/// Displacements and rotations of the hand in its own axes and in those of the camera.
const POSES: usize = 12;

impl Rig {
    /// With everything as it is said to be, of a hand of so many joints and a field of depth; `sigmas` are the parameters' standard deviations.
    pub(crate) fn nominal(
        joints: usize,
        warp: ImageWarp,
        sigmas: &DVector<f64>,
        play: Play,
    ) -> Self {
        Self {
            camera: CameraCalibrationError::default(),
            distortion: [0.0; RADIAL],
            depth_offsets: vec![0.0; warp.depth.len()],
            warp: Arc::new(warp),
            remaps: Arc::default(),
            in_hand: Isometry3::identity(),
            in_camera: Isometry3::identity(),
            joints: vec![0.0; joints],
            play,
            covariance: DMatrix::from_diagonal(&sigmas.map(|sigma| sigma * sigma)),
            objects: BTreeMap::new(),
        }
    }

    /// Columns and rows of its images.
    pub fn image_size(&self) -> [usize; 2] {
        self.warp.depth.size()
    }

    /// Number of its parameters, but for the objects'.
    pub(crate) fn len(&self) -> usize {
        self.first_warp() + self.warp.len()
    }

    /// Index of the first parameter of the image warp: distortion, then coefficients of depth's field.
    pub(crate) fn first_warp(&self) -> usize {
        POSES + self.joints.len() + CameraCalibrationError::DIMENSION
    }

    /// The parameters, zero where nothing is corrected.
    pub(crate) fn values(&self) -> DVector<f64> {
        let poses = [&self.in_hand, &self.in_camera];
        let poses = poses.map(|pose| (pose.translation.vector, so3_log(&pose.rotation)));
        let poses = poses.iter().flat_map(|(place, turn)| place.iter().chain(turn)).copied();
        let numbers = self.joints.iter().copied().chain(self.camera.parameters());
        let warp = self.distortion.iter().chain(&self.depth_offsets).copied();
        DVector::from_iterator(self.len(), poses.chain(numbers).chain(warp))
    }

    /// Names and values of the parameters, in the order of [`covariance`](Self::covariance), without the coefficients of depth's field
    /// \[m, rad; focal lengths\].
    pub fn parameters(&self) -> Vec<(String, f64)> {
        let mut names = Vec::new();
        for axes in ["hand", "camera"] {
            for kind in ["translation", "rotation"] {
                names.extend(["x", "y", "z"].map(|axis| format!("{kind} {axis}, {axes} axes")));
            }
        }
        names.extend((0..self.joints.len()).map(|joint| format!("joint {joint}")));
        names.extend(
            ["depth scale", "depth bias", "principal point x", "principal point y"]
                .into_iter()
                .chain(["focal scale", "aspect", "distortion k1", "distortion k2"])
                .map(str::to_owned),
        );
        names.into_iter().zip(self.values().iter().copied()).collect()
    }

    /// With `change` on top of what it corrects.
    pub(crate) fn changed(&self, change: &[f64]) -> Self {
        let vector = |from: usize| Vector3::from_column_slice(&change[from..from + 3]);
        let rotation = |from: usize| UnitQuaternion::from_scaled_axis(vector(from));
        let (joints, rest) = change[POSES..].split_at(self.joints.len());
        let (camera, warp) = rest.split_at(CameraCalibrationError::DIMENSION);
        let (distortion, offsets) = warp.split_at(RADIAL);
        let sum = |values: &[f64], change: &[f64]| {
            values.iter().zip(change).map(|(value, change)| value + change).collect()
        };
        Self {
            in_hand: self.in_hand * Isometry3::from_parts(vector(0).into(), rotation(3)),
            in_camera: Isometry3::from_parts(
                (self.in_camera.translation.vector + vector(6)).into(),
                rotation(9) * self.in_camera.rotation,
            ),
            joints: sum(&self.joints, joints),
            camera: self.camera.changed(camera),
            distortion: std::array::from_fn(|k| self.distortion[k] + distortion[k]),
            depth_offsets: sum(&self.depth_offsets, offsets),
            ..self.clone()
        }
    }

    /// Derivatives of what a frame says of its calibrations, a row each of hand pose (a left twist about the object's center), joints
    /// and camera, by the rig's parameters; `said` is what the frame says when corrected, of all joints or, where no hand is known, of none.
    pub(crate) fn jacobian(&self, said: &State) -> DMatrix<f64> {
        let rest = said.joints.len() + CameraCalibrationError::DIMENSION;
        let mut jacobian = DMatrix::zeros(6 + rest, self.len());
        let turn = said.t_cam_hand.rotation.to_rotation_matrix().into_inner();
        let mounted = self.in_camera.rotation.inverse() * said.t_cam_hand.rotation;
        let mounted = mounted.to_rotation_matrix().into_inner();
        let camera = Matrix3::identity();
        let arm = cross_matrix(&(said.center() - said.t_cam_hand.translation.vector));
        for (column, directions, axes) in [(0, mounted, turn), (6, camera, camera)] {
            jacobian.fixed_view_mut::<3, 3>(0, column).copy_from(&directions);
            jacobian.fixed_view_mut::<3, 3>(0, column + 3).copy_from(&(-arm * axes));
            jacobian.fixed_view_mut::<3, 3>(3, column + 3).copy_from(&axes);
        }
        let from = self.first_warp() - rest;
        jacobian.view_mut((6, from), (rest, rest)).fill_with_identity();
        jacobian
    }

    /// Covariance of a frame's calibrations, in the order of [`State::blocks`], about what it says when corrected; `object` are the standard
    /// deviations of the object's pose.
    ///
    /// # Errors
    /// If the frame's hand has another number of joints.
    pub(crate) fn frame_covariance(
        &self,
        said: &State,
        camera: &Camera,
        object: &[f64],
    ) -> Result<DMatrix<f64>, RefineError> {
        let (given, expected) = (said.joints.len(), self.joints.len());
        if given != expected && given != 0 {
            return Err(of_other_joints(given, expected));
        }
        let object_rows = object.len();
        let mut jacobian = self.jacobian(said);
        // Where the object is, depth's field is a bias, and distortion a shift and another size.
        if let Some(pixel) = camera.project(&said.center().into()) {
            let (at, first) = (Block::HandPose.dimension() + given, self.first_warp());
            for (k, weight) in self.warp.depth.weights(pixel.x, pixel.y) {
                jacobian[(at + CameraCalibrationError::DEPTH_BIAS, first + RADIAL + k)] += weight;
            }
            let radial = radial_as_camera(&camera.ray(pixel.x, pixel.y).xy());
            jacobian.view_mut((at, first), radial.shape()).copy_from(&radial);
        }
        let known = &jacobian * &self.covariance * jacobian.transpose();
        let size = object_rows + known.nrows();
        let mut covariance = DMatrix::zeros(size, size);
        covariance.view_mut((object_rows, object_rows), known.shape()).copy_from(&known);
        let own = object.iter().map(|sigma| sigma * sigma).chain(self.play.variances(given));
        own.enumerate().for_each(|(k, variance)| covariance[(k, k)] += variance);
        Ok(covariance)
    }

    /// `prior`, with calibrations as accurate as [`frame_covariance`](Self::frame_covariance) has them, each by itself.
    ///
    /// # Errors
    /// If the frame's hand has another number of joints.
    pub(crate) fn marginal_prior(
        &self,
        said: &State,
        camera: &Camera,
        prior: &PriorSettings,
    ) -> Result<PriorSettings, RefineError> {
        let object = prior.sigmas(Block::ObjectPose);
        let variances = self.frame_covariance(said, camera, &object)?.diagonal();
        let sigma = |from: usize, count: usize| variances.rows(from, count).mean().sqrt();
        let (hand, joints) = (object.len(), object.len() + Block::HandPose.dimension());
        let camera = joints + said.joints.len();
        let mut prior = prior.clone();
        if let count @ 1.. = said.joints.len() {
            prior.hand_translation = sigma(hand, 3);
            prior.hand_rotation = sigma(hand + 3, 3);
            let each = variances.rows(joints, count);
            prior.known_joints = each.iter().map(|variance| Some(variance.sqrt())).collect();
        }
        Ok(PriorSettings {
            depth_scale: sigma(camera, 1),
            depth_bias: sigma(camera + 1, 1),
            principal_point: sigma(camera + 2, 2),
            focal_scale: sigma(camera + 4, 1),
            aspect: sigma(camera + 5, 1),
            ..prior
        })
    }
}

impl Play {
    /// Variances of a hand's pose and of so many joints.
    pub(crate) fn variances(&self, count: usize) -> impl Iterator<Item = f64> + use<> {
        let Self { hand_translation, hand_rotation, joints } = *self;
        let hand = [hand_translation; 3].into_iter().chain([hand_rotation; 3]);
        hand.chain(std::iter::repeat_n(joints, count)).map(|sigma| sigma * sigma)
    }
}

pub(crate) fn of_other_joints(given: usize, expected: usize) -> RefineError {
    let problem = format!("is of a hand of {expected} joints, not of {given}");
    RefineError::Setting { name: "rig", problem }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::DepthField;
    use crate::scene::{PreparedFrame, default_scene};

    fn nominal() -> Rig {
        let warp = ImageWarp { depth: DepthField::new(640, 480, 4) };
        let sigmas = DVector::repeat(POSES + 16 + 6 + warp.len(), 1e-3);
        let play = Play { hand_translation: 1e-3, hand_rotation: 1e-3, joints: 1e-3 };
        Rig::nominal(16, warp, &sigmas, play)
    }

    #[test]
    fn derivatives_of_what_a_frame_says_match_differences() {
        let scene = default_scene(1).unwrap();
        let change: Vec<f64> = (0..nominal().len()).map(|k| 5e-3 * (k as f64).sin()).collect();
        let rig = nominal().changed(&change);
        assert!((rig.values() - DVector::from_vec(change)).amax() < 1e-12);
        let said = |rig: &Rig| {
            let observation = rig.corrected(&scene.frame).unwrap();
            let frame = PreparedFrame::new(&observation, &scene.object).unwrap();
            State::new(&frame, &scene.truth).unwrap()
        };
        let (at, step) = (said(&rig), 1e-6);
        let jacobian = rig.jacobian(&at);
        // What is said of a camera is in the observation, not in a state.
        for parameter in 0..POSES + 16 {
            let moved = |sign: f64| {
                let mut change = vec![0.0; rig.len()];
                change[parameter] = sign * step;
                said(&rig.changed(&change)).calibration_deviation(&at)
            };
            let difference = (moved(1.0) - moved(-1.0)) / (2.0 * step);
            let error = (difference - jacobian.column(parameter)).amax();
            assert!(error < 1e-6, "parameter {parameter}: {error}");
        }
    }

    #[test]
    fn a_corrected_camera_sees_what_its_error_says() {
        let mut rig = nominal();
        rig.camera = rig.camera.changed(&[0.01, 2e-3, 3e-3, -1e-3, 4e-3, 2e-3]);
        let scene = default_scene(1).unwrap();
        let (said, corrected) = (&scene.frame, rig.corrected(&scene.frame).unwrap());
        for (x, y) in [(320, 240), (300, 260)] {
            let depth = f64::from(said.depth.get(x, y).unwrap());
            let ray = said.camera.ray(x as f64, y as f64).xy();
            let z = f64::from(corrected.depth.get(x, y).unwrap());
            let place = corrected.camera.unproject(x as f64, y as f64, z);
            assert!(depth > 0.0 && (rig.camera.point(&ray, depth) - place).norm() < 1e-7);
        }
    }
}
