//! A model of which others differ in parameters alone.

use std::sync::Arc;

use prehend_autodiff::Scalar;

use super::Integrator;
use crate::articulated::Link;
use crate::body_state::states_of;
use crate::error::BuildError;
use crate::model::Model;
use crate::model::articulated_body::ArticulatedBody;
use crate::model::body::{Body, Motion};
use crate::model::contact_group::ContactGroup;
use crate::model::contact_pair::ContactPair;
use crate::model::joint_force::JointForce;
use crate::model::trajectory::plain;
use crate::state::State;

/// The model and the integrator that all steps, or all models of a batch, share.
#[derive(Debug)]
pub(crate) struct ModelTemplate<I> {
    pub(crate) integrator: I,
    pub(super) model: Model,
    parameters: Vec<f64>,
}

/// Parameters of a model that are not its template's constants, by their places.
pub(crate) struct ParameterDelta<S> {
    pub(crate) places: Box<[u32]>,
    pub(crate) values: Vec<S>,
}

impl<I: Integrator> ModelTemplate<I> {
    pub(crate) fn new<S: Scalar>(integrator: I, model: &Model<S>) -> Result<Arc<Self>, BuildError> {
        model.check_trajectories()?;
        let parameters: Vec<f64> = model.parameters().into_iter().map(S::value).collect();
        Ok(Arc::new(Self { model: model.map(S::value), parameters, integrator }))
    }

    pub(crate) fn model_values(&self) -> &Model {
        &self.model
    }

    pub(crate) fn changes<S: Scalar>(&self, model: &Model<S>) -> ParameterDelta<S> {
        let changed = |x: S, own: f64| x.value() != own || !x.is_constant();
        let all = (0..).zip(model.parameters()).zip(&self.parameters);
        let changes = all.filter(|((_, x), own)| changed(*x, **own)).map(|(change, _)| change);
        let (places, values): (Vec<u32>, _) = changes.unzip();
        ParameterDelta { places: places.into(), values }
    }

    /// True if `model` differs in parameters only.
    pub(crate) fn is_of<S: Scalar>(&self, model: &Model<S>) -> bool {
        has_parts_of(model, &self.model)
    }

    /// State at `time` \[s\] of the numbers of its rows.
    pub(crate) fn state<S: Scalar>(&self, rows: &[S], time: f64) -> State<S> {
        State::from_rows(states_of(rows).collect(), self.model.bodies.len(), time)
    }

    /// This template's model with `values` at `places`.
    pub(crate) fn model<S: Scalar>(
        &self,
        places: &[u32],
        values: &[S],
    ) -> Result<Model<S>, BuildError> {
        if places.is_empty() {
            return Ok(self.model.cast());
        }
        let mut all: Vec<S> = self.parameters.iter().map(|&x| S::constant(x)).collect();
        for (&place, &value) in places.iter().zip(values) {
            all[place as usize] = value;
        }
        self.model.with_parameters(&all)
    }
}

/// True if `a` is made of the same surfaces, fields, laws and trajectories as `b`.
fn has_parts_of<S: Scalar>(a: &Model<S>, b: &Model) -> bool {
    fn same<T: ?Sized>(a: Option<&Arc<T>>, b: Option<&Arc<T>>) -> bool {
        match (a, b) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (None, None) => true,
            _ => false,
        }
    }
    let body = |(a, b): (&Body<S>, &Body)| {
        let motion = match (&a.motion, &b.motion) {
            (Motion::Dynamic(_), Motion::Dynamic(_))
            | (Motion::Fixed, Motion::Fixed)
            | (Motion::Link, Motion::Link) => true,
            (Motion::Kinematic(a), Motion::Kinematic(b)) => {
                same(plain(a).as_ref(), plain(b).as_ref())
            }
            _ => false,
        };
        motion
            && same(a.surface.as_ref(), b.surface.as_ref())
            && same(a.field.as_ref(), b.field.as_ref())
    };
    let pair = |(a, b): (&ContactPair<S>, &ContactPair)| {
        (a.bodies, a.smoothing, a.weight) == (b.bodies, b.smoothing, b.weight)
            && Arc::ptr_eq(a.law(), b.law())
    };
    let group = |(a, b): (&ContactGroup<S>, &ContactGroup)| {
        a.has_bodies_of(b) && pair((&a.contact, &b.contact))
    };
    let articulation = |(a, b): (&ArticulatedBody<S>, &ArticulatedBody)| {
        let link = |(a, b): (&Link<S>, &Link)| (a.parent, &a.joint) == (b.parent, &b.joint);
        a.bodies() == b.bodies() && a.tree.links().iter().zip(b.tree.links()).all(link)
    };
    let force = |(a, b): (&JointForce<S>, &JointForce)| {
        (&a.axes, &a.path, a.input) == (&b.axes, &b.path, b.input) && Arc::ptr_eq(a.law(), b.law())
    };
    a.bodies.len() == b.bodies.len()
        && a.articulations.len() == b.articulations.len()
        && a.joint_forces.len() == b.joint_forces.len()
        && a.articulations.iter().zip(&b.articulations).all(articulation)
        && a.joint_forces.iter().zip(&b.joint_forces).all(force)
        && a.bushings.len() == b.bushings.len()
        && a.bushings
            .iter()
            .zip(&b.bushings)
            .all(|(a, b)| (a.bodies, a.frames) == (b.bodies, b.frames))
        && a.contacts.len() == b.contacts.len()
        && a.contact_groups.len() == b.contact_groups.len()
        && a.contact_groups.iter().zip(&b.contact_groups).all(group)
        && a.bodies.iter().zip(&b.bodies).all(body)
        && a.contacts.iter().zip(&b.contacts).all(pair)
}
