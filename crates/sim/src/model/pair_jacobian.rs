//! Wrenches between two bodies with their derivatives by both states, as matrices.

use nalgebra::{SMatrix, Vector6};
use prehend_autodiff::{Fwd, Scalar};

use super::Model;
use super::bushing::Bushing;
use super::contact_pair::ContactPair;
use super::pair_wrench::bristle_wrench;
use super::relative_motion::{LinearWrench, RelativeMotion, reaction};
use crate::body_state::{BodyState, Rows};
use crate::contact::bristle_function::BristleFunction;
use crate::handle::BodyId;

/// Linearized wrenches between two bodies.
pub(crate) struct PairJacobian {
    pub(crate) bodies: [BodyId; 2],
    /// On each of them, about the point that its state is of, along the axes of the model.
    pub(crate) on: [Vector6<f64>; 2],
    /// Derivatives of both by the tangents of both states: `by[of][by]`.
    pub(crate) by: [[SMatrix<f64, 6, 12>; 2]; 2],
    /// Rate of the deflection of a contact with bristles.
    pub(crate) rate: Option<Vector6<f64>>,
}

impl Model {
    /// Linearized wrenches of all contacts that touch, their deflections held, then of all bushings.
    pub(crate) fn pair_jacobians<'a>(
        &'a self,
        states: &'a Rows,
        step: usize,
    ) -> impl Iterator<Item = PairJacobian> + 'a {
        let mut deflections = states.iter().skip(self.joint_places().end);
        let contacts = self.contacts.iter().filter_map(move |pair| {
            let deflection = pair.law().bristles().and_then(|_| deflections.next());
            PairJacobian::contact(self, pair, states, deflection, step)
        });
        contacts.chain(self.bushings.iter().map(|own| PairJacobian::bushing(self, own, states)))
    }
}

impl PairJacobian {
    /// Wrenches of a contact with its `deflection`, if it has bristles; none of others where nothing touches.
    pub(crate) fn contact(
        model: &Model,
        pair: &ContactPair,
        states: &Rows,
        deflection: Option<&BodyState>,
        step: usize,
    ) -> Option<Self> {
        let bodies = [pair.bodies.samples, pair.bodies.field];
        let (law, p) = (pair.law().as_ref(), &pair.param_values());
        let Some(query) = &model.contact_query_at(pair, states, step) else {
            let nothing = Self::new(bodies, &[Vector6::zeros(); 2]);
            return law.bristles().map(|_| Self { rate: Some(Vector6::zeros()), ..nothing });
        };
        let [samples, field] = bodies.map(|body| states[body]);
        let Some(bristles) = law.bristles() else {
            let found = law.wrench_jacobian(p, query, false);
            if found.is_zero() {
                return None;
            }
            let axes = field.pose.rotation.to_rotation_matrix();
            let wrench = LinearWrench::new(&found, &axes, pair.weight);
            let offset = samples.pose.translation.vector - field.pose.translation.vector;
            let by = RelativeMotion::new([samples, field]).jacobian(&wrench);
            return Some(Self { bodies, on: wrench.on_both(&offset), by, rate: None });
        };
        let deflection = deflection.map_or_else(Vector6::zeros, BodyState::deflection);
        let function = BristleFunction { law, p, query, bristles, deflection };
        let held = deflection.map(Fwd::constant);
        let com = &model.bodies[bodies[1]].com().coords;
        let [a, b] = &variables(bodies, states);
        let ([force, torque], rate) =
            bristle_wrench(&function, pair.weight, com, [a, b], None, &held);
        let offset = a.pose.translation.vector - b.pose.translation.vector;
        let rate = Some(rate.map(|x| x.value));
        Some(Self { rate, ..Self::new(bodies, &reaction(&force, &torque, &offset)) })
    }

    fn bushing(model: &Model, bushing: &Bushing, states: &Rows) -> Self {
        let [a, b] = variables(bushing.bodies, states);
        let stiffness = bushing.stiffness.numbers().map(Fwd::constant);
        Self::new(bushing.bodies, &model.pull(bushing, [&a, &b], stiffness))
    }

    fn new(bodies: [BodyId; 2], on: &[Vector6<Fwd<24>>; 2]) -> Self {
        let by = on.map(|wrench| {
            [0, 12].map(|lane| SMatrix::from_fn(|i, j| wrench[i].derivative[lane + j]))
        });
        Self { bodies, on: on.map(|wrench| wrench.map(|x| x.value)), by, rate: None }
    }
}

/// States of two bodies, with their tangents as variables.
fn variables(bodies: [BodyId; 2], states: &Rows) -> [BodyState<Fwd<24>>; 2] {
    let inputs = Fwd::<24>::variables([0.0; 24]);
    [0, 1].map(|end| states[bodies[end]].retract(&std::array::from_fn(|i| inputs[12 * end + i])))
}
