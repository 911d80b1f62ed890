//! Meshes, closest points, signed distance grids, kinematics and exact volumes.

mod field;
mod mesh;

pub use field::{DistanceField, FieldSample};
pub use mesh::{Texture, TriMesh};
