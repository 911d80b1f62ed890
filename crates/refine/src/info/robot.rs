//! Robots and scenes in URDF and MJCF.

use std::fmt;
use std::path::Path;

use prehend_geometry::mass::mass_properties;
use prehend_geometry::mjcf::{JointKind, Model};
use prehend_geometry::robot::{Drive, Motion};
use prehend_geometry::{KinematicTree, ReadOptions};
use serde::Serialize;

use super::InfoError;
use super::lines::line;

/// A robot, or a scene of robots.
#[derive(Clone, Debug, Serialize)]
pub struct RobotInfo {
    /// `URDF` or `MJCF`.
    pub format: &'static str,
    /// Its name.
    pub name: String,
    /// Links, which are called bodies in MJCF.
    pub links: usize,
    /// Shapes that collide, of all links.
    pub shapes: usize,
    /// Mass of all links \[kg\].
    pub mass_kg: f64,
    /// Its joints, but for fixed ones.
    pub joints: Vec<JointInfo>,
    /// Motors and servos; a URDF has none.
    pub actuators: usize,
    /// States that it comes with; a URDF has none.
    pub keyframes: usize,
}

/// A joint of a robot.
#[derive(Clone, Debug, Serialize)]
pub struct JointInfo {
    /// Its name, empty where it has none.
    pub name: String,
    /// How it moves: `revolute`, `prismatic`, `ball` or `free`.
    pub motion: &'static str,
    /// The link that it moves.
    pub child: String,
    /// Smallest and largest position \[rad or m\], where it is limited.
    pub limits: Option<[f64; 2]>,
    /// The joint that it follows, where it has no position of its own.
    pub mimics: Option<String>,
}

impl RobotInfo {
    pub(super) fn of_urdf(
        path: &Path,
        options: &ReadOptions,
        warnings: &mut Vec<String>,
    ) -> Result<Self, InfoError> {
        let tree = KinematicTree::from_urdf_file_with(path, options)?;
        warnings.extend_from_slice(tree.warnings());
        let mut joints = Vec::new();
        for joint in tree.joints() {
            let motion = match joint.motion {
                Motion::Fixed => continue,
                Motion::Revolute => "revolute",
                Motion::Prismatic => "prismatic",
            };
            let leader = match joint.drive {
                Drive::Variable { index, .. } => tree.joint_names().get(index),
                Drive::None => None,
            };
            joints.push(JointInfo {
                name: joint.name.clone(),
                motion,
                child: tree.links()[joint.child].name.clone(),
                limits: joint.limits.map(|(low, high)| [low, high]),
                mimics: leader.filter(|name| **name != joint.name).cloned(),
            });
        }
        for link in tree.links() {
            let faulty = link.parts.iter().filter_map(|part| mass_properties(part, 1.0).err());
            warnings.extend(faulty.map(|e| format!("link '{}': collision {e}", link.name)));
        }
        let shapes = tree.links().iter().map(|link| link.parts.len()).sum();
        if shapes == 0 {
            warnings.push("no link has a collision shape: nothing can touch it".to_owned());
        }
        let inertials = tree.links().iter().filter_map(|link| link.inertial);
        Ok(Self {
            format: "URDF",
            name: tree.name().to_owned(),
            links: tree.links().len(),
            shapes,
            mass_kg: inertials.map(|inertial| inertial.mass).sum(),
            joints,
            actuators: 0,
            keyframes: 0,
        })
    }

    pub(super) fn of_mjcf(
        path: &Path,
        options: &ReadOptions,
        warnings: &mut Vec<String>,
    ) -> Result<Self, InfoError> {
        let model = Model::from_file_with(path, options)?;
        warnings.extend(model.warnings.iter().map(ToString::to_string));
        let joints = model.bodies.iter().flat_map(|body| {
            body.joints.iter().map(|joint| JointInfo {
                name: joint.name.clone(),
                motion: match joint.kind {
                    JointKind::Hinge => "revolute",
                    JointKind::Slide => "prismatic",
                    JointKind::Ball => "ball",
                    JointKind::Free => "free",
                },
                child: body.name.clone(),
                limits: joint.range.map(|(low, high)| [low, high]),
                mimics: None,
            })
        });
        let inertials = model.bodies.iter().filter_map(|body| body.inertial);
        Ok(Self {
            format: "MJCF",
            name: model.name.clone(),
            links: model.bodies.len(),
            shapes: model.world_geoms.len()
                + model.bodies.iter().map(|body| body.geoms.len()).sum::<usize>(),
            mass_kg: inertials.map(|inertial| inertial.mass).sum(),
            joints: joints.collect(),
            actuators: model.actuators.len(),
            keyframes: model.keyframes.len(),
        })
    }
}

/// Joints that are listed at most, so that it all fits a screen.
const MOST_LISTED: usize = 16;

impl RobotInfo {
    /// How many joints there are, of each kind.
    fn motions(&self) -> String {
        let kinds = ["revolute", "prismatic", "ball", "free"].into_iter().filter_map(|kind| {
            let count = self.joints.iter().filter(|joint| joint.motion == kind).count();
            (count > 0).then(|| format!("{count} {kind}"))
        });
        let kinds: Vec<String> = kinds.collect();
        let count = self.joints.len();
        if kinds.is_empty() { format!("{count}") } else { format!("{count}: {}", kinds.join(", ")) }
    }
}

impl fmt::Display for RobotInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { format, links, shapes, actuators, keyframes, .. } = self;
        line(f, "name", format!("{} ({format})", self.name))?;
        line(f, "links", format!("{links}, with {shapes} shapes and {:.4} kg", self.mass_kg))?;
        if *format == "MJCF" {
            line(f, "actuators", actuators)?;
            line(f, "keyframes", keyframes)?;
        }
        line(f, "joints", self.motions())?;
        for JointInfo { name, motion, child, limits, mimics } in
            self.joints.iter().take(MOST_LISTED)
        {
            let limits = match limits {
                Some([low, high]) => format!("{low:.3} to {high:.3}"),
                None => "no limits".to_owned(),
            };
            let mimics = mimics.as_ref().map(|m| format!(", follows {m}")).unwrap_or_default();
            writeln!(f, "    {name}: {motion}, {limits}, moves {child}{mimics}")?;
        }
        match self.joints.len().checked_sub(MOST_LISTED) {
            Some(more @ 1..) => writeln!(f, "    and {more} more: --json lists all"),
            _ => Ok(()),
        }
    }
}
