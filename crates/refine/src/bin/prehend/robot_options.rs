//! How the description of a robot is read.

use std::path::PathBuf;

use anyhow::anyhow;
use clap::Args;
use prehend_geometry::ReadOptions;

/// Choices that a URDF or MJCF file leaves open.
#[derive(Args)]
#[command(next_help_heading = "Robots")]
pub(crate) struct RobotOptions {
    /// Leave out, with a warning, what is not supported though it changes masses, joints, contacts or actuators
    #[arg(long)]
    partial: bool,
    /// Folder that meshes and other named files may lie in [default: the next one above the file with a package.xml or .git, else the file's own]
    #[arg(long, value_name = "DIR")]
    root: Option<PathBuf>,
    /// Folder of a ROS package, for package:// names; may be repeated. Others are looked for where ROS_PACKAGE_PATH and AMENT_PREFIX_PATH say, and
    /// above the file
    #[arg(long, value_name = "NAME=DIR")]
    package: Vec<String>,
    /// Read named files wherever they lie
    #[arg(long)]
    allow_outside: bool,
    /// Replace inertias that no body can have by those of the collision shapes
    #[arg(long)]
    inertia_from_geometry: bool,
}

impl RobotOptions {
    pub(crate) fn read(self) -> anyhow::Result<ReadOptions> {
        let package = |text: &String| {
            let (name, folder) = text.split_once('=').filter(|(name, _)| !name.is_empty())?;
            Some((name.to_owned(), PathBuf::from(folder)))
        };
        let packages = self.package.iter().map(|text| {
            package(text).ok_or_else(|| anyhow!("--package {text}: expected NAME=DIR"))
        });
        let options = ReadOptions {
            partial: self.partial,
            root: self.root,
            packages: packages.collect::<anyhow::Result<_>>()?,
            allow_outside: self.allow_outside,
            inertia_from_geometry: self.inertia_from_geometry,
            ..ReadOptions::default()
        };
        Ok(options.with_ros_packages())
    }
}
