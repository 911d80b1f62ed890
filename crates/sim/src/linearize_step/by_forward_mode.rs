//! The Jacobian of a step direction by direction: for what has no closed form, and to test that.

use nalgebra::{DMatrix, Vector3};
use prehend_autodiff::{Fwd, Scalar};

use super::LinearizedStep;
use super::generalized::Generalized;
use crate::articulated::Joint;
use crate::error::SimulationError;
use crate::integrator::semi_implicit::SemiImplicitEuler;
use crate::state::State;
use crate::time::Step;
use crate::world::World;

impl World {
    /// [`World::linearize_step`] by forward mode, direction by direction: what its closed form is tested against.
    ///
    /// # Errors
    /// As there.
    #[doc(hidden)]
    pub fn linearize_step_by_forward_mode(
        &self,
        states: &[State],
        step: Step,
    ) -> Result<LinearizedStep, SimulationError> {
        let next = self.step(&SemiImplicitEuler, states, step)?;
        let n = self.degrees_of_freedom();
        let [mut by_state, mut by_force] = [2 * n, n].map(|columns| DMatrix::zeros(2 * n, columns));
        let lifted = self.cast::<Fwd<1>>();
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
        self.finite(LinearizedStep { states: next, by_state, by_force }, step)
    }

    /// N of [`LinearizedStep`].
    fn degrees_of_freedom(&self) -> usize {
        6 * self.free_bodies().len() + self.joints().map(Joint::nv).sum::<usize>()
    }

    /// The states displaced and sped up by `along`.
    fn displaced<S: Scalar>(&self, states: &[State], along: &[S]) -> Vec<State<S>> {
        let n = self.degrees_of_freedom();
        let mut displaced: Vec<State<S>> = states.iter().map(State::cast).collect();
        let mut first = 0;
        for body in self.free_bodies() {
            let part = |i: usize| if i < 6 { along[first + i] } else { along[n + first + i - 6] };
            displaced[body] = states[body].retract(&std::array::from_fn(part));
            first += 6;
        }
        for (place, joint) in self.joint_places().zip(self.joints()) {
            let count = joint.nv();
            let (mut q, mut v) = (Vec::new(), Vec::new());
            joint.read(&displaced[place], &mut q, &mut v);
            let mut moved = Vec::new();
            joint.moved(&q, &along[first..first + count], &mut moved);
            v.iter_mut().zip(&along[n + first..]).for_each(|(v, x)| *v += *x);
            displaced[place] = joint.write(&moved, &v);
            first += count;
        }
        self.cast::<S>().forward_kinematics(&mut displaced);
        displaced
    }

    /// The derivatives of `after`, whose values are `next`, along the coordinates of a [`LinearizedStep`].
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
            let count = joint.nv();
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
