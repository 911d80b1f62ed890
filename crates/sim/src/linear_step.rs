//! A step and its Jacobian, in closed form.

mod generalized;
mod motions;
mod pair;

use nalgebra::{DMatrix, Matrix3, SMatrix, Vector3, Vector6};
use prehend_autodiff::lie::{cross_matrix, so3_exp, so3_right_jacobian};
use prehend_autodiff::{Fwd, Scalar};

use crate::articulated::Joint;
use crate::error::SimulationError;
use crate::integrator::semi_implicit::{SemiImplicitEuler, advance};
use crate::state::State;
use crate::time::Step;
use crate::world::World;
use generalized::Generalized;

/// A step with derivatives by everything that moves: the linear system that trajectory optimization and control want.
///
/// With N degrees of freedom, rows and columns are displacements, then velocities. Of each free body displacements are
/// six, a twist about its center of mass along the world's axes, as in [`State::tangent`]; of each joint they are as many as it has
/// velocities, and along these. Free bodies come first, then articulations, both in their order in the world.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearStep {
    /// The states after the step.
    pub states: Vec<State>,
    /// Derivatives by the states before it, 2N × 2N.
    pub by_state: DMatrix<f64>,
    /// Derivatives by constant forces during it, 2N × N: wrenches on free bodies \[N, N m\], efforts of joints \[N m or N\].
    pub by_force: DMatrix<f64>,
}

impl World {
    /// A step of [`SemiImplicitEuler`] with its Jacobian.
    ///
    /// Contacts that stick are as they are given, their deflections are no rows. Where there are such contacts, spherical joints or joint types
    /// of one's own, derivatives are those of forward mode, direction by direction; else in closed form, much faster.
    ///
    /// # Errors
    /// As [`World::step`].
    pub fn linear_step(&self, states: &[State], step: Step) -> Result<LinearStep, SimulationError> {
        let mut states = self.with_deflections(states);
        self.check(&states, step)?;
        if !self.contact_groups.is_empty() {
            self.place_links(&mut states);
        }
        let near = self.with_neighbors(&states, step);
        if near.sticking().next().is_some() || near.joints().any(has_curved_axes) {
            let near = near.into_owned();
            return near.linear_step_by_forward_mode(&states, step);
        }
        let forces = Generalized::new(&near, &mut states, step.index);
        let next = near.finished(&states, &forces, step)?;
        let n = forces.count;
        let [mut by_state, mut by_force] = [2 * n, n].map(|columns| DMatrix::zeros(2 * n, columns));
        near.bodies_after(&states, &forces, step.dt, &mut by_state, &mut by_force);
        near.joints_after(&next, &forces, step.dt, &mut by_state, &mut by_force);
        Ok(LinearStep { states: next, by_state, by_force })
    }

    /// The states after a step of semi-implicit Euler under these forces.
    fn finished(
        &self,
        states: &[State],
        forces: &Generalized,
        step: Step,
    ) -> Result<Vec<State>, SimulationError> {
        let mut next = states.to_vec();
        for body in self.free_bodies() {
            if let Some(rigid) = self.bodies[body].rigid() {
                let wrench = &forces.wrenches[body];
                next[body] = advance(rigid, &self.gravity, &states[body], wrench, step.dt);
            }
        }
        self.swing(&mut next, &forces.wrenches, step.dt);
        self.drive(&mut next, step.end());
        match next.iter().all(State::is_finite) {
            true => Ok(next),
            false => Err(self.not_finite(states, &next, step.end())),
        }
    }

    /// The rows of free bodies.
    fn bodies_after(
        &self,
        states: &[State],
        forces: &Generalized,
        dt: f64,
        by_state: &mut DMatrix<f64>,
        by_force: &mut DMatrix<f64>,
    ) {
        let n = forces.count;
        let gravity = self.gravity.map(Fwd::<18>::constant);
        for (slot, body) in self.free_bodies().into_iter().enumerate() {
            let Some(rigid) = self.bodies[body].rigid() else { continue };
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
        next: &[State],
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
            let Course { of_place, of_velocity } = Course::new(joint, state, dt);
            let count = joint.freedoms();
            let velocity = by_state.rows(n + row, count).into_owned();
            by_state.rows_mut(row, count).copy_from(&(&of_velocity * velocity));
            let mut view = by_state.view_mut((row, row), (count, count));
            view += of_place;
            let velocity = by_force.rows(n + row, count).into_owned();
            by_force.rows_mut(row, count).copy_from(&(of_velocity * velocity));
            row += count;
        }
    }

    /// [`World::linear_step`] by forward mode, direction by direction: what its closed form is tested against.
    ///
    /// # Errors
    /// As there.
    #[doc(hidden)]
    pub fn linear_step_by_forward_mode(
        &self,
        states: &[State],
        step: Step,
    ) -> Result<LinearStep, SimulationError> {
        let next = self.step(&SemiImplicitEuler, states, step)?;
        let n = self.degrees_of_freedom();
        let [mut by_state, mut by_force] = [2 * n, n].map(|columns| DMatrix::zeros(2 * n, columns));
        let lifted = self.lift::<Fwd<1>>();
        let zeros = vec![Fwd::<1>::constant(0.0); 2 * n];
        for column in 0..2 * n {
            let mut along = zeros.clone();
            along[column] = Fwd::variable(0.0, 0);
            let after = lifted.step(&SemiImplicitEuler, &self.displaced(states, &along), step)?;
            by_state.column_mut(column).copy_from_slice(&self.displacements(&next, &after));
        }
        let start = self.displaced(states, &zeros);
        for (slot, body) in self.free_bodies().into_iter().enumerate() {
            for k in 0..6 {
                let mut world = lifted.clone();
                world.bodies[body].external_wrench[k].derivative[0] = 1.0;
                let after = world.step(&SemiImplicitEuler, &start, step)?;
                let slopes = self.displacements(&next, &after);
                by_force.column_mut(6 * slot + k).copy_from_slice(&slopes);
            }
        }
        let forces = Generalized::without_forces(self, states);
        let mut scratch = DMatrix::zeros(2 * n, 2 * n);
        self.joints_after(&next, &forces, step.dt, &mut scratch, &mut by_force);
        Ok(LinearStep { states: next, by_state, by_force })
    }

    /// N of [`LinearStep`].
    fn degrees_of_freedom(&self) -> usize {
        6 * self.free_bodies().len() + self.joints().map(Joint::freedoms).sum::<usize>()
    }

    /// The states displaced and sped up by `along`.
    fn displaced<S: Scalar>(&self, states: &[State], along: &[S]) -> Vec<State<S>> {
        let n = self.degrees_of_freedom();
        let mut displaced: Vec<State<S>> = states.iter().map(State::lift).collect();
        let mut first = 0;
        for body in self.free_bodies() {
            let part = |i: usize| if i < 6 { along[first + i] } else { along[n + first + i - 6] };
            displaced[body] = states[body].retract(&std::array::from_fn(part));
            first += 6;
        }
        for (place, joint) in self.joint_places().zip(self.joints()) {
            let count = joint.freedoms();
            let (mut q, mut v) = (Vec::new(), Vec::new());
            joint.read(&displaced[place], &mut q, &mut v);
            let mut moved = Vec::new();
            joint.moved(&q, &along[first..first + count], &mut moved);
            v.iter_mut().zip(&along[n + first..]).for_each(|(v, x)| *v += *x);
            displaced[place] = joint.write(&moved, &v);
            first += count;
        }
        self.lift::<S>().place_links(&mut displaced);
        displaced
    }

    /// The derivatives of `after`, whose values are `next`, along the coordinates of a [`LinearStep`].
    fn displacements(&self, next: &[State], after: &[State<Fwd<1>>]) -> Vec<f64> {
        let (mut displacements, mut velocities) = (Vec::<f64>::new(), Vec::<f64>::new());
        for body in self.free_bodies() {
            let tangent = after[body].tangent().map(|x| x.derivative[0]);
            displacements.extend(&tangent[..6]);
            velocities.extend(&tangent[6..]);
        }
        for (place, joint) in self.joint_places().zip(self.joints()) {
            let tangent = after[place].tangent().map(|x| x.derivative[0]);
            let part = |from: usize| Vector3::from_column_slice(&tangent[from..from + 3]);
            let back = next[place].pose.rotation.inverse();
            let count = joint.freedoms();
            match joint {
                Joint::Spherical => {
                    displacements.extend((back * part(3)).iter());
                    velocities.extend(&tangent[9..]);
                }
                Joint::Floating => {
                    displacements.extend((back * part(0)).iter());
                    displacements.extend((back * part(3)).iter());
                    velocities.extend(&tangent[6..]);
                }
                _ => {
                    displacements.extend(&tangent[..count]);
                    velocities.extend(&tangent[6..6 + count]);
                }
            }
        }
        displacements.extend(velocities);
        displacements
    }
}

/// Whether laws along a joint, or its axes, change with its position in a way that the closed form leaves out.
fn has_curved_axes(joint: &Joint) -> bool {
    matches!(joint, Joint::Custom(_) | Joint::Spherical)
}

/// How a joint's displacement after a step follows from that before it and from its velocity after it.
struct Course {
    of_place: DMatrix<f64>,
    of_velocity: DMatrix<f64>,
}

impl Course {
    fn new(joint: &Joint, after: &State, dt: f64) -> Self {
        let count = joint.freedoms();
        let mut course = Self {
            of_place: DMatrix::identity(count, count),
            of_velocity: DMatrix::from_diagonal_element(count, count, dt),
        };
        let turn = after.angular * dt;
        let back = so3_exp(&-turn).to_rotation_matrix().into_inner();
        let of_spin: Matrix3<f64> = so3_right_jacobian(&turn) * dt;
        match joint {
            Joint::Spherical => {
                course.of_place.copy_from(&back);
                course.of_velocity.copy_from(&of_spin);
            }
            Joint::Floating => {
                let mut set = |row: usize, column: usize, block: Matrix3<f64>| {
                    course.of_place.view_mut((row, column), (3, 3)).copy_from(&block);
                };
                set(0, 0, back);
                set(0, 3, -back * cross_matrix(&after.linear) * dt);
                set(3, 3, back);
                course.of_velocity.view_mut((0, 0), (3, 3)).copy_from(&(back * dt));
                course.of_velocity.view_mut((3, 3), (3, 3)).copy_from(&of_spin);
            }
            _ => {}
        }
        course
    }
}
