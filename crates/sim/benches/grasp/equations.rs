//! The law and the step that all simulators compared have in common.

use nalgebra::{Quaternion, Unit, UnitQuaternion, Vector3, Vector6};
use prehend_autodiff::Scalar;
use prehend_sim::contact::regularized_coulomb;
use prehend_sim::{
    BodyState, ContactForce, ContactKinematics, ContactLaw, Integrator, Model, RigidBody,
    SimulationError, State, Step,
};

/// Stiffness \[N/m\], damping on approach \[N s/m\] and friction coefficient of a sample.
pub(super) struct SmoothedPenalty([f64; 3]);

impl SmoothedPenalty {
    /// The law of one of `count` samples.
    pub(super) fn shared_by(count: usize) -> Self {
        let share = 10.0 / count as f64;
        Self([2e3 * share, 4.0 * share, 0.5])
    }
}

impl ContactLaw for SmoothedPenalty {
    #[inline]
    fn params(&self) -> &[f64] {
        &self.0
    }

    #[inline]
    fn law<S: Scalar>(&self, p: &[S], contact: &ContactKinematics<S>) -> ContactForce<S> {
        let speed = contact.normal_speed;
        let approach = speed.select(speed.value() < 0.0, S::zero());
        let normal = -(p[0] * contact.gap + p[1] * approach);
        ContactForce { normal, tangential: regularized_coulomb(p[2], normal, &contact.slip, 1e-2) }
    }

    fn cutoff(&self) -> f64 {
        0.0
    }
}

/// Semi-implicit Euler: Euler's equations in the body's frame, the quaternion advanced by its rate and normalized.
pub(crate) struct FirstOrder;

impl Integrator for FirstOrder {
    fn evaluates_forces_once(&self) -> bool {
        true
    }

    fn step<S: Scalar>(
        &self,
        model: &Model<S>,
        states: &State<S>,
        step: Step,
    ) -> Result<State<S>, SimulationError> {
        let wrenches = model.wrenches(states, step.index);
        let bodies = model.bodies.iter().zip(states.bodies()).zip(&wrenches);
        let next = bodies.map(|((body, state), wrench)| match body.rigid() {
            Some(rigid) => advance(rigid, &model.gravity, state, wrench, step.dt),
            None => *state,
        });
        Ok(State::new(next.collect::<Vec<_>>()))
    }
}

fn advance<S: Scalar>(
    body: &RigidBody<S>,
    gravity: &Vector3<S>,
    state: &BodyState<S>,
    wrench: &Vector6<S>,
    dt: f64,
) -> BodyState<S> {
    let (force, torque) = (wrench.fixed_rows::<3>(0), wrench.fixed_rows::<3>(3).into_owned());
    let mut next = *state;
    next.linear += (force / body.mass() + gravity).map(|a| a.times(dt));
    next.pose.translation.vector += next.linear.map(|v| v.times(dt));
    let q: UnitQuaternion<S> = state.pose.rotation;
    let spin = q.inverse_transform_vector(&state.angular);
    let inertia = body.inertia().diagonal();
    let torque = q.inverse_transform_vector(&torque) - spin.cross(&inertia.component_mul(&spin));
    next.angular = q * (spin + torque.component_div(&inertia).map(|a| a.times(dt)));
    let rate = Quaternion::from_imag(next.angular) * q.into_inner();
    let turned = q.into_inner().coords + rate.coords.map(|r| r.times(0.5 * dt));
    next.pose.rotation = Unit::new_normalize(Quaternion::from(turned));
    next
}
