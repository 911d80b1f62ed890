//! Wrenches of contacts, recorded as one node.

use nalgebra::{Vector3, Vector6};
use prehend_autodiff::{CustomVjp, Scalar};

use super::Model;
use super::contact_pair::ContactPair;
use super::pair_wrench::weighted;
use super::relative_motion::{LinearWrench, RelativeMotion, reaction};
use crate::body_state::{BodyState, Rows, STATE};
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
    /// The wrench that it had before, and with its contacts: in this order sums have the bits of those without derivatives.
    before: Vector6<f64>,
    wrench: Vector6<f64>,
}

/// A contact.
struct LinearContact {
    /// Places of the bodies with the samples and with the field.
    ends: [usize; 2],
    wrench: LinearWrench,
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
        let Some(query) = model.contact_query_at(pair, states, step) else { return };
        let varies = pair.params().iter().any(|x| !x.is_constant());
        let found = pair.law().wrench_jacobian(&pair.param_values(), &query, varies);
        let slopes = model.slopes(pair, &query, &Vector6::zeros(), &found.by_params);
        let [samples, field] = ids.map(|id| states[id].value().pose);
        let axes = field.rotation.to_rotation_matrix();
        let offset = samples.translation.vector - field.translation.vector;
        if let Some(slopes) = slopes {
            let [force, torque] = weighted(&axes, &slopes, pair.weight);
            let [on_samples, on_field] = reaction(&force, &torque, &offset.map(S::constant));
            wrenches[ids[0].index()] += on_samples;
            wrenches[ids[1].index()] += on_field;
        }
        if found.is_zero() {
            return;
        }
        let wrench = LinearWrench::new(&found, &axes, pair.weight);
        let ends = ids.map(|id| {
            *self.places[id.index()].get_or_insert_with(|| {
                let (state, before) = (states[id].value(), wrenches[id.index()].map(S::value));
                self.bodies.push(Touching { body: id, state, before, wrench: before });
                self.bodies.len() - 1
            })
        });
        for (end, wrench) in ends.into_iter().zip(wrench.on_both(&offset)) {
            self.bodies[end].wrench += wrench;
        }
        self.contacts.push(LinearContact { ends, wrench });
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
        for (Touching { body, state, wrench, .. }, shifted) in self.bodies.iter().zip(&shifted) {
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
            *sum = sum.zip_map(&touching.before, |sum, before| sum.plus(-before)) + wrench;
            if let Some((_, from_com)) = shifted {
                let of_contacts = |i: usize, _| wrench[i].plus(-touching.before[i]);
                *sum += spatial(&Vector3::zeros(), &from_com.cross(&Vector3::from_fn(of_contacts)));
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
            let motion = RelativeMotion::new([samples.0, field.0]);
            let adjoints = motion.adjoints(&contact.wrench, [of(0), of(1)]);
            for ((state, first), adjoint) in [samples, field].into_iter().zip(&adjoints) {
                if let Some(first) = *first {
                    adjoint.add_to(state, &mut input_adjoints[first..first + STATE]);
                }
            }
        }
    }
}
