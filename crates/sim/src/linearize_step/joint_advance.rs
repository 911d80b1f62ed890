//! Joint coordinates after a step.

use nalgebra::{DMatrix, Matrix3};
use prehend_autodiff::lie::{cross_matrix, so3_exp, so3_right_jacobian};

use crate::articulated::Joint;
use crate::body_state::BodyState;

/// Derivatives of a joint's displacement after a step by that before it and by its velocity after it.
pub(super) struct JointAdvance {
    pub(super) of_place: DMatrix<f64>,
    pub(super) of_velocity: DMatrix<f64>,
}

impl JointAdvance {
    pub(super) fn new(joint: &Joint, after: &BodyState, dt: f64) -> Self {
        let count = joint.nv();
        let mut advance = Self {
            of_place: DMatrix::identity(count, count),
            of_velocity: DMatrix::from_diagonal_element(count, count, dt),
        };
        let turn = after.angular * dt;
        let back = so3_exp(&-turn).to_rotation_matrix().into_inner();
        let of_spin: Matrix3<f64> = so3_right_jacobian(&turn) * dt;
        match joint {
            Joint::Spherical => {
                advance.of_place.copy_from(&back);
                advance.of_velocity.copy_from(&of_spin);
            }
            Joint::Floating => {
                let mut set = |row: usize, column: usize, block: Matrix3<f64>| {
                    advance.of_place.view_mut((row, column), (3, 3)).copy_from(&block);
                };
                set(0, 0, back);
                set(0, 3, -back * cross_matrix(&after.linear) * dt);
                set(3, 3, back);
                advance.of_velocity.view_mut((0, 0), (3, 3)).copy_from(&(back * dt));
                advance.of_velocity.view_mut((3, 3), (3, 3)).copy_from(&of_spin);
            }
            _ => {}
        }
        advance
    }
}
