//! Springs that hold two frames together, and so close loops.

use nalgebra::{Isometry3, Translation3, Vector3, Vector6};
use prehend_autodiff::lie::{lift, so3_log};
use prehend_autodiff::{Fwd, LocalFunction, Scalar};

use super::Model;
use crate::body_state::{BodyState, Rows, STATE};
use crate::error::{BuildError, Result, SimulationError};
use crate::first_order::{Linearized, first_order, linearized};
use crate::handle::{BodyId, BushingId};
use crate::spatial::spatial;

/// A soft bushing of two bodies, or a soft ball joint: springs and dampers between a frame of one and a frame of the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bushing<S: Scalar = f64> {
    /// The bodies.
    pub bodies: [BodyId; 2],
    /// Their frames, each in its body's body frame \[m\].
    pub frames: [Isometry3<f64>; 2],
    /// Stiffness and damping.
    pub stiffness: BushingStiffness<S>,
}

/// Stiffness and damping of a [`Bushing`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BushingStiffness<S: Scalar = f64> {
    /// Force by distance of the frames' origins \[N/m\].
    pub linear: S,
    /// Force by the rate of that \[N s/m\].
    pub linear_damping: S,
    /// Torque by the angle between the frames \[N m/rad\]; with this and the next 0 they turn freely, as in a ball joint.
    pub angular: S,
    /// Torque by the rate of that \[N m s/rad\].
    pub angular_damping: S,
}

impl BushingStiffness {
    /// Critically damped, so that a displacement of what weighs `mass` \[kg\] and has `inertia` \[kg m²\] decays in `time` \[s\]. With an inertia of 0
    /// the frames turn freely. Infinite for a time of 0, which [`Model::add_bushing`] refuses.
    pub fn critical(mass: f64, inertia: f64, time: f64) -> Self {
        let [linear, angular] = [mass, inertia].map(|m| m / (time * time));
        let [linear_damping, angular_damping] = [mass, inertia].map(|m| 2.0 * m / time);
        Self { linear, linear_damping, angular, angular_damping }
    }
}

impl<S: Scalar> BushingStiffness<S> {
    pub(crate) fn numbers(&self) -> [S; 4] {
        [self.linear, self.linear_damping, self.angular, self.angular_damping]
    }

    pub(crate) fn of([linear, linear_damping, angular, angular_damping]: [S; 4]) -> Self {
        Self { linear, linear_damping, angular, angular_damping }
    }
}

impl<S: Scalar> Bushing<S> {
    pub(super) fn map<T: Scalar>(&self, f: impl Fn(S) -> T) -> Bushing<T> {
        let stiffness = BushingStiffness::of(self.stiffness.numbers().map(f));
        Bushing { bodies: self.bodies, frames: self.frames, stiffness }
    }

    /// Checks stiffness and damping.
    ///
    /// # Errors
    /// If one is negative or not finite.
    pub(crate) fn check(&self) -> Result<(), BuildError> {
        let mut values = self.stiffness.numbers().into_iter().map(|x| x.value());
        match values.find(|value| !(value.is_finite() && *value >= 0.0)) {
            Some(value) => Err(BuildError::BushingStiffness { value }),
            None => Ok(()),
        }
    }

    /// Bushing of other bodies.
    pub(crate) fn with_bodies(self, body: impl Fn(BodyId) -> BodyId) -> Self {
        Self { bodies: self.bodies.map(body), ..self }
    }
}

impl Model {
    /// Adds a bushing.
    ///
    /// # Errors
    /// If there is no such body, or both are the same; if a stiffness or damping is negative or not finite.
    pub fn add_bushing(&mut self, bushing: Bushing) -> Result<BushingId, BuildError> {
        for body in bushing.bodies {
            self.body(body)?;
        }
        if bushing.bodies[0] == bushing.bodies[1] {
            let body = self.bodies[bushing.bodies[0]].name.clone();
            return Err(BuildError::Itself { body });
        }
        bushing.check()?;
        self.bushings.push(bushing);
        Ok(BushingId(self.bushings.len() - 1))
    }
}

impl<S: Scalar> Model<S> {
    /// # Errors
    /// If there are bushings, of which `integrator` knows nothing.
    pub(crate) fn ensure_no_bushings(&self, integrator: &'static str) -> Result<()> {
        match self.bushings.is_empty() {
            true => Ok(()),
            false => Err(SimulationError::Bushings { integrator }),
        }
    }

    /// The bushing `id`, to be changed.
    ///
    /// # Panics
    /// If it is of another model.
    pub fn bushing_mut(&mut self, id: BushingId) -> &mut Bushing<S> {
        &mut self.bushings[id.0]
    }

    /// Adds what bushings do to the wrenches on the bodies.
    pub(super) fn add_bushings(&self, states: &Rows<S>, wrenches: &mut [Vector6<S>]) {
        for bushing in &self.bushings {
            // Where a center of mass varies, of the point that has its value for coordinates.
            let shifted = bushing.bodies.map(|body| self.shifted(body, states));
            let ends = [0, 1].map(|end| match &shifted[end] {
                Some((state, _)) => state,
                None => &states[bushing.bodies[end]],
            });
            let both = self.pull(bushing, ends, bushing.stiffness.numbers());
            for ((body, wrench), shifted) in bushing.bodies.into_iter().zip(both).zip(&shifted) {
                wrenches[body] += wrench;
                if let Some((_, from_com)) = shifted {
                    let force = wrench.fixed_rows::<3>(0).into_owned();
                    wrenches[body] += spatial(&Vector3::zeros(), &from_com.cross(&force));
                }
            }
        }
    }

    /// Wrenches of a bushing of this stiffness on both bodies in these states.
    pub(crate) fn pull<T: Scalar>(
        &self,
        bushing: &Bushing<S>,
        states: [&BodyState<T>; 2],
        stiffness: [T; 4],
    ) -> [Vector6<T>; 2] {
        let pull = Pull { frames: self.frames_from_com(bushing) };
        let mut x = [T::zero(); INPUTS];
        x[..STATE].copy_from_slice(&states[0].coordinates());
        x[STATE..2 * STATE].copy_from_slice(&states[1].coordinates());
        x[2 * STATE..].copy_from_slice(&stiffness);
        let both = T::local(&pull, x);
        [0, 6].map(|from| Vector6::from_column_slice(&both[from..from + 6]))
    }

    /// The frames of a bushing, from the centers of mass.
    fn frames_from_com(&self, bushing: &Bushing<S>) -> [Isometry3<f64>; 2] {
        std::array::from_fn(|end| {
            let com = self.bodies[bushing.bodies[end]].com().coords.map(S::value);
            Translation3::from(-com) * bushing.frames[end]
        })
    }

    /// Energy of the springs of bushings at `states` \[J\].
    pub(crate) fn energy_of_bushings(&self, states: &Rows) -> f64 {
        let energy = |bushing: &Bushing<S>| {
            let [a, b] = bushing.bodies.map(|body| states[body]);
            let Gap { apart, turn, .. } = Gap::new(&self.frames_from_com(bushing), &a, &b);
            let [linear, _, angular, _] = bushing.stiffness.numbers().map(S::value);
            0.5 * (linear * apart.norm_squared() + angular * turn.norm_squared())
        };
        self.bushings.iter().map(energy).sum()
    }
}

/// Two states and four numbers.
const INPUTS: usize = 2 * STATE + 4;

/// Displacement between two frames.
struct Gap<S: Scalar> {
    /// From the centers of mass to the origin of the first frame \[m\].
    arms: [Vector3<S>; 2],
    /// From the first to the second origin \[m\].
    apart: Vector3<S>,
    /// The turn from the first to the second \[rad\].
    turn: Vector3<S>,
}

impl<S: Scalar> Gap<S> {
    fn new(frames: &[Isometry3<f64>; 2], a: &BodyState<S>, b: &BodyState<S>) -> Self {
        let [first, second] = [(a, frames[0]), (b, frames[1])].map(|(s, f)| s.pose * lift(&f));
        let [from, to] = [first, second].map(|frame| frame.translation.vector);
        Self {
            arms: [a, b].map(|state| from - state.pose.translation.vector),
            apart: to - from,
            turn: so3_log(&(second.rotation * first.rotation.inverse())),
        }
    }
}

/// The wrenches on both bodies. Rates are as the second sees them, and both forces act at the first frame's origin, so that nothing is pushed or
/// turned by itself.
struct Pull {
    frames: [Isometry3<f64>; 2],
}

impl LocalFunction<INPUTS, 12> for Pull {
    #[inline]
    fn evaluate<S: Scalar>(&self, x: [S; INPUTS]) -> [S; 12] {
        match S::ORDER {
            0 => self.wrenches(&x.map(S::value)).map(S::constant),
            _ => first_order(&self.derivatives(x.map(S::value)), &x),
        }
    }

    fn linearize(&self, x: [f64; INPUTS]) -> Option<Linearized<INPUTS, 12>> {
        Some(self.derivatives(x))
    }

    fn derivative_along(
        &self,
        x: [f64; INPUTS],
        along: [f64; INPUTS],
    ) -> Option<([f64; 12], [f64; 12])> {
        let x = std::array::from_fn(|i| Fwd { value: x[i], derivative: [along[i]] });
        let results = self.wrenches::<Fwd<1>>(&x);
        Some((results.map(|y| y.value), results.map(|y| y.derivative[0])))
    }
}

impl Pull {
    fn derivatives(&self, x: [f64; INPUTS]) -> Linearized<INPUTS, 12> {
        linearized(self.wrenches(&Fwd::variables(x)))
    }

    fn wrenches<S: Scalar>(&self, x: &[S; INPUTS]) -> [S; 12] {
        let state =
            |from: usize| BodyState::from_coordinates(&std::array::from_fn(|i| x[from + i]));
        let (a, b): (BodyState<S>, BodyState<S>) = (state(0), state(STATE));
        let [linear, linear_damping, angular, angular_damping] =
            std::array::from_fn(|i| x[2 * STATE + i]);
        let Gap { arms, apart, turn } = Gap::new(&self.frames, &a, &b);
        // The first origin's velocity and that of the second body there.
        let [velocity, other] = [(&a, arms[0]), (&b, arms[1])]
            .map(|(state, arm)| state.linear + state.angular.cross(&arm));
        let force = apart * linear + (other - velocity) * linear_damping;
        let torque = turn * angular + (b.angular - a.angular) * angular_damping;
        let on_first = spatial(&force, &(torque + arms[0].cross(&force)));
        let on_second = spatial(&-force, &-(torque + arms[1].cross(&force)));
        std::array::from_fn(|i| if i < 6 { on_first[i] } else { on_second[i - 6] })
    }
}
