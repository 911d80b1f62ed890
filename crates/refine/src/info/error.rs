//! Why something was not described.

use std::path::{Path, PathBuf};

use prehend_geometry::MeshError;
use prehend_geometry::mjcf::MjcfError;
use prehend_geometry::robot::RobotError;
use prehend_render::ImageError;
use thiserror::Error;

use crate::data::bop::DatasetError;

/// Why something was not described; every message names the file.
#[derive(Debug, Error)]
pub enum InfoError {
    /// There is nothing at the path.
    #[error("{}: no such file or folder", path.display())]
    Missing {
        /// The path.
        path: PathBuf,
    },
    /// It is nothing that is known here.
    #[error(
        "{}: {problem}; known are meshes (PLY, OBJ, STL, glTF), URDF, MJCF, BOP datasets, frames and rigs (JSON), poses (CSV) and \
         images (PNG, JPEG)",
        path.display()
    )]
    Unknown {
        /// The path.
        path: PathBuf,
        /// Why not.
        problem: String,
    },
    /// A broken mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A broken URDF.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// A broken MJCF.
    #[error(transparent)]
    Mjcf(#[from] MjcfError),
    /// A broken dataset, frame, rig or results file.
    #[error(transparent)]
    Data(#[from] DatasetError),
    /// A broken image.
    #[error(transparent)]
    Image(#[from] ImageError),
}

impl InfoError {
    pub(super) fn unknown(path: &Path, problem: impl Into<String>) -> Self {
        Self::Unknown { path: path.into(), problem: problem.into() }
    }
}
