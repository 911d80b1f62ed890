//! Meshes, closest points, signed distance grids, kinematics, descriptions of robots and exact volumes.

#![cfg_attr(docsrs, feature(doc_cfg))]

mod box_tree;
mod clean;
pub mod closest;
pub mod cloud;
mod contact_area;
mod expansion;
mod field;
pub mod hand;
mod hull;
mod inertial;
mod io;
pub mod mass;
mod mesh;
pub mod mjcf;
mod moments;
mod normals;
pub mod objects;
mod orient;
mod predicates;
mod random;
mod read_options;
mod report;
pub mod robot;
mod robust;
pub mod sample;
pub mod sdf;
mod self_intersection;
pub mod shapes;
mod simplify;
pub mod topology;
pub mod volume;
mod weld;

pub use closest::ClosestPoints;
pub use cloud::KdTree;
pub use contact_area::contact_area;
pub use field::{DistanceField, FieldSample};
pub use inertial::Inertial;
pub use io::{
    AtomicFile, FilmBody, FilmCamera, FilmKey, GlbFilm, MeshError, limits, open_plain,
    plain_target, read_plain, write_atomic,
};
pub use mass::{MassError, MassProperties};
pub use mesh::{Texture, TriMesh};
pub use moments::Moments;
pub use random::SplitMix64;
pub use read_options::ReadOptions;
pub use report::MeshReport;
pub use robot::{KinematicTree, PosedRobot, RobotShape};
pub use robust::RobustKernel;
pub use sample::SurfaceSample;
pub use sdf::{GridCache, SdfGrid};
pub use volume::{SolidUnion, VolumeError};
pub use weld::Weld;
