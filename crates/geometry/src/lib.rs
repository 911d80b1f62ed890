//! Meshes, closest points, signed distance grids, kinematics and exact volumes.

mod clean;
pub mod closest;
mod contact_area;
mod field;
pub mod hand;
mod io;
pub mod mass;
mod mesh;
mod normals;
pub mod objects;
mod random;
pub mod robot;
pub mod sample;
pub mod sdf;
pub mod shapes;
pub mod topology;
pub mod volume;
mod weld;

pub use clean::MeshReport;
pub use closest::ClosestPoints;
pub use contact_area::contact_area;
pub use field::{DistanceField, FieldSample};
pub use io::{MeshError, write_whole};
pub use mass::{MassError, MassProperties};
pub use mesh::{Texture, TriMesh};
pub use random::SplitMix64;
pub use robot::{PosedRobot, Robot, RobotShape};
pub use sample::SurfaceSample;
pub use sdf::SdfGrid;
pub use volume::{Overlap, UnionBody, VolumeError};
pub use weld::Weld;
