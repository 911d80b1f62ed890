//! Meshes, closest points, signed distance grids, kinematics and exact volumes.

pub mod closest;
mod field;
mod mesh;
pub mod sdf;

pub use closest::ClosestPoints;
pub use field::{DistanceField, FieldSample};
pub use mesh::{Texture, TriMesh};
pub use sdf::SdfGrid;
