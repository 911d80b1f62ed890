//! Whether a time step is short enough for the stiffness and damping of the contacts.

use nalgebra::{DMatrix, Matrix3, Matrix6};
use prehend_autodiff::Fwd;
use thiserror::Error;

use crate::integrator::Integrator;
use crate::state::State;
use crate::world::World;
use crate::world::body_id::BodyId;

/// A time step too long for the stiffness or damping of the contacts.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error("time step {dt} s is too long for these contacts: at most {limit} s")]
pub struct StepError {
    /// The time step \[s\].
    pub dt: f64,
    /// The longest step that passes \[s\].
    pub limit: f64,
}

impl World {
    /// Checks that `integrator` is stable with steps of `dt` \[s\] for the contacts at `states`: dt·ω ≤
    /// [`Integrator::stability_limit`] for their [`World::contact_frequency`] ω. Impacts to come are not among them.
    ///
    /// # Errors
    /// With the longest step that passes.
    ///
    /// # Panics
    /// If there are fewer states than bodies.
    pub fn check_time_step(
        &self,
        integrator: &impl Integrator,
        states: &[State],
        dt: f64,
    ) -> Result<(), StepError> {
        let limit = integrator.stability_limit() / self.contact_frequency(states);
        if dt > 0.0 && dt <= limit { Ok(()) } else { Err(StepError { dt, limit }) }
    }

    /// The largest of the contacts' natural frequency ω_max and damping rate \[1/s\] at `states`: of M⁻¹K and M⁻¹D, with
    /// the symmetric parts of the contacts' stiffness K and damping D; NaN for states that are.
    ///
    /// # Panics
    /// If there are fewer states than bodies.
    pub fn contact_frequency(&self, states: &[State]) -> f64 {
        let free = self.free_bodies();
        let size = 6 * free.len();
        let (mut stiffness, mut damping) = (DMatrix::zeros(size, size), DMatrix::zeros(size, size));
        let lifted = self.with_touching(states, 0.0).plain().lift::<Fwd<12>>();
        let constants: Vec<State<Fwd<12>>> = states.iter().map(State::lift).collect();
        let roots: Vec<Matrix6<f64>> =
            free.iter().map(|&body| self.inverse_mass_root(body, &states[body])).collect();
        for (column, &body) in free.iter().enumerate() {
            let mut states = constants.clone();
            states[body] = states[body].value().variables();
            let wrenches = lifted.wrenches(&states, 0);
            for (row, &other) in free.iter().enumerate() {
                let block = |from: usize| {
                    let slopes = Matrix6::from_fn(|i, j| wrenches[other][i].derivative[from + j]);
                    -(roots[row] * slopes * roots[column])
                };
                stiffness.view_mut((6 * row, 6 * column), (6, 6)).copy_from(&block(0));
                damping.view_mut((6 * row, 6 * column), (6, 6)).copy_from(&block(6));
            }
        }
        let largest = |m: DMatrix<f64>| {
            if m.iter().any(|x| x.is_nan()) {
                return f64::NAN;
            }
            let symmetric = (&m + m.transpose()) * 0.5;
            symmetric.symmetric_eigenvalues().iter().fold(0.0, |a: f64, b| a.max(*b))
        };
        if size == 0 {
            return 0.0;
        }
        let (stiffness, damping) = (largest(stiffness), largest(damping));
        // Bristles are springs behind the damping of friction.
        let bristles = self.sticking().map(|(_, bristles)| bristles.fastest()).fold(0.0, f64::max);
        let fastest = if damping > 0.0 { damping.max(bristles) } else { damping };
        let frequency = (stiffness + damping * bristles).sqrt();
        if frequency.is_nan() { frequency } else { fastest.max(frequency) }
    }

    /// The root of the inverse mass matrix of a free body.
    fn inverse_mass_root(&self, body: BodyId, state: &State) -> Matrix6<f64> {
        let Some(rigid) = self.bodies[body].rigid() else { return Matrix6::zeros() };
        let mut root = Matrix6::identity() / rigid.mass().sqrt();
        let eigen = rigid.inverse_world_inertia(&state.pose.rotation).symmetric_eigen();
        let turn = eigen.eigenvectors
            * Matrix3::from_diagonal(&eigen.eigenvalues.map(|x| x.max(0.0).sqrt()))
            * eigen.eigenvectors.transpose();
        root.fixed_view_mut::<3, 3>(3, 3).copy_from(&turn);
        root
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Isometry3, Point3, Vector3};

    use super::*;
    use crate::scenes::{floor, on_ground, penalty};
    use crate::{Body, GapSmoothing, RigidBody, SemiImplicitEuler, Surface, TimeSteps};

    #[test]
    fn frequency_of_a_point_mass_on_a_spring() {
        let rigid = RigidBody::new(0.5, Matrix3::identity(), Point3::origin()).unwrap();
        let surface = Surface::new(&[Point3::origin()], &[1e-4]).unwrap();
        let mass = Body::free("mass", rigid).with_surface(surface);
        let law = Arc::new(penalty(2e8, 1e3, 0.0, 1e-3));
        let world = on_ground(Vector3::zeros(), floor(), mass, law, GapSmoothing::Hard);
        let at_rest = |z| State::at_rest(Isometry3::translation(0.0, 0.0, z));
        let states = [at_rest(0.0), at_rest(-1e-3)];
        let omega = 200.0;
        assert!((world.contact_frequency(&states) - omega).abs() < 1e-9);
        let check = |dt| world.check_time_step(&SemiImplicitEuler, &states, dt);
        assert_eq!(check(6.1e-3), Ok(()));
        let error = check(7e-3).unwrap_err();
        assert!((error.limit - 6.18e-3).abs() < 1e-12);
        let fine = TimeSteps { dt: 7e-3, steps: 10 }.refined(error.limit, 100);
        assert_eq!((fine.steps, check(fine.dt)), (12, Ok(())));
        assert_eq!(world.contact_frequency(&[at_rest(0.0), at_rest(1.0)]), 0.0);
    }
}
