//! What contacts do.

use std::sync::Arc;

use nalgebra::{Vector3, Vector6};
use prehend_autodiff::{Fwd, Scalar};

use super::World;
use super::contact_pair::ContactPair;
use super::seen::Seen;
use crate::contact::bristles::{BristleFunction, Bristles};
use crate::contact::dimensions::{LANES, Lane, VariableShapes};
use crate::contact::patch::Patch;
use crate::contact::wrench::{WrenchFunction, stack};
use crate::shape::lifted::LiftedField;
use crate::state::State;

/// What a contact does.
pub(crate) struct Effect<S: Scalar> {
    /// Wrench on the body with the samples and on that with the field, each about its own center of mass.
    pub(crate) on_samples: Vector6<S>,
    pub(crate) on_field: Vector6<S>,
    /// Rate of the deflection of a contact that sticks, along the axes of the field \[m/s\], \[rad/s\].
    pub(crate) rate: Vector6<S>,
}

impl<S: Scalar> Default for Effect<S> {
    fn default() -> Self {
        let zero = Vector6::zeros();
        Self { on_samples: zero, on_field: zero, rate: zero }
    }
}

impl<S: Scalar> World<S> {
    /// External and contact wrenches on every body at `states` (force \[N\], torque about the center of mass \[N m\],
    /// world frame), without gravity; then the rate of the deflection (\[m/s\], \[rad/s\]) of every contact that sticks.
    /// `step` matters to leaks in the first step only.
    ///
    /// Derivatives through contacts are first derivatives.
    ///
    /// # Panics
    /// If there are fewer states than bodies.
    pub fn wrenches(&self, states: &[State<S>], step: usize) -> Vec<Vector6<S>> {
        if !self.contact_groups.is_empty() {
            return self.with_touching(states, 0.0).wrenches(states, step);
        }
        let mut wrenches: Vec<Vector6<S>> =
            self.bodies.iter().map(|body| body.external_wrench).collect();
        for pair in &self.contacts {
            let bristles = pair.law().bristles();
            let deflection = bristles.and_then(|_| states.get(wrenches.len()));
            let Effect { on_samples, on_field, rate } = self.effect(pair, states, deflection, step);
            wrenches[pair.bodies.samples] += on_samples;
            wrenches[pair.bodies.field] += on_field;
            if bristles.is_some() {
                wrenches.push(rate);
            }
        }
        wrenches
    }

    /// What `pair` does with its `deflection`, if it sticks and has one.
    pub(crate) fn effect(
        &self,
        pair: &ContactPair<S>,
        states: &[State<S>],
        deflection: Option<&State<S>>,
        step: usize,
    ) -> Effect<S> {
        let seen = self.seen(pair, states);
        let Some(patch) = self.patch(pair, seen.state.value()) else { return Effect::default() };
        let patch = Patch { smoothing: pair.smoothing.at_step(step), ..patch };
        let deflection = deflection.map_or_else(Vector6::zeros, State::deflection);
        let (mut wrench, mut rate) = match pair.law().bristles() {
            None => (local_wrench(pair, &seen, &patch), Vector6::zeros()),
            Some(bristles) => local_bristles(pair, &seen, &patch, bristles, deflection),
        };
        if S::ORDER > 0 {
            self.add_slopes_by_dimensions(pair, &patch, &deflection, &mut wrench, &mut rate);
        }
        let [fx, fy, fz, tx, ty, tz] = wrench;
        let (state, base) = (&states[pair.bodies.samples], &states[pair.bodies.field]);
        let rotation = base.pose.rotation;
        let force = rotation * Vector3::new(fx, fy, fz).map(|x| x.times(pair.weight));
        let torque = rotation * Vector3::new(tx, ty, tz).map(|x| x.times(pair.weight));
        let offset = state.pose.translation.vector - base.pose.translation.vector;
        let (on_samples, on_field) =
            (stack(&force, &torque), stack(&-force, &-(torque + offset.cross(&force))));
        Effect { on_samples, on_field, rate }
    }

    /// Adds to the wrench and rate of `patch`, which is `pair`, the derivatives that the dimensions of its shapes carry.
    fn add_slopes_by_dimensions(
        &self,
        pair: &ContactPair<S>,
        patch: &Patch<'_>,
        deflection: &Vector6<S>,
        wrench: &mut [S; 6],
        rate: &mut Vector6<S>,
    ) {
        let ends = [pair.bodies.samples, pair.bodies.field].map(|id| &self.bodies[id]);
        if ends.iter().all(|body| body.dimensions().iter().all(is_constant)) {
            return;
        }
        let moved = ends.map(|body| changes(body.dimensions()));
        let variable = |(i, x): (usize, &S)| (!x.is_constant_zero()).then_some(i);
        let places: Vec<usize> = moved.iter().flatten().enumerate().filter_map(variable).collect();
        let Some(field) = ends[1].field.as_ref().filter(|_| !places.is_empty()) else { return };
        let values: Vec<f64> = pair.params().iter().map(|p| p.value()).collect();
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
            let shapes = VariableShapes { patch, samples, field };
            let law = pair.law().as_ref();
            let mut slopes = [Lane::constant(0.0); 12];
            match law.bristles() {
                None => slopes[..6].copy_from_slice(&shapes.wrench(law, &values)),
                Some(bristles) => {
                    let deflection = deflection.map(S::value);
                    let function = BristleFunction { law, p: &values, patch, bristles, deflection };
                    slopes = shapes.bristles(&function);
                }
            }
            let all = wrench.iter_mut().chain(rate.iter_mut());
            for (component, slopes) in all.zip(slopes) {
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

    /// The samples of `pair` beside its field, which sees their body in `state`, if there are both.
    pub(crate) fn patch<'a>(&'a self, pair: &'a ContactPair<S>, state: State) -> Option<Patch<'a>> {
        let body = &self.bodies[pair.bodies.samples];
        Some(Patch {
            surface: pair.near.as_ref().or(body.surface.as_ref())?,
            com: body.com().map(S::value),
            state,
            field: self.bodies[pair.bodies.field].field.as_deref()?,
            smoothing: pair.smoothing,
        })
    }
}

/// The wrench of `patch`, which is `pair` at the value of `seen`, with the derivatives that `seen` and the parameters
/// carry.
fn local_wrench<S: Scalar>(pair: &ContactPair<S>, seen: &Seen<S>, patch: &Patch<'_>) -> [S; 6] {
    const { assert!(S::ORDER <= 1, "contacts have first derivatives only: no nested scalars") };
    let values: Vec<f64> = pair.params().iter().map(|p| p.value()).collect();
    if S::ORDER == 0 {
        return pair.law().wrench(&values, patch).map(S::constant).into();
    }
    let law = pair.law().as_ref();
    let wrench = if pair.params().iter().all(is_constant) {
        S::local(&WrenchFunction { law, p: &values, patch }, seen.state.tangent())
    } else {
        let moved = changes(pair.params());
        let jacobian = law.wrench_jacobian(&values, patch, true);
        let mut wrench = S::local(&jacobian, seen.state.tangent());
        for (by_param, moved) in jacobian.by_params.iter().zip(moved) {
            for (component, slope) in wrench.iter_mut().zip(by_param.iter()) {
                *component += moved.times(*slope);
            }
        }
        wrench
    };
    let [fx, fy, fz, tx, ty, tz] = wrench;
    match &seen.from_com {
        None => wrench,
        Some(from_com) => {
            let torque = Vector3::new(tx, ty, tz) + from_com.cross(&Vector3::new(fx, fy, fz));
            stack(&Vector3::new(fx, fy, fz), &torque).into()
        }
    }
}

/// [`local_wrench`] of a contact that sticks, and the rate of its deflection.
fn local_bristles<S: Scalar>(
    pair: &ContactPair<S>,
    seen: &Seen<S>,
    patch: &Patch<'_>,
    bristles: Bristles,
    deflection: Vector6<S>,
) -> ([S; 6], Vector6<S>) {
    const { assert!(S::ORDER <= 1, "contacts have first derivatives only: no nested scalars") };
    let law = pair.law().as_ref();
    let values: Vec<f64> = pair.params().iter().map(|p| p.value()).collect();
    let at = deflection.map(|x| x.value());
    let split = |all: [S; 12]| -> ([S; 6], Vector6<S>) {
        (std::array::from_fn(|i| all[i]), Vector6::from_fn(|i, _| all[6 + i]))
    };
    let function = BristleFunction { law, p: &values, patch, bristles, deflection: at };
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
    for (from, moved) in moved.chunks(6).enumerate().map(|(i, moved)| (6 * i, moved)) {
        if moved.iter().all(|p| p.is_constant_zero()) {
            continue;
        }
        let seeded = |(i, &p): (usize, &f64)| match i.checked_sub(from) {
            Some(lane) if lane < 6 => Fwd::<6>::variable(p, lane),
            _ => Fwd::constant(p),
        };
        let p: Vec<Fwd<6>> = values.iter().enumerate().map(seeded).collect();
        let slopes = function.response(&p, &[Fwd::constant(0.0); 18], None);
        for (component, slope) in all.iter_mut().zip(slopes) {
            for (moved, slope) in moved.iter().zip(slope.derivative) {
                *component += moved.times(slope);
            }
        }
    }
    split(all)
}

/// Whether a number carries no derivatives.
fn is_constant<S: Scalar>(x: &S) -> bool {
    x.plus(-x.value()).is_constant_zero()
}

/// Zeros that carry the derivatives of `params`.
fn changes<S: Scalar>(params: &[S]) -> Vec<S> {
    params.iter().map(|p| p.plus(-p.value())).collect()
}
