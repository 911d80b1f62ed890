//! `prehend info`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use prehend_refine::data::bop::LengthUnit;
use prehend_refine::info::{DescribeOptions, describe};
use serde_json::json;

use crate::options::length_unit;
use crate::robot_options::RobotOptions;
use crate::terminal::say;

#[derive(Args)]
#[command(next_help_heading = "Input")]
pub(crate) struct Info {
    /// A mesh (PLY, OBJ, STL, glTF), a robot (URDF, MJCF), the folder of a BOP dataset, a frame (JSON), a rig (JSON), poses (CSV) or
    /// an image (PNG, JPEG)
    #[arg(value_name = "PATH")]
    path: PathBuf,
    /// Unit of a mesh
    #[arg(long, value_name = "UNIT", default_value = "m", value_parser = length_unit())]
    mesh_unit: LengthUnit,
    /// Print volume, mass, center and inertia of a mesh of this density, too, in kg/m³
    #[arg(long, value_name = "DENSITY")]
    density: Option<f64>,
    /// Split of a dataset [default: test, or the only one]
    #[arg(long, value_name = "NAME")]
    split: Option<String>,
    #[command(flatten)]
    robot: RobotOptions,
    /// List all joints of a robot, all scenes of a dataset and all parameters of a rig
    #[arg(long, help_heading = "Output")]
    all: bool,
    /// Print JSON, warnings included
    #[arg(long, help_heading = "Output")]
    json: bool,
}

impl Info {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        if self.density.is_some_and(|density| !(density > 0.0 && density.is_finite())) {
            bail!("--density: must be above zero");
        }
        let options = DescribeOptions {
            mesh_unit: self.mesh_unit.meters(),
            density: self.density,
            split: self.split,
            robot: self.robot.read()?,
        };
        let described = describe(&self.path, &options)?;
        if self.json {
            say(format!("{:#}", json!(described)))?;
        } else {
            let text = if self.all { format!("{described:#}") } else { described.to_string() };
            say(text.trim_end())?;
            described.warnings.iter().for_each(|warning| log::warn!("{warning}"));
        }
        Ok(ExitCode::SUCCESS)
    }
}
