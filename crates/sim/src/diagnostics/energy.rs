//! Tests whether contacts make energy.

use nalgebra::Vector3;
use prehend_autodiff::Scalar;

use crate::articulated::{Articulation, Energy};
use crate::body_state::{BodyState, Rows};
use crate::contact::bristles::Bristles;
use crate::contact::point::ContactKinematics;
use crate::error::{Result, SimulationError};
use crate::handle::BodyId;
use crate::model::Model;
use crate::model::body::{Body, Motion};
use crate::model::contact_pair::ContactPair;
use crate::model::joint_force::JointForce;
use crate::spatial::spatial;
use crate::time::Step;

/// Part of the largest kinetic energy that contacts may seem to have made: methods of first order are off by as much where they
/// are still of use.
const TOLERANCE: f64 = 0.25;

/// Steps from one look at the energy to the next.
const EVERY: usize = 16;

/// The energy of no links.
const NOTHING: Energy = Energy { kinetic: 0.0, potential: 0.0 };

/// Parts of a joint's way over which the work of what acts along it is summed.
const PARTS: usize = 200;

/// Nodes and weights of Gauss's quadrature with five points on 0..1.
const GAUSS: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_095),
    (0.230_765_344_947_158, 0.239_314_335_249_683),
    (0.5, 0.284_444_444_444_444),
    (0.769_234_655_052_842, 0.239_314_335_249_683),
    (0.953_089_922_969_332, 0.118_463_442_528_095),
];

/// The energy of a model in which nothing but gravity, constant wrenches and contacts acts.
pub(super) struct EnergyBalance {
    /// True if it is such a model, and the work of torques is known: bodies on trajectories bring energy with them, and a body
    /// may have turned any way within steps of any length.
    closed: bool,
    initial: Vec<BodyState>,
    /// Articulations as values, and their energy at the start.
    trees: Vec<Articulation>,
    articulated: Energy,
    /// Work of external torques \[J\].
    work: f64,
    /// The largest kinetic energy so far \[J\].
    kinetic: f64,
}

impl EnergyBalance {
    /// Balance of a simulation from `initial` by an integrator that `controls_error`, with steps of any length, or not.
    pub(super) fn new<S: Scalar>(
        model: &Model<S>,
        initial: &Rows<S>,
        controls_error: bool,
    ) -> Self {
        let initial: Vec<BodyState> = initial.iter().map(BodyState::value).collect();
        let moves = |(motion, state): (&Motion<S>, &BodyState)| match motion {
            Motion::Dynamic(_) | Motion::Link => false,
            Motion::Fixed => state.linear != Vector3::zeros() || state.angular != Vector3::zeros(),
            Motion::Kinematic(_) => true,
        };
        let moved = model.bodies.iter().map(|body| &body.motion).zip(&initial).any(moves);
        let torques = model.bodies.iter().any(|body| torque(body) != Vector3::zeros());
        let pushed = model.joint_forces.iter().any(|force| !force.law().is_passive());
        let is_pulled = |body: &Body<S>| {
            matches!(body.motion, Motion::Link) && body.external_wrench.norm().value() > 0.0
        };
        let pulled = model.bodies.iter().any(is_pulled);
        let closed = !(moved || pushed || pulled || controls_error && torques);
        let trees = model.articulations.iter().map(|own| own.tree.map(S::value)).collect();
        let mut balance =
            Self { closed, initial, trees, articulated: NOTHING, work: 0.0, kinetic: 0.0 };
        balance.articulated = balance.articulated_energy(model, &balance.initial);
        balance
    }

    /// After `step` has led to `states`.
    #[inline]
    pub(super) fn step<S: Scalar>(
        &mut self,
        model: &Model<S>,
        step: Step,
        states: &Rows<S>,
    ) -> Result<()> {
        for (body, state) in model.bodies.iter().zip(states) {
            let torque = torque(body);
            if torque != Vector3::zeros() {
                self.work += torque.dot(&state.angular.map(|x| x.value())) * step.dt;
            }
        }
        match (step.index + 1).is_multiple_of(EVERY) {
            true => self.check(model, step.end(), states),
            false => Ok(()),
        }
    }

    /// Energy of all links \[J\].
    fn articulated_energy<S: Scalar, T: Scalar>(
        &self,
        model: &Model<S>,
        states: &Rows<T>,
    ) -> Energy {
        let gravity = model.gravity.map(|x| x.value());
        let mut sum = NOTHING;
        for (tree, (own, joints)) in self.trees.iter().zip(model.articulated(states)) {
            let [q, v] = own
                .coordinates(joints)
                .map(|all| all.into_iter().map(|x| x.value()).collect::<Vec<f64>>());
            let energy = tree.kinematics(&q, &v).under(gravity).energy(&v);
            sum.kinetic += energy.kinetic;
            sum.potential += energy.potential;
        }
        sum
    }

    /// Compares the energy at `states` with that at the start.
    pub(super) fn check<S: Scalar>(
        &mut self,
        model: &Model<S>,
        time: f64,
        states: &Rows<S>,
    ) -> Result<()> {
        let [mut kinetic, mut gain] = [0.0, -self.work];
        for body in model.free_bodies() {
            let (before, now) = (&self.initial[body], states[body].value());
            let moving = kinetic_energy(model, body, &now);
            kinetic += moving;
            gain += moving
                - kinetic_energy(model, body, before)
                - work_of_pull(model, body, before, &now);
        }
        let articulated = self.articulated_energy(model, states);
        kinetic += articulated.kinetic;
        gain += articulated.kinetic + articulated.potential
            - self.articulated.kinetic
            - self.articulated.potential;
        self.kinetic = self.kinetic.max(kinetic);
        if !self.closed || gain <= TOLERANCE * self.kinetic {
            return Ok(());
        }
        gain -= work_along_joints(model, &self.initial, states);
        if gain <= TOLERANCE * self.kinetic {
            return Ok(());
        }
        // What contacts had stored at the start they may give back.
        let now: Vec<BodyState> = states.iter().map(BodyState::value).collect();
        let plain = model.to_f64();
        let stored = |states: &Rows| stored_energy(&plain.with_touching(states, 0.0), states);
        let before = stored(&self.initial);
        let energy = gain - before + stored(&now);
        if energy <= TOLERANCE * self.kinetic.max(before) {
            return Ok(());
        }
        let fastest = |a: &BodyId, b: &BodyId| {
            let energy = |body: BodyId| kinetic_energy(model, body, &now[body]);
            energy(*a).total_cmp(&energy(*b))
        };
        let body = model.moved_bodies().max_by(fastest).unwrap_or(BodyId(0));
        let (body, contact) = plain.with_touching(&now, 0.0).names(&now, body);
        Err(SimulationError::Energy { body, contact, time, energy })
    }
}

/// The external torque on a body \[N m\].
fn torque<S: Scalar>(body: &Body<S>) -> Vector3<f64> {
    body.external_wrench.fixed_rows::<3>(3).map(|x| x.value())
}

/// Kinetic energy of a free body \[J\].
fn kinetic_energy<S: Scalar>(model: &Model<S>, body: BodyId, state: &BodyState) -> f64 {
    let Some(rigid) = model.bodies[body].rigid() else { return 0.0 };
    let spin = state.pose.rotation.inverse() * state.angular;
    let inertia = rigid.inertia().map(|x| x.value());
    0.5 * (rigid.mass().value() * state.linear.norm_squared() + spin.dot(&(inertia * spin)))
}

/// Work of springs along joints, and of all else that acts there, while nothing moved fast \[J\].
fn work_along_joints<S: Scalar>(model: &Model<S>, before: &Rows, now: &Rows<S>) -> f64 {
    let lifted: Vec<BodyState<S>> = before.iter().map(BodyState::cast).collect();
    let work = |force: &JointForce<S>| {
        let position = |states: &Rows<S>| Some(model.along(force, states)?.position.value());
        let (Some(from), Some(to)) = (position(&lifted), position(now)) else { return 0.0 };
        let p: Vec<f64> = force.params().iter().map(|p| p.value()).collect();
        let effort = |x: f64| force.law().effort(&p, from + x * (to - from), 0.0);
        // Limits and slack springs act over a small part of the way.
        let part = |k: usize| {
            let at = |x: f64| (k as f64 + x) / PARTS as f64;
            GAUSS.iter().map(|(x, weight)| weight * effort(at(*x))).sum::<f64>()
        };
        (to - from) / PARTS as f64 * (0..PARTS).map(part).sum::<f64>()
    };
    model.joint_forces.iter().map(work).sum()
}

/// Work of gravity and the external force on a free body that has moved from `before` to `now` \[J\].
fn work_of_pull<S: Scalar>(
    model: &Model<S>,
    body: BodyId,
    before: &BodyState,
    now: &BodyState,
) -> f64 {
    let Some(rigid) = model.bodies[body].rigid() else { return 0.0 };
    let force =
        model.gravity * rigid.mass() + model.bodies[body].external_wrench.fixed_rows::<3>(0);
    let shift = now.pose.translation.vector - before.pose.translation.vector;
    force.map(|x| x.value()).dot(&shift)
}

/// Energy that resting contacts at `states` could give back \[J\]: the work of each sample's normal force from its gap to where
/// there is none, and that of bristles and bushings as they return.
fn stored_energy(model: &Model, states: &Rows) -> f64 {
    let mut energy = energy_of_bristles(model, states) + model.energy_of_bushings(states);
    for pair in &model.contacts {
        let Some(query) = model.contact_query(pair, model.relative_value(pair, states)) else {
            continue;
        };
        let (reach, smoothing) = (pair.law().cutoff(), pair.smoothing);
        query.for_each_gap(reach, |gap, area| {
            let force = |x: f64| {
                let (slip, normal) = (Vector3::zeros(), Vector3::z());
                let gap = reach + smoothing.at(x).map_or(0.0, |smoothed| smoothed.gap);
                let contact = ContactKinematics { gap, normal_speed: 0.0, slip, normal, area };
                pair.law().force(pair.params(), &contact).normal
            };
            // The force fades exponentially beyond the reach, if it does.
            let (from, band) = (gap - reach, smoothing.force_band());
            let ends = [0.0, 0.1, 0.3, 1.0].map(|fraction| fraction * band);
            let mut begin = from;
            for end in ends.into_iter().filter(|end| *end > from) {
                let nodes = GAUSS.iter();
                let mean: f64 = nodes.map(|(x, w)| w * force(begin + x * (end - begin))).sum();
                energy += pair.weight * (end - begin) * mean;
                begin = end;
            }
        });
    }
    energy
}

/// The work of the bristles of all contacts with bristles, from their deflections to none, while nothing else moves \[J\].
fn energy_of_bristles(model: &Model, states: &Rows) -> f64 {
    let resting: Vec<BodyState> =
        states.iter().map(|state| BodyState::at_rest(state.pose)).collect();
    let work = |((pair, _), state): ((&ContactPair, Bristles), &BodyState)| {
        let rotation = states[pair.bodies.field].pose.rotation;
        let [linear, angular] = [state.linear, state.angular].map(|x| rotation * x);
        let twist = spatial(&linear, &angular);
        let along = |part: f64| {
            let deflection = BodyState::at_rest(state.pose).deflected(&(state.deflection() * part));
            model.pair_wrench(pair, &resting, Some(&deflection), 1).on_samples.dot(&twist)
        };
        let undeflected = along(0.0);
        let mean: f64 = GAUSS.iter().map(|(x, weight)| weight * along(*x)).sum();
        undeflected - mean
    };
    model.bristle_contacts().zip(&states[model.joint_places().end..]).map(work).sum()
}
