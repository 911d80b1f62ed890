//! A step and its Jacobian, in closed form.

mod by_forward_mode;
mod displacement;
mod generalized;
mod joint_advance;
mod motions;

use nalgebra::{DMatrix, SMatrix, Vector6};
use prehend_autodiff::{Fwd, Scalar};

use crate::articulated::Joint;
use crate::body_state::Rows;
use crate::error::Result;
#[cfg(doc)]
use crate::integrator::semi_implicit::SemiImplicitEuler;
use crate::integrator::semi_implicit::{advance, moved};
use crate::model::Model;
use crate::model::joint_force::JointAxis;
use crate::state::State;
use crate::time::Step;
use generalized::Generalized;
use joint_advance::JointAdvance;

/// A step with derivatives by everything that moves: the linear system that trajectory optimization and control want.
///
/// With N degrees of freedom, rows and columns are displacements, then velocities. Of each free body displacements are
/// six, a twist about its center of mass along the world's axes, as in [`BodyState::tangent`](crate::BodyState::tangent); of each joint they are as many as it has
/// velocities, and along these. Free bodies come first, then articulations, both in their order in the model. [`Model::displaced`] and
/// [`Model::displacement`] apply and find such displacements.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearizedStep {
    /// State after the step.
    pub state: State,
    /// Derivatives by the states before it, 2N × 2N.
    pub by_state: DMatrix<f64>,
    /// Derivatives by constant forces during it, 2N × N: wrenches on free bodies \[N, N m\], efforts of joints \[N m or N\].
    pub by_force: DMatrix<f64>,
}

impl Model {
    /// A step of [`SemiImplicitEuler`] with its Jacobian. The step says when it begins, whatever `state.time` is.
    ///
    /// Deflections of contacts with bristles are as they are given, and no rows. Where there are laws along spherical joints or joint types of
    /// one's own, derivatives are those of forward mode, direction by direction; else in closed form, much faster.
    ///
    /// # Errors
    /// As [`Model::step`].
    pub fn linearize_step(&self, state: &State, step: Step) -> Result<LinearizedStep> {
        let mut state = self.with_deflections(state.clone());
        self.check(&state, step)?;
        if !self.contact_groups.is_empty() {
            self.forward_kinematics(state.rows_mut());
        }
        let near = self.with_candidates(state.rows(), step);
        if !near.has_closed_form() {
            return near.linearize_step_by_forward_mode(&state, step);
        }
        let forces = Generalized::new(&near, state.rows_mut(), step.index);
        let mut next = moved(&near, state.rows(), &forces.wrenches, step.dt);
        near.integrate_bristles(&mut next, &forces.wrenches, step.dt);
        near.finish_step(state.rows(), &mut next, step.end())?;
        let n = forces.count;
        let [mut by_state, mut by_force] = [2 * n, n].map(|columns| DMatrix::zeros(2 * n, columns));
        near.bodies_after(state.rows(), &forces, step.dt, &mut by_state, &mut by_force);
        near.joints_after(&next, &forces, step.dt, &mut by_state, &mut by_force);
        let state = state.with(next, step.end());
        near.finite(LinearizedStep { state, by_state, by_force }, step)
    }

    /// `result`, unless its derivatives overflow.
    fn finite(&self, result: LinearizedStep, step: Step) -> Result<LinearizedStep> {
        match result.by_state.iter().chain(result.by_force.iter()).all(|x| x.is_finite()) {
            true => Ok(result),
            false => Err(self.blown_up(result.state.rows(), step.end())),
        }
    }

    /// The rows of free bodies.
    fn bodies_after(
        &self,
        states: &Rows,
        forces: &Generalized,
        dt: f64,
        by_state: &mut DMatrix<f64>,
        by_force: &mut DMatrix<f64>,
    ) {
        let n = forces.count;
        let gravity = self.gravity.map(Fwd::<18>::constant);
        for (slot, (body, rigid)) in self.rigid_bodies().enumerate() {
            let inputs = Fwd::<18>::variables([0.0; 18]);
            let state = states[body].retract(&std::array::from_fn(|i| inputs[i]));
            let wrench = Vector6::from_fn(|i, _| inputs[12 + i].plus(forces.wrenches[body][i]));
            let rigid = rigid.map(Fwd::constant);
            let next = advance(&rigid, &gravity, &state, &wrench, Fwd::constant(dt));
            let all: SMatrix<f64, 12, 18> = next.sensitivity();
            let first = 6 * slot;
            for (half, rows) in [0, n].into_iter().enumerate() {
                let own = all.fixed_view::<6, 18>(6 * half, 0);
                let by_wrench = own.fixed_columns::<6>(12);
                let row = rows + first;
                let moved = by_wrench * forces.by_position.rows(first, 6);
                by_state.view_mut((row, 0), (6, n)).copy_from(&moved);
                let pushed = by_wrench * forces.by_velocity.rows(first, 6);
                by_state.view_mut((row, n), (6, n)).copy_from(&pushed);
                let mut view = by_state.view_mut((row, first), (6, 6));
                view += own.fixed_columns::<6>(0);
                let mut view = by_state.view_mut((row, n + first), (6, 6));
                view += own.fixed_columns::<6>(6);
                by_force.view_mut((row, first), (6, 6)).copy_from(&by_wrench);
            }
        }
    }

    /// The rows of joints, whose states are `next` after the step.
    fn joints_after(
        &self,
        next: &Rows,
        forces: &Generalized,
        dt: f64,
        by_state: &mut DMatrix<f64>,
        by_force: &mut DMatrix<f64>,
    ) {
        let n = forces.count;
        let mut row = forces.joints;
        // Velocities: v' = v + dt v̇, whose derivatives are already those of accelerations.
        let joints = n - row;
        let acceleration = |matrix: &DMatrix<f64>| matrix.rows(row, joints) * dt;
        by_state.view_mut((n + row, 0), (joints, n)).copy_from(&acceleration(&forces.by_position));
        by_state.view_mut((n + row, n), (joints, n)).copy_from(&acceleration(&forces.by_velocity));
        for k in row..n {
            by_state[(n + k, n + k)] += 1.0;
        }
        by_force.view_mut((n + row, row), (joints, joints)).copy_from(&(&forces.by_effort * dt));
        for (place, joint) in self.joint_places().zip(self.joints()) {
            let state = &next[place];
            let JointAdvance { of_place, of_velocity } = JointAdvance::new(joint, state, dt);
            let count = joint.nv();
            let velocity = by_state.rows(n + row, count).into_owned();
            by_state.rows_mut(row, count).copy_from(&(&of_velocity * velocity));
            let mut view = by_state.view_mut((row, row), (count, count));
            view += of_place;
            let velocity = by_force.rows(n + row, count).into_owned();
            by_force.rows_mut(row, count).copy_from(&(of_velocity * velocity));
            row += count;
        }
    }

    /// True if the closed form leaves out nothing that there is.
    fn has_closed_form(&self) -> bool {
        // The axes of laws along a spherical joint turn with it.
        let curved = |(axis, _): &(JointAxis, f64)| {
            self.link(axis.link).is_ok_and(|link| matches!(link.joint, Joint::Spherical))
        };
        !self.joints().any(|joint| matches!(joint, Joint::Custom(_)))
            && !self.joint_forces.iter().flat_map(|force| &force.axes).any(curved)
            && !self.joint_forces.iter().any(|force| force.path.is_some() || force.input.is_some())
            && self.transmissions.is_empty()
    }
}
