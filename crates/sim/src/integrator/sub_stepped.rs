//! Steps that are divided where contacts are too stiff for them.

use nalgebra::Vector6;
use prehend_autodiff::Scalar;

use super::Integrator;
use crate::body_state::{BodyState, Rows};
use crate::error::{Result, SimulationError};
use crate::model::Model;
use crate::model::body::Body;
use crate::state::State;
use crate::time::Step;

/// Another integrator, each step of which is divided as far as stiffness and damping of the contacts demand.
///
/// The fastest of the contacts (see [`Model::contact_frequency`]) is looked for at the start of the step and where
/// the bodies would drift in it, so that impacts are foreseen. Steps are then as short as
/// [`Integrator::stability_limit`] allows, with a margin of a fifth. A step whose equations an implicit integrator
/// does not solve is divided into twice as many.
///
/// The division is chosen by values only: derivatives are exact for the steps that are taken, and ignore that
/// other steps might be. Contacts that leak in the first step of a rollout leak in the first part of it.
///
/// ```
/// use nalgebra::Vector3;
/// use prehend_sim::{Body, RigidBody, SemiImplicitEuler, TimeSteps, Model, integrator::SubStepped};
///
/// let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
/// model.add(Body::dynamic("stone", RigidBody::ball(1.0, 0.05)?));
/// let start = model.neutral_state();
/// let integrator = SubStepped { integrator: SemiImplicitEuler, max_substeps: 32 };
/// let run = model.rollout_with(&integrator, &start, TimeSteps { dt: 1e-2, steps: 100 })?.states;
/// assert!((run[100][0].linear.z + 9.81).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SubStepped<I> {
    /// Integrator of the substeps.
    pub integrator: I,
    /// Substeps of a step at most; 0 counts as 1.
    pub max_substeps: usize,
}

/// Fraction of the stability limit that is used.
const MARGIN: f64 = 0.8;

impl<I: Integrator> SubStepped<I> {
    fn divided<S: Scalar>(
        &self,
        model: &Model<S>,
        state: &State<S>,
        step: Step,
        parts: usize,
    ) -> Result<State<S>> {
        let mut state = state.clone();
        for part in step.parts(parts) {
            state = self.integrator.step(model, &state, part)?;
            state.time = part.end();
            model.update_kinematics(&mut state);
        }
        Ok(state)
    }

    /// Number of substeps that the contacts demand.
    fn demanded<S: Scalar>(&self, model: &Model<S>, states: &Rows<S>, dt: f64) -> f64 {
        let limit = self.integrator.stability_limit();
        if limit.is_infinite() {
            return 1.0;
        }
        let plain = model.to_f64();
        let now: Vec<BodyState> = states.iter().map(BodyState::value).collect();
        let drift = |(body, state): (&Body, &BodyState)| {
            let mut falling = *state;
            if let Some(rigid) = body.rigid() {
                let pull = body.external_wrench.fixed_rows::<3>(0) / rigid.mass();
                falling.linear += (plain.gravity + pull) * dt;
            }
            falling.drifted(dt)
        };
        let mut then: Vec<BodyState> = plain.bodies.iter().zip(&now).map(drift).collect();
        then.extend_from_slice(&now[then.len()..]);
        plain.integrate_joints(&mut then, &vec![Vector6::zeros(); now.len()], dt);
        plain.forward_kinematics(&mut then);
        let fastest = plain.contact_frequency_of(&now).max(plain.contact_frequency_of(&then));
        (dt * fastest / (MARGIN * limit)).ceil().max(1.0)
    }
}

impl<I: Integrator> Integrator for SubStepped<I> {
    fn step<S: Scalar>(&self, model: &Model<S>, state: &State<S>, step: Step) -> Result<State<S>> {
        let needed = self.demanded(model, state.rows(), step.dt);
        let max_substeps = self.max_substeps.max(1);
        if needed.is_nan() || needed > max_substeps as f64 {
            let (step, time) = (step.index, step.start);
            let (body, contact) = model.most_accelerated(state.rows());
            return Err(SimulationError::SubSteps {
                step,
                time,
                body,
                contact,
                needed,
                max_substeps,
            });
        }
        let mut parts = needed as usize;
        loop {
            match self.divided(model, state, step, parts) {
                Err(SimulationError::Unsolved { .. }) if 2 * parts <= max_substeps => parts *= 2,
                // Parts have numbers of their own.
                Err(mut error) => {
                    if let SimulationError::Unsolved { step: part, .. } = &mut error {
                        *part = step.index;
                    }
                    return Err(error);
                }
                done => return done,
            }
        }
    }

    fn check_differentiable<S: Scalar>(&self, model: &Model<S>) -> Result<()> {
        self.integrator.check_differentiable(model)
    }

    fn controls_error(&self) -> bool {
        self.integrator.controls_error()
    }

    fn stability_limit(&self) -> f64 {
        MARGIN * self.integrator.stability_limit() * self.max_substeps.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::{egg_on, floor};
    use crate::{GapSmoothing, RungeKutta4, SemiImplicitEuler, TimeSteps};

    #[test]
    fn impacts_are_foreseen_and_flights_are_not_divided() {
        let (model, mut states) = egg_on(floor(), GapSmoothing::Hard);
        states[1].pose.translation.z += 1e-3;
        states[1].linear.z = -0.5;
        let step = Step::new(2, 1e-2);
        let parts = |states: &State| {
            let euler = SubStepped { integrator: SemiImplicitEuler, max_substeps: 1000 };
            euler.demanded(&model, states.bodies(), step.dt)
        };
        let impact = parts(&states);
        assert!(impact > 2.0 && model.contact_frequency(&states) == 0.0, "{impact}");
        let divided = SubStepped { integrator: SemiImplicitEuler, max_substeps: impact as usize };
        let done = divided.step(&model, &states, step).unwrap();
        let fine = TimeSteps { dt: step.dt / impact, steps: impact as usize };
        let expected = model.simulate_with(&SemiImplicitEuler, &states, fine).unwrap().states;
        assert_eq!(done.bodies(), expected.bodies());
        let too_few = SubStepped { max_substeps: impact as usize - 1, ..divided };
        assert_eq!(
            too_few.step(&model, &states, step).unwrap_err(),
            SimulationError::SubSteps {
                step: 2,
                time: 0.02,
                body: "egg".to_owned(),
                contact: Some("ground".to_owned()),
                needed: impact,
                max_substeps: impact as usize - 1
            }
        );
        let wider = SubStepped { integrator: RungeKutta4, max_substeps: 1000 };
        assert!(wider.demanded(&model, states.bodies(), step.dt) < impact);
        states[1].pose.translation.z += 0.1;
        assert_eq!(parts(&states), 1.0);
    }
}
