//! Robots of descriptions as bodies of a model.

mod constraints;
pub(crate) mod mjcf;
pub(crate) mod urdf;

pub use self::mjcf::{MjcfError, MjcfOptions, MjcfRobot};
pub use self::urdf::UrdfOptions;
