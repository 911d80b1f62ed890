//! Forces between two bodies with their derivatives by both states.

use nalgebra::{Matrix3, SMatrix, Vector3, Vector6};
use prehend_autodiff::lie::cross_matrix;
use prehend_autodiff::{Fwd, Scalar};

use crate::body_state::Rows;
use crate::contact::contact_query::ContactQuery;
use crate::handle::BodyId;
use crate::model::Model;
use crate::model::bushing::Bushing;
use crate::model::contact_pair::ContactPair;
use crate::spatial::spatial;

/// A force between two bodies.
pub(super) struct Between {
    pub(super) bodies: [BodyId; 2],
    /// On each of them, about the point that its state is of, along the world's axes.
    pub(super) on: [Vector6<f64>; 2],
    /// Derivatives of both by the tangents of both states: `by[of][by]`.
    pub(super) by: [[SMatrix<f64, 6, 12>; 2]; 2],
}

impl Between {
    /// Linearized force of a contact without a memory; none where nothing touches.
    pub(super) fn contact(
        model: &Model,
        pair: &ContactPair,
        states: &Rows,
        step: usize,
    ) -> Option<Self> {
        let bodies = [pair.bodies.samples, pair.bodies.field];
        let query = model.contact_query(pair, model.relative_value(pair, states))?;
        let query = ContactQuery { smoothing: pair.smoothing.at_step(step), ..query };
        let found = pair.law().wrench_jacobian(&pair.param_values(), &query, false);
        if found.wrench == Vector6::zeros() && found.by_state == [[0.0; 12]; 6] {
            return None;
        }
        let [samples, field] = bodies.map(|body| &states[body]);
        let axes = field.pose.rotation.to_rotation_matrix().into_inner();
        let along = |from: usize| axes * found.wrench.fixed_rows::<3>(from) * pair.weight;
        let (force, torque) = (along(0), along(3));
        // By place, turn, velocity and angular velocity as the field sees them, all along the world's axes.
        let [by_place, by_turn, by_velocity, by_spin] = std::array::from_fn(|column| {
            let block = |row: usize| {
                let entry = |i: usize, j: usize| found.by_state[3 * row + i][3 * column + j];
                axes * Matrix3::from_fn(entry) * axes.transpose() * pair.weight
            };
            rows(&block(0), &block(1))
        });
        let r = samples.pose.translation.vector - field.pose.translation.vector;
        let u = samples.linear - field.linear - field.angular.cross(&r);
        let [r, u] = [r, u].map(|x| cross_matrix(&x));
        let spin = cross_matrix(&(samples.angular - field.angular));
        let by_samples = by_place - by_velocity * cross_matrix(&field.angular);
        let turned = rows(&cross_matrix(&force), &cross_matrix(&torque));
        let own = columns([by_samples, by_turn, by_velocity, by_spin]);
        let other = columns([
            -by_samples,
            by_place * r - by_turn + by_velocity * u + by_spin * spin - turned,
            -by_velocity,
            by_velocity * r - by_spin,
        ]);
        let on = [spatial(&force, &torque), Vector6::zeros()];
        let place = [Matrix3::identity(), -Matrix3::identity()];
        let arm = samples.pose.translation.vector - field.pose.translation.vector;
        Some(Self::reacting(bodies, on[0], [own, other], &arm, place))
    }

    /// Linearized force of a bushing.
    pub(super) fn bushing(model: &Model, bushing: &Bushing, states: &Rows) -> Self {
        let inputs = Fwd::<24>::variables([0.0; 24]);
        let [a, b] = [0, 1].map(|end| {
            states[bushing.bodies[end]].retract(&std::array::from_fn(|i| inputs[12 * end + i]))
        });
        let both = model.pull(bushing, [&a, &b], bushing.stiffness.numbers().map(Fwd::constant));
        let on = both.map(|wrench| wrench.map(|x| x.value));
        let by = both.map(|wrench| {
            [0, 12].map(|lane| SMatrix::from_fn(|i, j| wrench[i].derivative[lane + j]))
        });
        Self { bodies: bushing.bodies, on, by }
    }

    /// With the reaction −f, −(τ + r×f) at the other end, r to the first from there, which changes by `places` with the places of both.
    fn reacting(
        bodies: [BodyId; 2],
        on: Vector6<f64>,
        by: [SMatrix<f64, 6, 12>; 2],
        arm: &Vector3<f64>,
        places: [Matrix3<f64>; 2],
    ) -> Self {
        let (force, torque) = (on.fixed_rows::<3>(0).into_owned(), on.fixed_rows::<3>(3));
        let reaction = spatial(&-force, &-(torque + arm.cross(&force)));
        let back = [0, 1].map(|end| {
            let mut back = -by[end];
            let pushed = cross_matrix(arm) * by[end].fixed_rows::<3>(0);
            let mut turned = back.fixed_view_mut::<3, 12>(3, 0);
            turned -= pushed;
            let mut turned = back.fixed_view_mut::<3, 3>(3, 0);
            turned += cross_matrix(&force) * places[end];
            back
        });
        Self { bodies, on: [on, reaction], by: [by, back] }
    }
}

fn rows(force: &Matrix3<f64>, torque: &Matrix3<f64>) -> SMatrix<f64, 6, 3> {
    let mut both = SMatrix::<f64, 6, 3>::zeros();
    both.fixed_view_mut::<3, 3>(0, 0).copy_from(force);
    both.fixed_view_mut::<3, 3>(3, 0).copy_from(torque);
    both
}

fn columns(blocks: [SMatrix<f64, 6, 3>; 4]) -> SMatrix<f64, 6, 12> {
    let mut all = SMatrix::<f64, 6, 12>::zeros();
    for (k, block) in blocks.iter().enumerate() {
        all.fixed_view_mut::<6, 3>(0, 3 * k).copy_from(block);
    }
    all
}
