//! Meshes, closest points, signed distance grids, kinematics and exact volumes.

pub mod closest;
mod field;
mod mesh;
pub mod robot;
pub mod sdf;

pub use closest::ClosestPoints;
pub use field::{DistanceField, FieldSample};
pub use mesh::{Texture, TriMesh};
pub use robot::{PosedRobot, Robot, RobotShape};
pub use sdf::SdfGrid;
