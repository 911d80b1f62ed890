//! Which body of a world.

use std::fmt;
use std::ops::{Index, IndexMut};

/// Which body of a world: given by [`World::add`](super::World::add), and the index of its body and state in slices.
///
/// ```
/// use nalgebra::{Isometry3, Vector3};
/// use prehend_sim::{Body, State, World};
///
/// let mut world = World::new(Vector3::zeros());
/// let belt = world.add(Body::fixed("belt"));
/// let mut states = [State::at_rest(Isometry3::identity())];
/// states[belt].linear.x = 0.1;
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
