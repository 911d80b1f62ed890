//! What is known beforehand: of the pose, and of how accurate calibrations are.

use nalgebra::{Isometry3, Matrix6, Point3, Vector3, Vector6};
use prehend_autodiff::lie::{cross_matrix, so3_left_jacobian_inverse, so3_log};

use super::Term;
use crate::error::RefineError;
use crate::problem::{Block, Normal, State};
use crate::scene::CameraCalibrationError;

/// Stated accuracies: standard deviations of what a [`State`] holds from what it begins with. All are positive; what is known exactly has a
/// tiny one.
///
#[derive(Clone, Debug, PartialEq)]
pub struct PriorSettings {
    /// The object's center in each direction of the camera frame \[m\].
    pub object_translation: [f64; 3],
    /// The object's rotation about each axis of the camera frame \[rad\].
    pub object_rotation: [f64; 3],
    /// The hand at the object's place, in each direction \[m\].
    pub hand_translation: f64,
    /// The hand's rotation about each axis \[rad\].
    pub hand_rotation: f64,
    /// Each joint \[rad or m\].
    pub joints: f64,
    /// Depth, as a part of it.
    pub depth_scale: f64,
    /// Depth \[m\].
    pub depth_bias: f64,
    /// The center of projection, across and down \[focal lengths\].
    pub shift: f64,
    /// The size of images, as a part of it: errors of the focal length and of the model's size.
    pub magnification: f64,
}

impl PriorSettings {
    /// Standard deviations of the parameters of `block`, in their order.
    pub(crate) fn deviations(&self, block: Block) -> Vec<f64> {
        match block {
            Block::ObjectPose => [self.object_translation, self.object_rotation].concat(),
            Block::HandPose => [[self.hand_translation; 3], [self.hand_rotation; 3]].concat(),
            Block::Joints(count) => vec![self.joints; count],
            Block::Camera => {
                vec![self.depth_scale, self.depth_bias, self.shift, self.shift, self.magnification]
            }
            Block::SurfacePatches(_) => Vec::new(),
        }
    }
}

impl Default for PriorSettings {
    /// An initial pose that is good to some centimeters and some tens of degrees, and a robot of common accuracy.
    fn default() -> Self {
        Self {
            object_translation: [0.03; 3],
            object_rotation: [0.4; 3],
            hand_translation: 2.1e-3,
            hand_rotation: 7e-3,
            joints: 0.014,
            depth_scale: 4e-3,
            depth_bias: 1e-3,
            shift: 1.7e-3,
            magnification: 4e-3,
        }
    }
}

/// Half the squared deviations from a state, over their variances.
pub struct Prior {
    object: (Vector3<f64>, Isometry3<f64>),
    hand: Isometry3<f64>,
    joints: Vec<f64>,
    precision_object: Vector6<f64>,
    precision_hand: Vector6<f64>,
    precision_joints: f64,
    precision_camera: [f64; CameraCalibrationError::DIMENSION],
}

impl Prior {
    /// A prior about `state`.
    ///
    /// # Errors
    /// If a deviation is not a positive number.
    pub fn new(state: &State, settings: &PriorSettings) -> Result<Self, RefineError> {
        let of = |block| settings.deviations(block);
        let (object, hand) = (of(Block::ObjectPose), of(Block::HandPose));
        let camera = of(Block::Camera);
        let all =
            object.iter().chain(&hand).chain(&camera).chain(std::iter::once(&settings.joints));
        if let Some(wrong) = all.into_iter().find(|v| v.is_nan() || **v <= 0.0) {
            let problem = format!("a standard deviation of {wrong} is not positive");
            return Err(RefineError::Setting { name: "prior", problem });
        }
        let precision = |sigma: f64| sigma.powi(-2);
        Ok(Self {
            object: (state.center(), state.t_cam_object),
            hand: state.t_cam_hand,
            joints: state.joints.clone(),
            precision_object: Vector6::from_vec(object).map(precision),
            precision_hand: Vector6::from_vec(hand).map(precision),
            precision_joints: precision(settings.joints),
            precision_camera: std::array::from_fn(|k| precision(camera[k])),
        })
    }

    /// How far `pose` has been moved from `from`, as (displacement of the point that was at `point`, rotation vector),
    /// and the derivatives by a left twist of `pose` about `center`.
    pub(crate) fn deviation(
        pose: &Isometry3<f64>,
        from: &Isometry3<f64>,
        point: &Vector3<f64>,
        center: &Vector3<f64>,
    ) -> (Vector6<f64>, Matrix6<f64>) {
        let motion = pose * from.inverse();
        let place = (motion * Point3::from(*point)).coords;
        let turn = so3_log(&motion.rotation);
        let mut deviation = Vector6::zeros();
        deviation.fixed_rows_mut::<3>(0).copy_from(&(place - point));
        deviation.fixed_rows_mut::<3>(3).copy_from(&turn);
        let mut jacobian = Matrix6::identity();
        jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&-cross_matrix(&(place - center)));
        jacobian.fixed_view_mut::<3, 3>(3, 3).copy_from(&so3_left_jacobian_inverse(&turn));
        (deviation, jacobian)
    }

    /// How the object and the hand deviate.
    fn poses(&self, state: &State) -> [PoseDeviation; 2] {
        let (center, from) = &self.object;
        let now = state.center();
        let of = |block, pose, from, precision| {
            let (deviation, jacobian) = Self::deviation(pose, from, center, &now);
            PoseDeviation { block, deviation, jacobian, precision }
        };
        [
            of(Block::ObjectPose, &state.t_cam_object, from, self.precision_object),
            of(Block::HandPose, &state.t_cam_hand, &self.hand, self.precision_hand),
        ]
    }

    /// Deviation and precision of every joint and every parameter of the camera.
    fn numbers(&self, state: &State) -> [(Block, Vec<(f64, f64)>); 2] {
        let joints = state.joints.iter().zip(&self.joints);
        let joints: Vec<_> = joints.map(|(q, from)| (q - from, self.precision_joints)).collect();
        let camera = state.camera.parameters().into_iter().zip(self.precision_camera);
        [(Block::Joints(joints.len()), joints), (Block::Camera, camera.collect())]
    }
}

/// How far a pose is from where it is believed to be.
struct PoseDeviation {
    block: Block,
    deviation: Vector6<f64>,
    /// Derivatives of the deviation by the block.
    jacobian: Matrix6<f64>,
    precision: Vector6<f64>,
}

impl Term for Prior {
    fn name(&self) -> &'static str {
        "prior"
    }

    fn value(&self, state: &State) -> f64 {
        let poses = self.poses(state);
        let of_poses =
            poses.iter().map(|p| p.deviation.component_mul(&p.deviation).dot(&p.precision));
        let numbers = self.numbers(state);
        let of_numbers = numbers.iter().flat_map(|(_, all)| all).map(|(e, p)| e * e * p);
        0.5 * (of_poses.sum::<f64>() + of_numbers.sum::<f64>())
    }

    fn linearize(&self, state: &State, normal: &mut Normal) -> f64 {
        for PoseDeviation { block, deviation, jacobian, precision } in self.poses(state) {
            let weighted = Matrix6::from_diagonal(&precision) * jacobian;
            normal.add(&[block], &weighted.tr_mul(&deviation), &jacobian.tr_mul(&weighted));
        }
        for (block, numbers) in self.numbers(state) {
            normal.add_diagonal(block, &numbers);
        }
        self.value(state)
    }
}

#[cfg(test)]
mod tests {
    use super::super::gradient_check::{assert_gradient, fixture};
    use super::*;

    fn settings() -> PriorSettings {
        PriorSettings {
            object_translation: [0.01, 0.02, 0.03],
            object_rotation: [0.1, 0.2, 0.3],
            hand_translation: 2e-3,
            hand_rotation: 7e-3,
            joints: 0.014,
            depth_scale: 5e-3,
            depth_bias: 1e-3,
            shift: 2e-3,
            magnification: 4e-3,
        }
    }

    #[test]
    fn gradients_match_differences_also_at_the_start() {
        let (_, start, _) = fixture(0);
        let prior = Prior::new(&start, &settings()).unwrap();
        assert!(prior.value(&start) < 1e-20);
        let blocks = [Block::ObjectPose, Block::HandPose, Block::Joints(16), Block::Camera];
        let all = |scale: f64| -> Vec<f64> {
            let count: usize = blocks.iter().map(|b| b.dimension()).sum();
            (0..count).map(|i| scale * (i as f64 * 1.7).sin()).collect()
        };
        for scale in [1e-3, 0.1] {
            let state = start.moved_all(&blocks, &all(scale));
            for block in blocks {
                assert_gradient(&prior, &state, block, 1e-6, 1e-5);
            }
        }
    }

    #[test]
    fn deviations_must_be_positive() {
        let (_, start, _) = fixture(0);
        let none = PriorSettings { joints: 0.0, ..settings() };
        assert!(Prior::new(&start, &none).is_err());
    }
}
