//! Options of `prehend track` for robots' logs.

use std::path::PathBuf;

use clap::Args;
use prehend_refine::data::bop::LengthUnit;

use crate::options::length_unit;

/// A robot's log, and what is tracked in it.
#[derive(Args)]
#[command(next_help_heading = "Robot's log")]
pub(crate) struct LogOptions {
    /// Instead of a dataset, follow one object through the images of this recording: an MCAP file of ROS 2 messages (docs/LOGS.md lists the topics that are read)
    #[arg(long, value_name = "LOG", conflicts_with_all = ["dataset", "watch", "targets"])]
    pub(super) mcap: Option<PathBuf>,
    /// The object's mesh (PLY, OBJ, STL, glTF)
    #[arg(long, value_name = "FILE", requires = "mcap")]
    pub(super) mesh: Option<PathBuf>,
    /// Unit of the mesh
    #[arg(long, value_name = "UNIT", default_value = "m", requires = "mcap", value_parser = length_unit())]
    pub(super) mesh_unit: LengthUnit,
    /// Mass of the object [default: 500 kg/m³]
    #[arg(long, value_name = "KG", requires = "mcap")]
    pub(super) mass: Option<f64>,
    /// The hand as URDF or MJCF: its joints are in the log, and its root link is a frame of the log's transforms
    #[arg(long, value_name = "URDF", requires = "mcap")]
    pub(super) hand: Option<PathBuf>,
    /// Taxels of that hand (see docs/DATASET.md): the log has their forces
    #[arg(long, value_name = "CSV", requires = "hand")]
    pub(super) taxels: Option<PathBuf>,
    /// Which topic has what, where several could: color=NAME, depth=NAME or mask=NAME; may be repeated
    #[arg(long, value_name = "WHAT=NAME", requires = "mcap")]
    pub(super) topic: Vec<String>,
    /// The frame of the log whose z-axis points up
    #[arg(long, value_name = "FRAME", default_value = "world", requires = "mcap")]
    pub(super) world: String,
    /// Write what was sensed and found to this MCAP file, which viewers (Foxglove, Rerun) open and --mcap reads again
    #[arg(long, value_name = "LOG", help_heading = "Output")]
    pub(super) mcap_out: Option<PathBuf>,
}
