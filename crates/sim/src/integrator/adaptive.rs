//! The default integrator: steps as long as their error allows.

mod error_norm;
mod islands;
mod schedule;
mod sensitivity;
mod step_limiter;
mod substep_controller;
mod touch_time;
mod windows;

use prehend_autodiff::Scalar;
#[cfg(doc)]
use prehend_geometry::DistanceField;

use super::Integrator;
use crate::error::{Result, SimulationError};
use crate::model::Model;
use crate::state::State;
use crate::time::Step;

/// Dormand and Prince's method of fifth order with steps that it chooses: what [`Model::simulate`] uses.
///
/// Each step of a rollout is divided until the estimated error of every substep is within the tolerances. Two errors are held:
/// that of the states, and that of a *sensitivity*, the derivative of the states along a direction drawn at the start of
/// the step. A substep that resolves the motion may well be too long for its derivatives, where friction or damping decays
/// within it; the sensitivity says so. Both estimates hold across kinks, such as the onset of a contact that is shorter than
/// the substep or a damper that stops pulling, so that substeps shrink until what is left of the kink is tolerated.
///
/// Through a bounce of a ball that would rest 0.5 mm, 50 µm or 5 µm deep, derivatives are within 0.05 % of converged ones;
/// `cargo test -p prehend-sim --test it defaults -- --nocapture` prints how near they are, there and in other scenes. A chain of
/// impacts multiplies errors as it does all else. For tighter ones set both tolerances: that of the states alone is not one of
/// their derivatives.
///
/// Where samples touch or let go of a contact without smoothing, substeps end just before, and a tiny one goes over it. None is so long that a contact could be passed over: no
/// sample moves by more than its clearance and either a fifth of its body's size or a quarter of the thickness of what it touches
/// ([`DistanceField::thickness`]), whichever is less; nor does one that moves by more than a fiftieth of its body's size touch in
/// between, as the cubic of its gap tells. What is pressed past the middle of a
/// thin body is an error ([`SimulationError::PassedThrough`]). Trajectories of kinematic bodies are
/// looked at every millisecond for that; what one does and undoes within a millisecond may be missed.
///
/// Contacts that leak in the first step of a rollout ([`LeakSteps::First`](crate::contact::LeakSteps::First)) leak in its first
/// substep, whose length is not known beforehand: leaks on every step, or a fixed step, have more of a meaning.
///
/// Substeps are chosen by values alone, so that they are the same whatever the scalar. Derivatives are those of the substeps that
/// were taken.
///
/// No step is short enough for derivatives through a force that jumps at touch, such as damping that acts before there is
/// penetration, since the time of touch has a derivative too. Such a contact is an error where derivatives are asked for:
/// let the force fade in ([`GapSmoothing::Softplus`](crate::GapSmoothing::Softplus)), or take a law whose damping grows
/// with penetration ([`HuntCrossley`](crate::HuntCrossley)).
///
/// ```
/// use nalgebra::Vector3;
/// use prehend_sim::{Adaptive, Body, RigidBody, TimeSteps, Model};
///
/// let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
/// model.add(Body::dynamic("stone", RigidBody::ball(1.0, 0.05)?));
/// let start = model.neutral_state();
/// let tight = Adaptive { tolerance: 1e-10, sensitivity_tolerance: 1e-9, ..Adaptive::default() };
/// let run = model.rollout_with(&tight, &start, TimeSteps { dt: 0.1, steps: 10 })?.states;
/// assert!((run[10][0].linear.z + 9.81).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adaptive {
    /// Error of a part of a step, the largest of δx/r, δφ, δv/u and r δω/u over the bodies, with the errors of position, rotation,
    /// velocity and angular velocity, the body's radius of gyration r and u = v + √(a r) + v_max/10 for its speed v (that of its
    /// points within r), its acceleration a without contacts, and the fastest body's speed v_max. Positive.
    pub tolerance: f64,
    /// Error of the sensitivity in a part of a step, in the same units: that of positions relative to the sensitivity's largest
    /// component S, that of velocities relative to the largest of these, or to S/10 if that is more. Positive. A kink that no substep is
    /// too short for may be off by 10⁻³.
    pub sensitivity_tolerance: f64,
    /// Substeps of a step at most.
    pub max_substeps: usize,
}

impl Adaptive {
    fn check(&self) -> Result<()> {
        let settings = [
            ("Adaptive::tolerance", self.tolerance),
            ("Adaptive::sensitivity_tolerance", self.sensitivity_tolerance),
        ];
        let positive = |value: f64| value > 0.0 && value.is_finite();
        match settings.into_iter().find(|(_, value)| !positive(*value)) {
            Some((setting, value)) => {
                Err(SimulationError::Setting { setting, range: "positive and finite", value })
            }
            None => Ok(()),
        }
    }
}

impl Default for Adaptive {
    /// 5·10⁻⁶ for states, 2·10⁻⁵ for sensitivities, a million substeps.
    fn default() -> Self {
        Self { tolerance: 5e-6, sensitivity_tolerance: 2e-5, max_substeps: 1_000_000 }
    }
}

impl Integrator for Adaptive {
    /// # Errors
    /// If a tolerance is not positive; if a contact's force jumps at touch and derivatives are asked for; where a body passes
    /// through another; where steps would have to be too short or too many; where a state stops being finite.
    fn step<S: Scalar>(&self, model: &Model<S>, state: &State<S>, step: Step) -> Result<State<S>> {
        self.check()?;
        if S::ORDER > 0 {
            self.check_differentiable(model)?;
        }
        Ok(state.with(windows::step(self, model, state.rows(), step)?, step.end()))
    }

    fn finds_contacts(&self) -> bool {
        true
    }

    fn check_differentiable<S: Scalar>(&self, model: &Model<S>) -> Result<()> {
        model.check_onsets()
    }

    fn stability_limit(&self) -> f64 {
        f64::INFINITY
    }

    fn controls_error(&self) -> bool {
        true
    }
}
