//! Robots of descriptions as bodies of a world.

pub(crate) mod driven;
mod inertia;
pub(crate) mod mjcf;
pub(crate) mod urdf;
