//! Robots of descriptions as bodies of a world.

mod constraints;
pub(crate) mod driven;
pub(crate) mod mjcf;
pub(crate) mod urdf;
