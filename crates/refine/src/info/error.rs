//! Why something was not described.

use prehend_geometry::MeshError;
use prehend_geometry::mjcf::MjcfError;
use prehend_geometry::robot::RobotError;
use thiserror::Error;

use crate::data::bop::DatasetError;

/// Why something was not described; every message names the file.
#[derive(Debug, Error)]
pub enum InfoError {
    /// A broken mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A broken URDF.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// A broken MJCF.
    #[error(transparent)]
    Mjcf(#[from] MjcfError),
    /// Nothing, nothing that is known, or a broken dataset, frame, rig, results file or image.
    #[error(transparent)]
    Data(#[from] DatasetError),
}
