//! A scene, what it is differentiated by, and what is looked at in the end.

use prehend_autodiff::Scalar;
use prehend_sim::{Integrator, Model, Simulation, SimulationError, State, TimeSteps};

/// A number of the scene.
#[derive(Clone, Copy)]
pub(crate) enum Input {
    /// A coordinate of a body's initial state, in the order of [`BodyState::tangent`].
    Start(usize, usize),
    /// A parameter of a contact's law.
    Law(usize, usize),
}

/// A number of the last states.
#[derive(Clone, Copy)]
pub(crate) enum Output {
    /// A coordinate of a body's center of mass \[m\].
    Position(usize, usize),
    /// A coordinate of its velocity \[m/s\].
    Velocity(usize, usize),
    /// Turn of a body about z \[rad\], less than half of one.
    Yaw(usize),
}

pub(crate) struct Scene {
    pub(crate) name: &'static str,
    pub(crate) model: Model,
    pub(crate) start: State,
    /// How long it takes \[s\].
    pub(crate) time: f64,
    pub(crate) input: Input,
    pub(crate) output: Output,
    /// A change of the input after which the output is still nearly linear.
    pub(crate) nudge: f64,
    /// A step for semi-implicit Euler that is too long \[s\].
    pub(crate) bad_step: f64,
}

impl Scene {
    /// The output by `integrator` in `steps` equal steps, with the input changed by `change`.
    pub(crate) fn run<S: Scalar>(
        &self,
        integrator: &impl Integrator,
        steps: usize,
        change: S,
    ) -> Result<Simulation<S>, SimulationError> {
        let mut model = self.model.cast::<S>();
        let mut start: State<S> = self.start.cast();
        match self.input {
            Input::Start(body, coordinate) => {
                let mut tangent = [S::zero(); 12];
                tangent[coordinate] = change;
                start[body] = self.start[body].retract(&tangent);
            }
            Input::Law(contact, parameter) => {
                model.contacts[contact].params_mut()[parameter] += change;
            }
        }
        let time_steps = TimeSteps { dt: self.time / steps as f64, steps };
        let Simulation { states, resolution } =
            model.simulate_with(integrator, &start, time_steps)?;
        let states = match self.output {
            Output::Position(body, axis) => states[body].pose.translation.vector[axis],
            Output::Velocity(body, axis) => states[body].linear[axis],
            Output::Yaw(body) => {
                let [_, _, k, w] = states[body].pose.rotation.coords.into();
                k.atan2(w).times(2.0)
            }
        };
        Ok(Simulation { states, resolution })
    }
}
