//! Wrenches of contacts.

use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector3, Vector6};
use prehend_autodiff::{Fwd, Scalar};

use super::Model;
use super::contact_pair::ContactPair;
use super::linear_contacts::LinearContacts;
use super::pair_function::Relation;
use super::relative_state::RelativeState;
use crate::body_state::{BodyState, Rows};
use crate::contact::bristle_function::BristleFunction;
use crate::contact::bristles::Bristles;
use crate::contact::contact_query::ContactQuery;
use crate::contact::wrench::{LinearWrench, WrenchJacobian};
use crate::contact::wrench_function::WrenchFunction;
use crate::shape::lifted::LiftedField;
use crate::shape::variable::{LANES, Lane, VariableShapes};
use crate::spatial::spatial;
use crate::state::State;

/// Wrenches of a contact.
pub(crate) struct PairWrench<S: Scalar> {
    /// Wrench on the body with the samples and on that with the field, each about its own center of mass.
    pub(crate) on_samples: Vector6<S>,
    pub(crate) on_field: Vector6<S>,
    /// Rate of the deflection of a contact with bristles, along the axes of the field \[m/s\], \[rad/s\].
    pub(crate) rate: Vector6<S>,
}

impl<S: Scalar> Default for PairWrench<S> {
    fn default() -> Self {
        let zero = Vector6::zeros();
        Self { on_samples: zero, on_field: zero, rate: zero }
    }
}

impl<S: Scalar> Model<S> {
    /// External and contact wrenches on every body (force \[N\], torque about the center of mass \[N m\],
    /// world frame), without gravity; those of contacts alone: [`Model::contact_wrench`]. `step` matters to leaks in the first step only.
    ///
    /// Derivatives through contacts are first derivatives.
    ///
    /// # Panics
    /// If it is no state of this model.
    pub fn wrenches(&self, state: &State<S>, step: usize) -> Vec<Vector6<S>> {
        let mut wrenches = self.wrenches_of(self.with_deflections(state.clone()).rows(), step);
        wrenches.truncate(self.bodies.len());
        wrenches
    }

    /// [`Model::wrenches`] at the rows of a state; then the accelerations of every joint, in the order of its state's velocities, and the
    /// rate of the deflection (\[m/s\], \[rad/s\]) of every contact with bristles.
    pub(crate) fn wrenches_of(&self, states: &Rows<S>, step: usize) -> Vec<Vector6<S>> {
        if !self.contact_groups.is_empty() {
            return self.with_touching(states, 0.0).wrenches_of(states, step);
        }
        let mut wrenches = self.contact_wrenches(states, step);
        let accelerations = self.joint_accelerations(states, &wrenches);
        wrenches[self.joint_places()].copy_from_slice(&accelerations);
        wrenches
    }

    /// [`Model::wrenches`] without groups of contacts, and without the accelerations of joints.
    pub(crate) fn contact_wrenches(&self, states: &Rows<S>, step: usize) -> Vec<Vector6<S>> {
        const { assert!(S::ORDER <= 1, "contacts have first derivatives only: no nested scalars") };
        let mut wrenches: Vec<Vector6<S>> =
            self.bodies.iter().map(|body| body.external_wrench).collect();
        wrenches.resize(self.joint_places().end, Vector6::zeros());
        let mut linear = LinearContacts::new(if S::RECORDED { self.bodies.len() } else { 0 });
        for pair in &self.contacts {
            let PairWrench { on_samples, on_field, .. } =
                if let Some(bristles) = pair.law().bristles() {
                    let deflection = states.get(wrenches.len());
                    let effect = self.bristle_wrench(pair, states, bristles, deflection, step);
                    wrenches.push(effect.rate);
                    effect
                } else if S::RECORDED {
                    linear.add(self, pair, states, step, &mut wrenches);
                    continue;
                } else {
                    self.memoryless_wrench(pair, states, step)
                };
            wrenches[pair.bodies.samples] += on_samples;
            wrenches[pair.bodies.field] += on_field;
        }
        if S::RECORDED {
            linear.record(self, states, &mut wrenches);
        }
        self.add_bushings(states, &mut wrenches);
        wrenches
    }

    /// Wrenches of `pair` with its `deflection`, if it has bristles.
    pub(crate) fn pair_wrench(
        &self,
        pair: &ContactPair<S>,
        states: &Rows<S>,
        deflection: Option<&BodyState<S>>,
        step: usize,
    ) -> PairWrench<S> {
        match pair.law().bristles() {
            Some(bristles) => self.bristle_wrench(pair, states, bristles, deflection, step),
            None => self.memoryless_wrench(pair, states, step),
        }
    }

    /// Magnitude of the force of `pair` without a memory \[N\].
    pub(crate) fn force(&self, pair: &ContactPair<S>, states: &Rows<S>) -> f64 {
        let Some(query) = &self.contact_query_at(pair, states, 1) else { return 0.0 };
        let (law, p) = (pair.law().as_ref(), &pair.param_values());
        let wrench = match law.bristles() {
            None => law.wrench(p, query),
            Some(bristles) => {
                let deflection = Vector6::zeros();
                let function = BristleFunction { law, p, query, bristles, deflection };
                Vector6::from_column_slice(&f64::local(&function, [0.0; 18])[..6])
            }
        };
        pair.weight * wrench.fixed_rows::<3>(0).norm()
    }

    /// The samples of `pair` beside its field in a step, if there are both.
    pub(super) fn contact_query_at<'a>(
        &'a self,
        pair: &'a ContactPair<S>,
        states: &Rows<S>,
        step: usize,
    ) -> Option<ContactQuery<'a>> {
        let query = self.contact_query(pair, self.relative_value(pair, states))?;
        Some(ContactQuery { smoothing: pair.smoothing.at_step(step), ..query })
    }

    /// Wrenches of `pair`, which has bristles, with its `deflection`.
    fn bristle_wrench(
        &self,
        pair: &ContactPair<S>,
        states: &Rows<S>,
        bristles: Bristles,
        deflection: Option<&BodyState<S>>,
        step: usize,
    ) -> PairWrench<S> {
        let Some(query) = self.contact_query_at(pair, states, step) else {
            return PairWrench::default();
        };
        let deflection = deflection.map_or_else(Vector6::zeros, BodyState::deflection);
        let seen = self.relative_state(pair, states);
        let (wrench, rate) = local_bristles(pair, &seen, &query, bristles, deflection);
        let mut slopes = [S::zero(); 12];
        if S::ORDER > 0 {
            self.add_slopes_by_dimensions(pair, &query, &deflection, &mut slopes);
        }
        let rate = Vector6::from_fn(|i, _| rate[i] + slopes[6 + i]);
        let wrench = std::array::from_fn(|i| wrench[i] + slopes[i]);
        let axes = states[pair.bodies.field].pose.rotation;
        PairWrench { rate, ..self.pair_wrench_along(pair, states, &axes, wrench) }
    }

    /// Wrenches of `pair` without a memory.
    fn memoryless_wrench(
        &self,
        pair: &ContactPair<S>,
        states: &Rows<S>,
        step: usize,
    ) -> PairWrench<S> {
        let Some(query) = &self.contact_query_at(pair, states, step) else {
            return PairWrench::default();
        };
        let law = pair.law().as_ref();
        let values = pair.param_values();
        if S::ORDER == 0 {
            let axes = &states[pair.bodies.field].pose.rotation;
            return self.pair_wrench_along(
                pair,
                states,
                axes,
                law.wrench(&values, query).map(S::constant).into(),
            );
        }
        let ends = [pair.bodies.samples, pair.bodies.field];
        let shifted = ends.map(|id| self.shifted(id, states));
        let [samples, field] =
            [0, 1].map(|end| shifted[end].as_ref().map_or(&states[ends[end]], |(state, _)| state));
        let at = Relation { samples: samples.value(), field: field.value(), weight: pair.weight };
        let (all, slopes) = if pair.params().iter().all(|x| x.is_constant()) {
            let function = at.function(WrenchFunction { law, p: &values, query });
            (function.of(samples, field), self.slopes(pair, query, &[]))
        } else {
            let (WrenchJacobian { wrench, by_state, .. }, slopes) = self.linearized(pair, query);
            let function = at.function(LinearWrench { value: wrench.into(), by_state });
            (function.of(samples, field), slopes)
        };
        let [fx, fy, fz, tx, ty, tz] = all;
        let (mut force, mut torque) = (Vector3::new(fx, fy, fz), Vector3::new(tx, ty, tz));
        if let Some(slopes) = slopes {
            let axes = at.field.pose.rotation.cast();
            let part = |from: usize| Vector3::from_fn(|i, _| slopes[from + i].times(pair.weight));
            (force, torque) = (force + axes * part(0), torque + axes * part(3));
        }
        if let Some((_, from_com)) = &shifted[0] {
            torque += from_com.cross(&force);
        }
        self.on_both(pair, states, force, torque)
    }

    /// Wrenches of the `wrench` of `pair` along the `axes` of its field.
    fn pair_wrench_along(
        &self,
        pair: &ContactPair<S>,
        states: &Rows<S>,
        axes: &UnitQuaternion<S>,
        wrench: [S; 6],
    ) -> PairWrench<S> {
        let [fx, fy, fz, tx, ty, tz] = wrench.map(|x| x.times(pair.weight));
        self.on_both(pair, states, axes * Vector3::new(fx, fy, fz), axes * Vector3::new(tx, ty, tz))
    }

    /// Wrenches of a force and torque on the body with the samples, about its center of mass.
    #[inline]
    fn on_both(
        &self,
        pair: &ContactPair<S>,
        states: &Rows<S>,
        force: Vector3<S>,
        torque: Vector3<S>,
    ) -> PairWrench<S> {
        let (state, base) = (&states[pair.bodies.samples], &states[pair.bodies.field]);
        let offset = state.pose.translation.vector - base.pose.translation.vector;
        let on_field = spatial(&-force, &-(torque + offset.cross(&force)));
        PairWrench { on_samples: spatial(&force, &torque), on_field, rate: Vector6::zeros() }
    }

    /// Adds the derivatives by the dimensions of its shapes to those of the wrench of `query`, which is `pair`, and of its rate.
    fn add_slopes_by_dimensions(
        &self,
        pair: &ContactPair<S>,
        query: &ContactQuery<'_>,
        deflection: &Vector6<S>,
        sums: &mut [S; 12],
    ) {
        let ends = [pair.bodies.samples, pair.bodies.field].map(|id| &self.bodies[id]);
        if ends.iter().all(|body| body.dimensions().iter().all(|x| x.is_constant())) {
            return;
        }
        let moved = ends.map(|body| changes(body.dimensions()));
        let variable = |(i, x): (usize, &S)| (!x.is_constant_zero()).then_some(i);
        let places: Vec<usize> = moved.iter().flatten().enumerate().filter_map(variable).collect();
        let Some(field) = ends[1].field.as_ref().filter(|_| !places.is_empty()) else { return };
        let values = pair.param_values();
        let count = moved[0].len();
        for places in places.chunks(LANES) {
            let seeded = |end: usize| -> Vec<Lane> {
                let lane = |i: usize| places.iter().position(|place| *place == i + end * count);
                let dimensions = ends[end].dimensions().iter().map(|x| x.value()).enumerate();
                let seed = |(i, value)| match lane(i) {
                    Some(lane) => Fwd::variable(value, lane),
                    None => Fwd::constant(value),
                };
                dimensions.map(seed).collect()
            };
            let field = match ends[1].shape() {
                Some(shape) => shape.lifted_field(&seeded(1)),
                None => LiftedField::Constant(Arc::clone(field)),
            };
            let samples = ends[0].shape().map(|shape| shape.lifted_samples(&seeded(0)));
            let shapes = VariableShapes { query, samples, field };
            let law = pair.law().as_ref();
            let mut slopes = [Lane::constant(0.0); 12];
            match law.bristles() {
                None => slopes[..6].copy_from_slice(&shapes.wrench(law, &values)),
                Some(bristles) => {
                    let deflection = deflection.map(S::value);
                    let function = BristleFunction { law, p: &values, query, bristles, deflection };
                    slopes = shapes.bristles(&function);
                }
            }
            for (component, slopes) in sums.iter_mut().zip(slopes) {
                for (place, slope) in places.iter().zip(slopes.derivative) {
                    let moved = match place.checked_sub(count) {
                        Some(place) => moved[1][place],
                        None => moved[0][*place],
                    };
                    *component += moved.times(slope);
                }
            }
        }
    }

    /// Wrench of `pair`, which is `query`, without a memory, with derivatives by the relative state; and its change with
    /// parameters and dimensions, if any vary: tangents, along the axes of the field.
    pub(super) fn linearized(
        &self,
        pair: &ContactPair<S>,
        query: &ContactQuery<'_>,
    ) -> (WrenchJacobian, Option<[S; 12]>) {
        let values = pair.param_values();
        let vary = !pair.params().iter().all(|x| x.is_constant());
        let jacobian = pair.law().wrench_jacobian(&values, query, vary);
        let slopes = self.slopes(pair, query, &jacobian.by_params);
        (jacobian, slopes)
    }

    /// Change of the wrench of `pair`, which has these derivatives by its parameters, with those and with dimensions, if any vary.
    fn slopes(
        &self,
        pair: &ContactPair<S>,
        query: &ContactQuery<'_>,
        by_params: &[Vector6<f64>],
    ) -> Option<[S; 12]> {
        let mut slopes = [S::zero(); 12];
        for (by_param, p) in by_params.iter().zip(pair.params()) {
            let moved = p.plus(-p.value());
            for (component, slope) in slopes.iter_mut().zip(by_param.iter()) {
                *component += moved.times(*slope);
            }
        }
        self.add_slopes_by_dimensions(pair, query, &Vector6::zeros(), &mut slopes);
        let any = !slopes.iter().all(|x| x.is_constant_zero());
        any.then_some(slopes)
    }

    /// The samples of `pair` beside its field, which sees their body in `state`, if there are both.
    pub(crate) fn contact_query<'a>(
        &'a self,
        pair: &'a ContactPair<S>,
        state: BodyState,
    ) -> Option<ContactQuery<'a>> {
        let body = &self.bodies[pair.bodies.samples];
        Some(ContactQuery {
            surface: pair.near.as_ref().or(body.surface.as_ref())?,
            com: body.com().map(S::value),
            state,
            field: self.bodies[pair.bodies.field].field.as_deref()?,
            smoothing: pair.smoothing,
        })
    }
}

/// The wrench of a contact with bristles along the axes of its field, and the rate of its deflection.
fn local_bristles<S: Scalar>(
    pair: &ContactPair<S>,
    seen: &RelativeState<S>,
    query: &ContactQuery<'_>,
    bristles: Bristles,
    deflection: Vector6<S>,
) -> ([S; 6], Vector6<S>) {
    let law = pair.law().as_ref();
    let values = pair.param_values();
    let at = deflection.map(|x| x.value());
    let split = |all: [S; 12]| -> ([S; 6], Vector6<S>) {
        (std::array::from_fn(|i| all[i]), Vector6::from_fn(|i, _| all[6 + i]))
    };
    let function = BristleFunction { law, p: &values, query, bristles, deflection: at };
    let tangent = seen.state.tangent();
    let change = |i: usize| if i < 12 { tangent[i] } else { deflection[i - 12].plus(-at[i - 12]) };
    let mut all = match &seen.from_com {
        None => S::local(&function, std::array::from_fn::<S, 18, _>(change)),
        Some(from_com) => {
            let change = |i: usize| if i < 18 { change(i) } else { from_com[i - 18] };
            S::local(&function, std::array::from_fn::<S, 21, _>(change))
        }
    };
    let moved = changes(pair.params());
    if !moved.iter().all(|p| p.is_constant_zero()) {
        for (moved, column) in moved.iter().zip(function.by_parameters()) {
            for (component, slope) in all.iter_mut().zip(column) {
                *component += moved.times(slope);
            }
        }
    }
    split(all)
}

/// Zeros that carry the derivatives of `params`.
fn changes<S: Scalar>(params: &[S]) -> Vec<S> {
    params.iter().map(|p| p.plus(-p.value())).collect()
}
