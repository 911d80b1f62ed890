//! Wrenches of contacts, recorded as one node.

use nalgebra::{Matrix3, Vector3, Vector6};
use prehend_autodiff::{CustomVjp, Scalar};

use super::Model;
use super::contact_pair::ContactPair;
use crate::body_state::{BodyState, Rows, STATE};
use crate::contact::contact_query::ContactQuery;
use crate::contact::wrench::WrenchJacobian;
use crate::handle::BodyId;
use crate::spatial::spatial;

/// The contacts of a model at one moment as a linear function of its states: one node of the tape, however many they are.
#[derive(Default)]
pub(super) struct LinearContacts {
    contacts: Vec<LinearContact>,
    /// For each body, its place among those that touch.
    places: Vec<Option<usize>>,
    /// The bodies that touch.
    bodies: Vec<Touching>,
}

/// A body that touches.
struct Touching {
    body: BodyId,
    state: BodyState,
    /// The sum of its contacts' wrenches.
    wrench: Vector6<f64>,
}

/// A contact and its derivatives.
struct LinearContact {
    /// Places of the bodies with the samples and with the field.
    ends: [usize; 2],
    /// Force and torque on the body with the samples, world frame.
    force: Vector3<f64>,
    torque: Vector3<f64>,
    /// Derivatives of both along the axes of the field, by the tangent of the state that the field sees.
    by_state: [[f64; 12]; 6],
    /// Factor on those derivatives, which force and torque have already.
    weight: f64,
}

impl LinearContacts {
    /// Function without contacts, for a model of `bodies`.
    pub(super) fn new(bodies: usize) -> Self {
        Self { places: vec![None; bodies], ..Self::default() }
    }

    /// Adds what `pair` does, which has no memory; what follows from its varying parameters and dimensions is added to `wrenches`.
    pub(super) fn add<S: Scalar>(
        &mut self,
        model: &Model<S>,
        pair: &ContactPair<S>,
        states: &Rows<S>,
        step: usize,
        wrenches: &mut [Vector6<S>],
    ) {
        let ids = [pair.bodies.samples, pair.bodies.field];
        let Some(query) = model.contact_query(pair, model.relative_value(pair, states)) else {
            return;
        };
        let query = ContactQuery { smoothing: pair.smoothing.at_step(step), ..query };
        let (WrenchJacobian { wrench, by_state, .. }, slopes) = model.linearized(pair, &query);
        let [samples, field] = ids.map(|id| states[id].value().pose);
        let axes = field.rotation.to_rotation_matrix();
        let offset = samples.translation.vector - field.translation.vector;
        if let Some(slopes) = slopes {
            let axes = axes.cast::<S>();
            let part =
                |from: usize| axes * Vector3::from_fn(|i, _| slopes[from + i].times(pair.weight));
            let (force, torque) = (part(0), part(3));
            let turned = torque + offset.map(S::constant).cross(&force);
            wrenches[ids[0].index()] += spatial(&force, &torque);
            wrenches[ids[1].index()] -= spatial(&force, &turned);
        }
        if wrench == Vector6::zeros() && by_state == [[0.0; 12]; 6] {
            return;
        }
        let along = |from: usize| axes * (wrench.fixed_rows::<3>(from) * pair.weight);
        let (force, torque) = (along(0), along(3));
        let ends = ids.map(|id| {
            *self.places[id.index()].get_or_insert_with(|| {
                let (state, wrench) = (states[id].value(), Vector6::zeros());
                self.bodies.push(Touching { body: id, state, wrench });
                self.bodies.len() - 1
            })
        });
        self.bodies[ends[0]].wrench += spatial(&force, &torque);
        self.bodies[ends[1]].wrench -= spatial(&force, &(torque + offset.cross(&force)));
        let weight = pair.weight;
        self.contacts.push(LinearContact { ends, force, torque, by_state, weight });
    }

    /// Adds to `wrenches` what was added, with derivatives by `states`.
    pub(super) fn record<S: Scalar>(
        self,
        model: &Model<S>,
        states: &Rows<S>,
        wrenches: &mut [Vector6<S>],
    ) {
        let mut inputs = Vec::with_capacity(STATE * self.bodies.len());
        let mut outputs = Vec::with_capacity(6 * self.bodies.len());
        let mut own = Vec::with_capacity(self.bodies.len());
        // Contacts see the point of a body that has the value of its center of mass for coordinates.
        let shifted: Vec<_> =
            self.bodies.iter().map(|touching| model.shifted(touching.body, states)).collect();
        for (Touching { body, state, wrench }, shifted) in self.bodies.iter().zip(&shifted) {
            let seen = shifted.as_ref().map_or(&states[*body], |(state, _)| state);
            let coordinates = seen.coordinates();
            let moves = !coordinates.iter().all(|x| x.is_constant());
            own.push((*state, moves.then_some(inputs.len())));
            if moves {
                inputs.extend(coordinates);
            }
            outputs.extend(wrench.iter());
        }
        let node = ContactsNode { contacts: self.contacts, states: own };
        const { assert!(S::ORDER <= 1, "contacts have first derivatives only: no nested scalars") };
        let recorded = S::recorded(&inputs, &outputs, node)
            .unwrap_or_else(|| outputs.iter().map(|&x| S::constant(x)).collect());
        let recorded = recorded.chunks_exact(6).map(Vector6::from_column_slice);
        for ((touching, shifted), wrench) in self.bodies.iter().zip(&shifted).zip(recorded) {
            let sum = &mut wrenches[touching.body.index()];
            *sum += wrench;
            if let Some((_, from_com)) = shifted {
                let force = wrench.fixed_rows::<3>(0).into_owned();
                *sum += spatial(&Vector3::zeros(), &from_com.cross(&force));
            }
        }
    }
}

/// The derivative of [`LinearContacts`].
struct ContactsNode {
    contacts: Vec<LinearContact>,
    /// For each body that touches, and where its coordinates begin among the inputs, if they are inputs.
    states: Vec<(BodyState, Option<usize>)>,
}

impl CustomVjp for ContactsNode {
    fn vjp(&self, output_adjoints: &[f64], input_adjoints: &mut [f64]) {
        for contact in &self.contacts {
            let of = |end: usize| -> [Vector3<f64>; 2] {
                let from = 6 * contact.ends[end];
                [0, 3].map(|i| Vector3::from_column_slice(&output_adjoints[from + i..][..3]))
            };
            // An adjoint of 0 meets no slope, which may be infinite.
            let unused = |end: &usize| output_adjoints[6 * end..][..6].iter().all(|x| *x == 0.0);
            if contact.ends.iter().all(unused) {
                continue;
            }
            let [samples, field] = contact.ends.map(|end| &self.states[end]);
            let adjoints = contact.vjp([&samples.0, &field.0], of(0), of(1));
            for ((state, first), adjoint) in [samples, field].into_iter().zip(&adjoints) {
                if let Some(first) = *first {
                    adjoint.add_to(state, &mut input_adjoints[first..first + STATE]);
                }
            }
        }
    }
}

/// Adjoints of a state's place, left turn and velocities.
struct StateAdjoint {
    place: Vector3<f64>,
    turn: Vector3<f64>,
    linear: Vector3<f64>,
    angular: Vector3<f64>,
}

impl LinearContact {
    /// Adjoints of the states of both bodies, from those of force and torque on each: the transpose of what
    /// [`PairFunction`](super::pair_function::PairFunction) describes, and of the wrench on the body with the field, −f and −(τ + r×f).
    fn vjp(
        &self,
        [samples, field]: [&BodyState; 2],
        [force_s, torque_s]: [Vector3<f64>; 2],
        [force_f, torque_f]: [Vector3<f64>; 2],
    ) -> [StateAdjoint; 2] {
        let r = samples.pose.translation.vector - field.pose.translation.vector;
        let u = samples.linear - field.linear - field.angular.cross(&r);
        let spin = samples.angular - field.angular;
        let axes: Matrix3<f64> = field.pose.rotation.to_rotation_matrix().into_inner();
        let force = force_s - force_f - torque_f.cross(&r);
        let torque = torque_s - torque_f;
        let (f, t) = (axes.tr_mul(&force) * self.weight, axes.tr_mul(&torque) * self.weight);
        let mut seen = [0.0; 12];
        for (row, adjoint) in self.by_state.iter().zip([f.x, f.y, f.z, t.x, t.y, t.z]) {
            for (seen, slope) in seen.iter_mut().zip(row) {
                *seen += slope * adjoint;
            }
        }
        let part = |i: usize| axes * Vector3::new(seen[i], seen[i + 1], seen[i + 2]);
        let (place, turn, linear, angular) = (part(0), part(3), part(6), part(9));
        let moved = place - linear.cross(&field.angular) - self.force.cross(&torque_f);
        let turned = place.cross(&r) - turn
            + linear.cross(&u)
            + angular.cross(&spin)
            + self.force.cross(&force)
            + self.torque.cross(&torque);
        [
            StateAdjoint { place: moved, turn, linear, angular },
            StateAdjoint {
                place: -moved,
                turn: turned,
                linear: -linear,
                angular: linear.cross(&r) - angular,
            },
        ]
    }
}

impl StateAdjoint {
    /// Adds the adjoints of the coordinates of `state`. Its left turn is θ = 2 (w δv − δw v + v×δv) of a quaternion of vector v and
    /// scalar w.
    fn add_to(&self, state: &BodyState, coordinates: &mut [f64]) {
        let q = state.pose.rotation.coords;
        let v = Vector3::new(q.x, q.y, q.z);
        let by_vector = (self.turn * q.w + self.turn.cross(&v)) * 2.0;
        let by_scalar = -2.0 * v.dot(&self.turn);
        for (from, part) in
            [(0, &self.place), (3, &by_vector), (7, &self.linear), (10, &self.angular)]
        {
            coordinates[from..from + 3].iter_mut().zip(part).for_each(|(sum, x)| *sum += x);
        }
        coordinates[6] += by_scalar;
    }
}
