//! Factors of another camera.

use std::sync::Arc;

use nalgebra::{DMatrix, Isometry3, Matrix3, Translation3, UnitQuaternion};
use prehend_autodiff::lie::so3_left_jacobian;

use crate::problem::{Block, Factor, NormalEquations, State};

/// Factors of another camera's frame, as one factor of the first camera's state: that of its view `index`.
pub struct ViewFactor {
    index: usize,
    factors: Vec<Arc<dyn Factor>>,
    /// First camera's coordinates → this one's \[m\].
    t_view_cam: Isometry3<f64>,
}

impl ViewFactor {
    /// Factor of `factors`, which are of the frame of the view `index`; `t_view_cam` maps the first camera's coordinates to that camera's \[m\].
    pub fn new(index: usize, factors: Vec<Arc<dyn Factor>>, t_view_cam: Isometry3<f64>) -> Self {
        Self { index, factors, t_view_cam }
    }

    /// The state as this camera has it, which sees object and hand as much elsewhere as its calibration is off, turned about the object's center.
    fn seen(&self, state: &State) -> State {
        let off = state.views[self.index];
        let center = self.t_view_cam * state.t_cam_object * state.object_center;
        let turn = UnitQuaternion::from_scaled_axis(off.rotation);
        let moved = Translation3::from(center.coords + off.translation) * turn;
        let off_view = moved * Translation3::from(-center.coords);
        let seen = |pose: &Isometry3<f64>| off_view * self.t_view_cam * pose;
        State {
            t_cam_object: seen(&state.t_cam_object),
            t_cam_hand: seen(&state.t_cam_hand),
            camera: off.camera,
            views: Vec::new(),
            ..state.clone()
        }
    }

    /// Derivatives of what this camera's factors are about, twists of object and hand, joints and its camera, by object's twist, hand's twist, joints
    /// and this view's calibration.
    fn chain(&self, state: &State) -> DMatrix<f64> {
        let (off, joints) = (&state.views[self.index], state.joints.len());
        let (view, camera) = (12 + joints, Block::Camera.dimension());
        let axes = self.t_view_cam.rotation.to_rotation_matrix().into_inner();
        let turn = UnitQuaternion::from_scaled_axis(off.rotation).to_rotation_matrix().into_inner();
        let mut chain = DMatrix::zeros(view + camera, view + 6 + camera);
        let mut set = |row: usize, column: usize, block: Matrix3<f64>| {
            chain.fixed_view_mut::<3, 3>(row, column).copy_from(&block);
        };
        // The center that things are turned about moves with the object.
        set(0, 0, axes);
        set(6, 0, (Matrix3::identity() - turn) * axes);
        set(6, 6, turn * axes);
        let by_rotation = so3_left_jacobian(&off.rotation);
        for twist in [0, 6] {
            set(twist + 3, twist + 3, turn * axes);
            set(twist, view, Matrix3::identity());
            set(twist + 3, view + 3, by_rotation);
        }
        chain.view_mut((12, 12), (joints, joints)).fill_with_identity();
        chain.view_mut((view, view + 6), (camera, camera)).fill_with_identity();
        chain
    }
}

impl Factor for ViewFactor {
    fn name(&self) -> &'static str {
        "view"
    }

    fn cost(&self, state: &State) -> f64 {
        let seen = self.seen(state);
        self.factors.iter().map(|factor| factor.cost(&seen)).sum()
    }

    fn linearize(&self, state: &State, equations: &mut NormalEquations) -> f64 {
        let (seen, joints) = (self.seen(state), Block::Joints(state.joints.len()));
        let own = [Block::ObjectPose, Block::HandPose, joints, Block::Camera];
        let mut inner = NormalEquations::new(&own);
        let cost = self.factors.iter().map(|factor| factor.linearize(&seen, &mut inner)).sum();
        let chain = self.chain(state);
        let gradient = chain.tr_mul(inner.gradient());
        let hessian = chain.tr_mul(&(inner.hessian() * &chain));
        let blocks = [Block::ObjectPose, Block::HandPose, joints, Block::View(self.index)];
        equations.add(&blocks, &gradient, &hessian);
        cost
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector3};
    use prehend_autodiff::lie::twist_row;

    use super::super::gradient_check::{assert_gradient, fixture, scene};
    use super::*;
    use crate::problem::{NoiseModel, Rows};
    use crate::scene::{CameraCalibrationError, Frame, PreparedFrame, ViewCalibrationError};

    fn turned() -> Isometry3<f64> {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.5, 0.8));
        Isometry3::from_parts([0.2, -0.1, 0.05].into(), turn)
    }

    /// Places of a point of the object and of one of the hand, a joint and a number of the camera: derivatives are exact anywhere.
    struct Places;

    impl Factor for Places {
        fn name(&self) -> &'static str {
            "places"
        }

        fn rows(&self, state: &State, rows: &mut Rows<'_>) {
            let unit = NoiseModel::gaussian(0.01).weighting(1);
            for (axis, offset) in [(0, 0.1), (1, -0.2), (2, 0.4)] {
                let along = Vector3::ith(axis, 1.0);
                let point = state.t_cam_object * Point3::new(0.03, -0.05, 0.04);
                rows.add(point[axis] - offset, &unit, |row| {
                    row.object_point(state, &point, &along)
                });
                let point = state.t_cam_hand * Point3::new(-0.06, 0.02, 0.1);
                rows.add(point[axis] - offset, &unit, |row| {
                    let by_hand = twist_row(&(point.coords - state.center()), &along);
                    row.block(Block::HandPose, by_hand.as_slice());
                });
            }
            let unit_row =
                |size: usize, at| (0..size).map(|k| f64::from(k == at)).collect::<Vec<_>>();
            rows.add(state.joints[5], &unit, |row| {
                row.block(Block::Joints(16), &unit_row(16, 5));
            });
            let bias = CameraCalibrationError::DEPTH_BIAS;
            let change = state.camera.parameters()[bias] - 0.01;
            rows.add(change, &unit, |row| row.block(Block::Camera, &unit_row(6, bias)));
        }
    }

    fn view() -> ViewFactor {
        ViewFactor::new(0, vec![Arc::new(Places)], turned())
    }

    /// A state of the first camera that the other one, at `turned`, has as `seen` but for an error.
    fn of_first(seen: &State, error: ViewCalibrationError) -> State {
        let back = turned().inverse();
        State {
            t_cam_object: back * seen.t_cam_object,
            t_cam_hand: back * seen.t_cam_hand,
            views: vec![error],
            ..seen.clone()
        }
    }

    #[test]
    fn gradients_match_differences() {
        for seed in 0..3 {
            let (_, seen) = fixture(seed);
            let mut error = ViewCalibrationError::default();
            if seed > 0 {
                // Much larger than it is in fact, so that derivatives are told from those where nothing is off.
                error.translation = Vector3::new(2e-3, -1e-3, 3e-3);
                error.rotation = Vector3::new(0.2, -0.1, 0.15) * seed as f64;
                error.camera = CameraCalibrationError::default()
                    .changed(&[2e-3, 1e-3, 1e-3, -1e-3, 2e-3, 1e-3]);
            }
            let state = of_first(&seen, error);
            for block in [Block::ObjectPose, Block::HandPose, Block::Joints(16), Block::View(0)] {
                assert_gradient(&view(), &state, block, 1e-6, 1e-5);
            }
        }
    }

    #[test]
    fn a_view_costs_what_its_factors_do() {
        let (_, seen) = fixture(0);
        let view = view();
        let own: f64 = view.factors.iter().map(|factor| factor.cost(&seen)).sum();
        let cost = view.cost(&of_first(&seen, ViewCalibrationError::default()));
        assert!((cost / own - 1.0).abs() < 1e-9);
    }

    #[test]
    fn views_of_an_observation_have_the_hand_where_it_is() {
        let scene = scene();
        let seen = Frame { hand: None, ..scene.frame.clone() };
        let both = scene.frame.clone().with_view(seen, turned().inverse());
        let frame = PreparedFrame::new(&both, &scene.object).unwrap();
        let [view] = frame.views() else { panic!("not one view") };
        let (hand, expected) = (view.frame.hand().unwrap(), frame.hand().unwrap());
        let off = hand.t_cam_hand.inverse() * (view.t_view_cam * expected.t_cam_hand);
        assert!(off.translation.vector.norm() < 1e-12 && off.rotation.angle() < 1e-7);
        assert!(hand.forces.is_empty() && hand.joints == expected.joints);
        assert_eq!(State::new(&frame, &scene.truth).unwrap().views.len(), 1);
    }
}
