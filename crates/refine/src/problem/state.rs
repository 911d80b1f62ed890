//! What a solve may move: named blocks of parameters.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3, Vector6};
use prehend_autodiff::lie::perturb_about;
use prehend_render::Light;

use crate::error::RefineError;
use crate::factor::Term;
use crate::scene::{CameraCalibrationError, Object, Observation};

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
    /// Displacements of so many patches of the object's surface from where the model has them, in the camera frame \[m\]. No state
    /// holds them: they are eliminated.
    SurfacePatches(usize),
}

impl Block {
    /// Number of parameters.
    pub fn dimension(self) -> usize {
        match self {
            Self::ObjectPose | Self::HandPose => 6,
            Self::Joints(count) => count,
            Self::Camera => CameraCalibrationError::DIMENSION,
            Self::SurfacePatches(count) => 3 * count,
        }
    }
}

/// A point in the space that terms are functions of.
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
    /// How the camera differs from what is said of it.
    pub camera: CameraCalibrationError,
    /// Light on the object, in the camera frame. Not a block: [`Term::light`](crate::factor::Term::light)
    /// solves for it in closed form.
    pub light: Light,
}

impl State {
    /// The state that a refinement of `initial` (object → camera \[m\]) begins with.
    ///
    /// # Errors
    /// If the pose is not finite or behind the camera, an image has not the camera's size, or the object's
    /// mask is empty.
    pub fn new(
        observation: &Observation,
        object: &Object,
        initial: &Isometry3<f64>,
    ) -> Result<Self, RefineError> {
        let rotation = initial.rotation.coords.iter();
        if !rotation.chain(initial.translation.vector.iter()).all(|v| v.is_finite()) {
            return Err(RefineError::NotFinite);
        }
        observation.check_sizes().map_err(|(image, problem)| {
            RefineError::Images(format!("the {image} has {problem}"))
        })?;
        if observation.mask.count() == 0 {
            return Err(RefineError::EmptyMask);
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
            light: Light::ambient(1.0),
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

    /// Lights the object as `term` sees it, if it sees any light.
    pub(crate) fn relight(&mut self, term: &dyn Term) {
        if let Some(light) = term.light(self) {
            self.light = light;
        }
    }

    /// The state with `block` moved by `delta`, which has the block's dimension; twists are about
    /// [`center`](Self::center).
    ///
    /// # Panics
    /// If `delta` is shorter than the block.
    pub fn moved(&self, block: Block, delta: &[f64]) -> Self {
        self.moved_all(&[block], delta)
    }

    /// The state with all of `blocks` moved at once, by their parts of `delta` one after the other.
    ///
    /// # Panics
    /// If `delta` is shorter than the blocks together.
    pub fn moved_all(&self, blocks: &[Block], delta: &[f64]) -> Self {
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
                Block::SurfacePatches(_) => continue,
            };
            *pose = perturb_about(pose, &center, &Vector6::from_column_slice(part));
            // Thousands of small steps must not let the quaternion drift off the unit sphere.
            pose.rotation.renormalize();
        }
        state
    }
}

#[cfg(test)]
mod tests {
    use prehend_render::{DepthImage, Mask, RgbImage};

    use super::*;
    use crate::scene::default_scene;

    #[test]
    fn images_of_another_size_are_named() {
        let scene = default_scene(1).unwrap();
        let refused = |change: &dyn Fn(&mut Observation)| {
            let mut observation = scene.observation.clone();
            change(&mut observation);
            State::new(&observation, &scene.object, &scene.initial).unwrap_err().to_string()
        };
        let color = refused(&|o| o.color = RgbImage::filled(640, 479, [0.0; 3]));
        assert!(color.contains("the color image has 640x479 pixels, the camera has 640x480"));
        let depth = refused(&|o| o.depth = DepthImage::filled(320, 480, 1.0));
        assert!(depth.contains("the depth image has 320x480 pixels"), "{depth}");
        let mask = refused(&|o| o.mask = Mask::filled(1, 1, true));
        assert!(mask.contains("the mask has 1x1 pixels"), "{mask}");
    }
}
