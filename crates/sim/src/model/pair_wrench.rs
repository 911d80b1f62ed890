//! Wrenches of contacts.

use std::sync::Arc;

use nalgebra::{Rotation3, SVector, Vector3, Vector6};
use prehend_autodiff::{Fwd, Scalar};

use super::Model;
use super::contact_pair::ContactPair;
use super::linear_contacts::LinearContacts;
use super::relative_motion::{RelativeMotion, reaction};
use crate::body_state::{BodyState, Rows};
use crate::contact::bristle_function::BristleFunction;
use crate::contact::contact_query::ContactQuery;
use crate::contact::wrench::WrenchFunction;
use crate::shape::lifted::LiftedField;
use crate::shape::variable::{LANES, Lane, VariableShapes};
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
            let has_bristles = pair.law().bristles().is_some();
            if S::RECORDED && !has_bristles {
                linear.add(self, pair, states, step, &mut wrenches);
                continue;
            }
            let deflection = if has_bristles { states.get(wrenches.len()) } else { None };
            let PairWrench { on_samples, on_field, rate } =
                self.pair_wrench(pair, states, deflection, step);
            if has_bristles {
                wrenches.push(rate);
            }
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
        let Some(query) = &self.contact_query_at(pair, states, step) else {
            return PairWrench::default();
        };
        let (law, p) = (pair.law().as_ref(), &pair.param_values());
        let ids = [pair.bodies.samples, pair.bodies.field];
        if S::ORDER == 0 && law.bristles().is_none() {
            let local: [S; 6] = law.wrench(p, query).map(S::constant).into();
            let axes = states[ids[1]].value().pose.rotation.to_rotation_matrix();
            let [force, torque] = weighted(&axes, &local, pair.weight);
            return Self::on_both(pair, states, force, torque);
        }
        let shifted = ids.map(|id| self.shifted(id, states));
        let ends = [0, 1].map(|end| match &shifted[end] {
            Some((state, _)) => state,
            None => &states[ids[end]],
        });
        let from_com = shifted[0].as_ref().map(|(_, from_com)| from_com);
        let axes = || ends[1].value().pose.rotation.to_rotation_matrix();
        let varies = pair.params().iter().any(|x| !x.is_constant());
        if let Some(bristles) = law.bristles() {
            let deflection = deflection.map_or_else(Vector6::zeros, BodyState::deflection);
            let at = deflection.map(S::value);
            let function = BristleFunction { law, p, query, bristles, deflection: at };
            let com = self.bodies[ids[1]].com().coords.map(S::value);
            let ([mut force, mut torque], mut rate) =
                bristle_wrench(&function, pair.weight, &com, ends, from_com, &deflection);
            let by_params = if varies { function.by_parameters() } else { Vec::new() };
            if let Some(slopes) = self.slopes(pair, query, &at, &by_params) {
                let [by_force, by_torque] = weighted(&axes(), &slopes, pair.weight);
                (force, torque) = (force + by_force, torque + by_torque);
                rate += Vector6::from_column_slice(&slopes[6..]);
            }
            return PairWrench { rate, ..Self::on_both(pair, states, force, torque) };
        }
        let motion = RelativeMotion::new(ends.map(BodyState::value));
        let none = &Vector6::zeros();
        let ([mut force, mut torque], slopes) = if varies {
            let jacobian = law.wrench_jacobian(p, query, true);
            let own = motion.wrench(&jacobian, pair.weight, ends);
            (own, self.slopes(pair, query, none, &jacobian.by_params))
        } else {
            let own = motion.wrench(&WrenchFunction { law, p, query }, pair.weight, ends);
            (own, self.slopes::<6>(pair, query, none, &[]))
        };
        if let Some(slopes) = slopes {
            let [by_force, by_torque] = weighted(&axes(), &slopes, pair.weight);
            (force, torque) = (force + by_force, torque + by_torque);
        }
        if let Some(from_com) = from_com {
            torque += from_com.cross(&force);
        }
        Self::on_both(pair, states, force, torque)
    }

    /// Force of `pair` with undeflected bristles \[N\].
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

    /// Samples of `pair` beside its field in a step, if there are both.
    pub(crate) fn contact_query_at<'a>(
        &'a self,
        pair: &'a ContactPair<S>,
        states: &Rows<S>,
        step: usize,
    ) -> Option<ContactQuery<'a>> {
        let query = self.contact_query(pair, self.relative_value(pair, states))?;
        Some(ContactQuery { smoothing: pair.smoothing.at_step(step), ..query })
    }

    /// Wrenches of a force and torque on the body with the samples, about its center of mass.
    #[inline]
    fn on_both(
        pair: &ContactPair<S>,
        states: &Rows<S>,
        force: Vector3<S>,
        torque: Vector3<S>,
    ) -> PairWrench<S> {
        let [samples, field] = [pair.bodies.samples, pair.bodies.field].map(|id| &states[id]);
        let offset = samples.pose.translation.vector - field.pose.translation.vector;
        let [on_samples, on_field] = reaction(&force, &torque, &offset);
        PairWrench { on_samples, on_field, rate: Vector6::zeros() }
    }

    /// Adds the derivatives by the dimensions of its shapes to those of the wrench of `query`, which is `pair`, and of its rate.
    fn add_slopes_by_dimensions(
        &self,
        pair: &ContactPair<S>,
        query: &ContactQuery<'_>,
        deflection: &Vector6<f64>,
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
                    let deflection = *deflection;
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

    /// Change of the wrench of `pair`, which has these derivatives by its parameters, and of the rate of its deflection, with those and
    /// with dimensions, if any vary: tangents, along the axes of the field.
    pub(super) fn slopes<const N: usize>(
        &self,
        pair: &ContactPair<S>,
        query: &ContactQuery<'_>,
        deflection: &Vector6<f64>,
        by_params: &[SVector<f64, N>],
    ) -> Option<[S; 12]> {
        let mut slopes = [S::zero(); 12];
        for (by_param, moved) in by_params.iter().zip(changes(pair.params())) {
            for (component, slope) in slopes.iter_mut().zip(by_param.iter()) {
                *component += moved.times(*slope);
            }
        }
        self.add_slopes_by_dimensions(pair, query, deflection, &mut slopes);
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

/// Force and torque of a contact with bristles on the body with the samples, and the rate of its deflection, by what states, the place of
/// their point `from_com` and the deflection carry; the field's center of mass is `com` of its body frame.
///
/// The tangent is that of [`BodyState::relative_to`]: default steps follow its last digits.
pub(super) fn bristle_wrench<T: Scalar>(
    function: &BristleFunction<'_>,
    weight: f64,
    com: &Vector3<f64>,
    ends: [&BodyState<T>; 2],
    from_com: Option<&Vector3<T>>,
    deflection: &Vector6<T>,
) -> ([Vector3<T>; 2], Vector6<T>) {
    let frame = ends[1].shifted(&com.map(|x| T::constant(-x)));
    let seen = ends[0].relative_to(&frame).tangent();
    let at = &function.deflection;
    let change = |i: usize| if i < 12 { seen[i] } else { deflection[i - 12].plus(-at[i - 12]) };
    let axes = &ends[1].pose.rotation;
    let local = match from_com.map(|from_com| axes.inverse_transform_vector(from_com)) {
        None => T::local(function, std::array::from_fn::<T, 18, _>(change)),
        Some(from_com) => {
            let change = |i: usize| if i < 18 { change(i) } else { from_com[i - 18] };
            T::local(function, std::array::from_fn::<T, 21, _>(change))
        }
    };
    let part = |from: usize| axes * Vector3::from_fn(|i, _| local[from + i].times(weight));
    ([part(0), part(3)], Vector6::from_column_slice(&local[6..]))
}

/// Force and torque along the axes of the model, weighted, of those along the constant `axes` of a field.
#[inline]
pub(super) fn weighted<S: Scalar>(
    axes: &Rotation3<f64>,
    local: &[S],
    weight: f64,
) -> [Vector3<S>; 2] {
    let axes = axes.cast::<S>();
    [0, 3].map(|from| axes * Vector3::from_fn(|i, _| local[from + i].times(weight)))
}

/// Zeros that carry the derivatives of `params`.
fn changes<S: Scalar>(params: &[S]) -> Vec<S> {
    params.iter().map(|p| p.plus(-p.value())).collect()
}
