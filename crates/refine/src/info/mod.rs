//! What a file or a folder is, what it holds and what is wrong with it, without using it.
//!
//! [`describe`] tells meshes, robots, datasets, frame files, rigs, poses and images apart, reads them as everything else here does, and returns
//! a [`Description`] that prints as a few lines and serializes as a JSON object.

mod dataset;
mod detect;
mod error;
mod frame;
mod image;
mod lines;
mod mesh;
mod poses;
mod rig;
mod robot;

use std::fmt;
use std::path::{Path, PathBuf};

use prehend_geometry::ReadOptions;
use serde::Serialize;

pub use self::dataset::{DatasetInfo, SceneInfo};
pub use self::error::InfoError;
pub use self::frame::{FrameInfo, HandInfo};
pub use self::image::{ImageInfo, ImageKind};
pub use self::mesh::{MassInfo, MeshInfo};
pub use self::poses::PosesInfo;
pub use self::rig::{ParameterInfo, RigInfo};
pub use self::robot::{JointInfo, RobotInfo};

/// How a thing is read that does not say so itself.
#[derive(Clone, Debug)]
pub struct DescribeOptions {
    /// Meters of one unit of a mesh.
    pub mesh_unit: f64,
    /// Density \[kg/m³\] of a mesh whose mass properties are wanted.
    pub density: Option<f64>,
    /// Split of a dataset; `test` or the only one without.
    pub split: Option<String>,
    /// How a robot is read.
    pub robot: ReadOptions,
}

impl Default for DescribeOptions {
    fn default() -> Self {
        Self { mesh_unit: 1.0, density: None, split: None, robot: ReadOptions::default() }
    }
}

/// What a path holds.
#[derive(Clone, Debug, Serialize)]
pub struct Description {
    /// The path described.
    pub path: PathBuf,
    /// What is there.
    #[serde(flatten)]
    pub content: Content,
    /// What is wrong with it, or was not read.
    pub warnings: Vec<String>,
}

/// What there can be.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Content {
    /// A triangle mesh.
    Mesh(MeshInfo),
    /// A robot or scene in URDF or MJCF.
    Robot(RobotInfo),
    /// A dataset in BOP format.
    Dataset(DatasetInfo),
    /// A frame in JSON.
    Frame(Box<FrameInfo>),
    /// A calibrated rig.
    Rig(RigInfo),
    /// Poses: a BOP results file.
    Poses(PosesInfo),
    /// A color, depth or gray image.
    Image(ImageInfo),
}

/// Says what is at `path`.
///
/// # Errors
/// [`InfoError`], naming the file: if there is nothing, or nothing that is known, or it is broken.
pub fn describe(path: &Path, options: &DescribeOptions) -> Result<Description, InfoError> {
    let mut warnings = Vec::new();
    let content = detect::content(path, options, &mut warnings)?;
    Ok(Description { path: path.into(), content, warnings })
}

impl fmt::Display for Description {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let path = self.path.display();
        match &self.content {
            Content::Mesh(info) => write!(f, "{path}: mesh\n{info}"),
            Content::Robot(info) => write!(f, "{path}: robot\n{info}"),
            Content::Dataset(info) => write!(f, "{path}: dataset in BOP format\n{info}"),
            Content::Frame(info) => write!(f, "{path}: frame\n{info}"),
            Content::Rig(info) => write!(f, "{path}: rig\n{info}"),
            Content::Poses(info) => write!(f, "{path}: poses, a BOP results file\n{info}"),
            Content::Image(info) => write!(f, "{path}: image\n{info}"),
        }
    }
}
