//! Meshes, closest points, signed distance grids, kinematics and exact volumes.

mod field;
mod mesh;

mod clean;
mod io;
pub mod mass;
mod normals;
pub mod sample;
mod topology;
pub mod volume;
mod weld;

pub use field::{DistanceField, FieldSample};
pub use mesh::{Texture, TriMesh};

pub use clean::MeshReport;
pub use io::MeshError;
pub use mass::{MassError, MassProperties};
pub use sample::SurfaceSample;
pub use volume::{UnionBody, VolumeError};
