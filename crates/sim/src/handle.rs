//! Handles of what was added to a world.

use std::fmt;
use std::ops::{Index, IndexMut};

/// Handle of a body of a world: given by [`World::add`](crate::World::add), and the index of its body and of its part of a [`State`](crate::State).
///
/// ```
/// use nalgebra::Vector3;
/// use prehend_sim::{Body, World};
///
/// let mut world = World::new(Vector3::zeros());
/// let belt = world.add(Body::fixed("belt"));
/// let mut state = world.neutral_state();
/// state[belt].linear.x = 0.1;
/// assert_eq!(world.bodies[belt].name, "belt");
/// ```
#[derive(Clone, Copy, Debug, Eq, Hash, Ord, PartialEq, PartialOrd)]
pub struct BodyId(pub(crate) usize);

impl BodyId {
    /// The place of the body among those of its world, from 0.
    pub fn index(self) -> usize {
        self.0
    }
}

/// Handle of contacts that were added together: given by [`World::add_contact`](crate::World::add_contact),
/// [`add_symmetric_contact`](crate::World::add_symmetric_contact) and [`add_contacts_between`](crate::World::add_contacts_between).
///
/// [`World::set_contact_param`](crate::World::set_contact_param) sets a parameter of all of them.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub struct ContactId(pub(crate) ContactPlace);

/// Place of contacts in a world.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub(crate) enum ContactPlace {
    /// A range of [`World::contacts`](crate::World::contacts).
    Pairs {
        /// Index of the first.
        first: usize,
        /// Number of them.
        count: usize,
    },
    /// One of [`World::contact_groups`](crate::World::contact_groups).
    Group(usize),
}

/// Handle of a bushing of a world: given by [`World::add_bushing`](crate::World::add_bushing), for
/// [`World::bushing_mut`](crate::World::bushing_mut).
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub struct BushingId(pub(crate) usize);

/// Handle of a force along joints of a world: given by [`World::add_joint_force`](crate::World::add_joint_force), for
/// [`World::joint_force_mut`](crate::World::joint_force_mut).
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
