//! Contacts between many bodies under one law.

use std::sync::Arc;

use prehend_autodiff::Scalar;

use super::contact_pair::{ContactBodies, ContactPair};
use crate::handle::BodyId;

/// Contacts between each body of one list and each of another, under one law with one set of parameters.
///
/// The broad phase finds those that may touch as they move, so that bodies far from each other cost nothing.
#[derive(Clone)]
pub struct ContactGroup<S: Scalar = f64> {
    /// The two lists, which may be the same, in ascending order.
    bodies: [Arc<[BodyId]>; 2],
    /// Pattern of the contacts: law, parameters and smoothing. Its bodies are those of one of them.
    pub contact: ContactPair<S>,
}

impl<S: Scalar> ContactGroup<S> {
    /// Between the bodies of two [`ascending`] lists, each contact like `contact`.
    pub(super) fn new(bodies: [Arc<[BodyId]>; 2], contact: ContactPair<S>) -> Self {
        Self { bodies, contact }
    }

    /// The two lists of bodies, in ascending order.
    pub fn bodies(&self) -> [&[BodyId]; 2] {
        self.bodies.each_ref().map(|bodies| &**bodies)
    }

    /// The contact between two of its bodies.
    pub(crate) fn pair(&self, bodies: ContactBodies, weight: f64) -> ContactPair<S> {
        let mut pair = self.contact.clone();
        (pair.bodies, pair.weight) = (bodies, weight);
        pair
    }

    /// True if the contact of `a`, of its first list, and `b`, of its second one, is not that of `b` and `a`.
    pub(crate) fn is_wanted(&self, a: BodyId, b: BodyId) -> bool {
        let has = |list: usize, body: BodyId| self.bodies[list].binary_search(&body).is_ok();
        a < b || a > b && !(has(0, b) && has(1, a))
    }

    /// Group, each number through `f`.
    pub(super) fn map<T: Scalar>(&self, f: impl Fn(S) -> T) -> ContactGroup<T> {
        ContactGroup { bodies: self.bodies.clone(), contact: self.contact.map(f) }
    }

    /// True if it has the same bodies as `other`.
    pub(crate) fn has_bodies_of<T: Scalar>(&self, other: &ContactGroup<T>) -> bool {
        self.bodies == other.bodies
    }
}

/// The bodies of a list, each once, in ascending order.
pub(super) fn ascending(bodies: &[BodyId]) -> Arc<[BodyId]> {
    let mut bodies = bodies.to_vec();
    bodies.sort_unstable();
    bodies.dedup();
    bodies.into()
}
