//! Meshes, closest points, signed distance grids, kinematics and exact volumes.

mod field;
pub mod hand;
mod mesh;
pub mod objects;
pub mod shapes;

pub use field::{DistanceField, FieldSample};
pub use mesh::{Texture, TriMesh};
