//! Tests whether the steps of a simulation were short enough.

mod energy;
mod step_resolution;
mod tunneling;

use std::fmt;

use prehend_autodiff::Scalar;

use crate::body_state::Rows;
use crate::error::Result;
use crate::handle::BodyId;
use crate::model::Model;
use crate::state::State;
use crate::time::Step;
use energy::EnergyBalance;
use step_resolution::StepResolution;
use tunneling::Tunneling;

/// Roughness up to which a simulation is resolved.
const FINE: f64 = 0.1;

/// Resolution of a simulation's contacts by its steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Resolution {
    /// Steps that were asked for; an integrator may divide them.
    pub steps: usize,
    /// By how much the accelerations by contacts changed from one step to the next, relative to them, both as root mean squares
    /// over the steps: about dt·ω for the fastest rate ω at which contacts do anything, √2 for an impact within one step.
    /// Derivatives of a method of first order are off by about as much. Joints count with all of their accelerations. None if the integrator holds its error itself.
    pub roughness: Option<f64>,
    /// The body with the largest such change, and when \[s\]; none if nothing touched.
    pub roughest: Option<(String, f64)>,
    /// The first body that passed through another within a step, that other one, and when \[s\]: contacts that were missed. An integrator that holds its error
    /// takes shorter steps instead.
    pub passed: Option<(String, String, f64)>,
}

impl Resolution {
    /// True if the steps were short enough, for values and derivatives: a roughness of no more than 0.1, and no contact missed.
    pub fn is_fine(&self) -> bool {
        self.passed.is_none() && self.roughness.is_none_or(|roughness| roughness <= FINE)
    }
}

impl fmt::Display for Resolution {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let steps = self.steps;
        if let Some((body, other, time)) = &self.passed {
            return write!(
                f,
                "{steps} steps, too long for contacts: '{body}' passed through '{other}' at {time:.4} s"
            );
        }
        let Some(roughness) = self.roughness else {
            return write!(f, "{steps} steps of an integrator that holds its error");
        };
        let percent = 100.0 * roughness;
        write!(f, "{steps} steps, contact forces change by {percent:.1} % from one to the next")?;
        match &self.roughest {
            Some((body, time)) if !self.is_fine() => {
                write!(f, ", most on '{body}' at {time:.4} s: too long for derivatives")
            }
            _ => Ok(()),
        }
    }
}

/// Follows a simulation from step to step.
pub(crate) struct Diagnostics<'a, S: Scalar> {
    model: &'a Model<S>,
    /// None if the integrator holds its error itself.
    roughness: Option<StepResolution>,
    tunneling: Option<Tunneling>,
    /// None where energy may come from anywhere.
    energy: Option<EnergyBalance>,
}

impl<'a, S: Scalar> Diagnostics<'a, S> {
    /// Diagnostics of a simulation from `initial` by an integrator that `controls_error` or not, of which contacts may bring no energy if it `is_passive`.
    pub(crate) fn new(
        model: &'a Model<S>,
        initial: &Rows<S>,
        controls_error: bool,
        is_passive: bool,
    ) -> Self {
        let roughness = (!controls_error).then(|| StepResolution::new(model, initial));
        let tunneling = (!controls_error).then(|| Tunneling::new(model, initial));
        let energy = is_passive.then(|| EnergyBalance::new(model, initial, controls_error));
        Self { model, roughness, tunneling, energy }
    }

    /// After `step` has led to `states`.
    ///
    /// # Errors
    /// If contacts have made energy.
    pub(crate) fn step(&mut self, step: Step, states: &Rows<S>) -> Result<()> {
        if let Some(roughness) = &mut self.roughness {
            roughness.step(step, states);
        }
        if let Some(tunneling) = &mut self.tunneling {
            tunneling.step(self.model, step, states);
        }
        self.energy.as_mut().map_or(Ok(()), |energy| energy.step(self.model, step, states))
    }

    /// Report on a number of steps that have led to `state`.
    ///
    /// # Errors
    /// If contacts have made energy, or velocities are too large to be squared.
    pub(crate) fn finish(mut self, steps: usize, state: &State<S>) -> Result<Resolution> {
        let (time, states) = (state.time, state.rows());
        if let Some(energy) = &mut self.energy {
            energy.check(self.model, time, states)?;
        }
        let roughness = self.roughness.as_ref().map(StepResolution::mean);
        if roughness.is_some_and(|roughness| !roughness.is_finite()) {
            return Err(self.model.blown_up(states, time));
        }
        let name = |body: BodyId| self.model.bodies[body].name.clone();
        let roughest = self.roughness.as_ref().and_then(StepResolution::roughest);
        Ok(Resolution {
            steps,
            roughness,
            roughest: roughest.map(|(body, time)| (name(body), time)),
            passed: self
                .tunneling
                .as_ref()
                .and_then(Tunneling::first)
                .map(|(bodies, time)| (name(bodies.samples), name(bodies.field), time)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tells_how_fine_steps_were_and_which_body_moved_most() {
        let said = |roughness, body: &str| {
            let roughest = Some((body.to_owned(), 0.5));
            Resolution { steps: 40, roughness, roughest, passed: None }.to_string()
        };
        assert_eq!(said(None, "mug"), "40 steps of an integrator that holds its error");
        let fine = "40 steps, contact forces change by 2.0 % from one to the next";
        assert_eq!(said(Some(0.02), "mug"), fine);
        let coarse = "40 steps, contact forces change by 30.0 % from one to the next, most on 'mug' at 0.5000 s: too long for derivatives";
        assert_eq!(said(Some(0.3), "mug"), coarse);
    }
}
