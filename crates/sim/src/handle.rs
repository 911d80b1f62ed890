//! Handles of what was added to a model.

use std::fmt;
use std::ops::{Index, IndexMut};

/// Handle of a body of a model: given by [`Model::add`](crate::Model::add), and the index of its body and of its part of a [`State`](crate::State).
///
/// ```
/// use nalgebra::Vector3;
/// use prehend_sim::{Body, Model};
///
/// let mut model = Model::new(Vector3::zeros());
/// let belt = model.add(Body::fixed("belt"));
/// let mut state = model.neutral_state();
/// state[belt].linear.x = 0.1;
/// assert_eq!(model.bodies[belt].name, "belt");
/// ```
#[derive(Clone, Copy, Debug, Eq, Hash, Ord, PartialEq, PartialOrd)]
pub struct BodyId(pub(crate) usize);

impl BodyId {
    /// The place of the body among those of its model, from 0.
    pub fn index(self) -> usize {
        self.0
    }
}

/// Handle of contacts that were added together: given by [`Model::add_contact`](crate::Model::add_contact),
/// [`add_symmetric_contact`](crate::Model::add_symmetric_contact) and [`add_contacts_between`](crate::Model::add_contacts_between).
///
/// [`Model::set_contact_param`](crate::Model::set_contact_param) sets a parameter of all of them.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub struct ContactId(pub(crate) ContactPlace);

/// Place of contacts in a model.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub(crate) enum ContactPlace {
    /// A range of [`Model::contacts`](crate::Model::contacts).
    Pairs {
        /// Index of the first.
        first: usize,
        /// Number of them.
        count: usize,
    },
    /// One of [`Model::contact_groups`](crate::Model::contact_groups).
    Group(usize),
}

/// Handle of a bushing of a model: given by [`Model::add_bushing`](crate::Model::add_bushing), for
/// [`Model::bushing_mut`](crate::Model::bushing_mut).
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub struct BushingId(pub(crate) usize);

/// Handle of a force along joints of a model: given by [`Model::add_joint_force`](crate::Model::add_joint_force), for
/// [`Model::joint_force_mut`](crate::Model::joint_force_mut).
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub struct JointForceId(pub(crate) usize);

impl fmt::Display for BodyId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl<T> Index<BodyId> for [T] {
    type Output = T;

    #[inline]
    fn index(&self, body: BodyId) -> &T {
        &self[body.0]
    }
}

impl<T> IndexMut<BodyId> for [T] {
    #[inline]
    fn index_mut(&mut self, body: BodyId) -> &mut T {
        &mut self[body.0]
    }
}

impl<T> Index<BodyId> for Vec<T> {
    type Output = T;

    #[inline]
    fn index(&self, body: BodyId) -> &T {
        &self[body.0]
    }
}

impl<T> IndexMut<BodyId> for Vec<T> {
    #[inline]
    fn index_mut(&mut self, body: BodyId) -> &mut T {
        &mut self[body.0]
    }
}
