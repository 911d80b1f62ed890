//! Displacements between states, the coordinates of a linearized step.

use nalgebra::{Isometry3, Vector3};
use prehend_autodiff::Scalar;
use prehend_autodiff::lie::{se3_log, so3_log};

use crate::articulated::Joint;
use crate::body_state::BodyState;
#[cfg(doc)]
use crate::linearize_step::LinearizedStep;
use crate::model::Model;
use crate::spatial::spatial;
use crate::state::State;

impl Model {
    /// State displaced \[m, rad\] and sped up \[m/s, rad/s\] by 2N numbers, as a [`LinearizedStep`] orders them. Deflections of contacts stay.
    ///
    /// # Panics
    /// Unless they are 2N, and it is a state of this model.
    pub fn displaced<S: Scalar>(&self, state: &State, by: &[S]) -> State<S> {
        assert_eq!(by.len(), 2 * self.degrees_of_freedom(), "numbers of a displacement");
        let (moves, speeds) = by.split_at(by.len() / 2);
        let mut displaced: State<S> = state.cast();
        let mut first = 0;
        for body in self.free_bodies() {
            let [moves, speeds] = [moves, speeds].map(|all| &all[first..first + 6]);
            let tangent = std::array::from_fn(|i| if i < 6 { moves[i] } else { speeds[i - 6] });
            displaced[body] = state[body].retract(&tangent);
            first += 6;
        }
        let rows = displaced.rows_mut();
        for (place, joint) in self.joint_places().zip(self.joints()) {
            let (mut q, mut v, mut moved) = (Vec::new(), Vec::new(), Vec::new());
            joint.read(&rows[place], &mut q, &mut v);
            joint.moved(&q, &moves[first..first + joint.nv()], &mut moved);
            v.iter_mut().zip(&speeds[first..]).for_each(|(v, x)| *v += *x);
            rows[place] = joint.write(&moved, &v);
            first += joint.nv();
        }
        self.cast::<S>().forward_kinematics(rows);
        displaced
    }

    /// The 2N numbers by which `to` is [displaced](Model::displaced) from `from`. Rotations by π or more come back the shorter way.
    ///
    /// # Panics
    /// If they are no states of this model.
    pub fn displacement<S: Scalar>(&self, from: &State, to: &State<S>) -> Vec<S> {
        let (mut moves, mut speeds) = (Vec::<S>::new(), Vec::<S>::new());
        let mut add = |joint: &Joint, motion: Isometry3<S>, a: &BodyState<S>, b: &BodyState<S>| {
            let parts = match joint {
                Joint::Floating => se3_log(&motion),
                Joint::Spherical => spatial(&so3_log(&motion.rotation), &Vector3::zeros()),
                _ => spatial(&motion.translation.vector, &Vector3::zeros()),
            };
            let [linear, angular] = [a.linear - b.linear, a.angular - b.angular];
            let rates = match joint {
                Joint::Spherical => spatial(&angular, &linear),
                _ => spatial(&linear, &angular),
            };
            moves.extend(parts.iter().take(joint.nv()));
            speeds.extend(rates.iter().take(joint.nv()));
        };
        for body in self.free_bodies() {
            let (a, b) = (&to[body], &from[body].cast());
            let shift = a.pose.translation.vector - b.pose.translation.vector;
            let turn = a.pose.rotation * b.pose.rotation.inverse();
            add(&Joint::Floating, Isometry3::from_parts(shift.into(), turn), a, b);
        }
        for (place, joint) in self.joint_places().zip(self.joints()) {
            let (a, b) = (&to.rows()[place], &from.rows()[place].cast());
            let mut motion = b.pose.inverse() * a.pose;
            if !joint.turns() {
                // Coordinates, not a pose.
                motion.translation.vector = a.pose.translation.vector - b.pose.translation.vector;
            }
            add(joint, motion, a, b);
        }
        moves.extend(speeds);
        moves
    }
}
