//! Robots and scenes in URDF and MJCF.

use std::collections::BTreeMap;
use std::path::Path;

use prehend_geometry::mass::mass_properties;
use prehend_geometry::mjcf::{JointKind, Model};
use prehend_geometry::robot::{Drive, Motion};
use prehend_geometry::{KinematicTree, ReadOptions};
use serde_json::{Value, json};

use crate::data::AssetError;

/// Name, links, colliding shapes, mass of all links \[kg\], joints but for fixed ones, and how many of each motion there are. Of a joint: name, motion, moved
/// link, smallest and largest position \[rad or m\], joint that it follows.
pub(super) fn of_urdf(
    path: &Path,
    options: &ReadOptions,
    warnings: &mut Vec<String>,
) -> Result<Value, AssetError> {
    let tree = KinematicTree::from_urdf_file_with(path, options)?;
    warnings.extend_from_slice(tree.warnings());
    let joint = |joint: &prehend_geometry::robot::Joint| {
        let motion = match joint.motion {
            Motion::Fixed => return None,
            Motion::Revolute => "revolute",
            Motion::Prismatic => "prismatic",
        };
        let leader = match joint.drive {
            Drive::Variable { index, .. } => tree.joint_names().get(index),
            Drive::None => None,
        };
        Some(json!({
            "name": joint.name,
            "motion": motion,
            "child": tree.links()[joint.child].name,
            "limits": joint.limits,
            "mimics": leader.filter(|name| **name != joint.name),
        }))
    };
    let joints: Vec<Value> = tree.joints().iter().filter_map(joint).collect();
    for link in tree.links() {
        let faulty = link.parts.iter().filter_map(|part| mass_properties(part, 1.0).err());
        warnings.extend(faulty.map(|e| format!("link '{}': collision {e}", link.name)));
    }
    let shapes: usize = tree.links().iter().map(|link| link.parts.len()).sum();
    if shapes == 0 {
        warnings.push("no link has a collision shape: nothing can touch it".to_owned());
    }
    let inertials = tree.links().iter().filter_map(|link| link.inertial);
    Ok(json!({
        "format": "URDF",
        "name": tree.name(),
        "links": tree.links().len(),
        "shapes": shapes,
        "mass_kg": inertials.fold(0.0, |sum, inertial| sum + inertial.mass),
        "motions": motions(&joints),
        "joints": joints,
    }))
}

/// Bodies, geoms and joints of MJCF under the same names, with its actuators and keyframes.
pub(super) fn of_mjcf(
    path: &Path,
    options: &ReadOptions,
    warnings: &mut Vec<String>,
) -> Result<Value, AssetError> {
    let model = Model::from_file_with(path, options)?;
    warnings.extend(model.warnings.iter().map(ToString::to_string));
    let joints = model.bodies.iter().flat_map(|body| body.joints.iter().map(move |j| (body, j)));
    let joints = joints.map(|(body, joint)| {
        let motion = match joint.kind {
            JointKind::Hinge => "revolute",
            JointKind::Slide => "prismatic",
            JointKind::Ball => "ball",
            JointKind::Free => "free",
        };
        json!({
            "name": joint.name,
            "motion": motion,
            "child": body.name,
            "limits": joint.range,
            "mimics": null,
        })
    });
    let joints: Vec<Value> = joints.collect();
    let inertials = model.bodies.iter().filter_map(|body| body.inertial);
    let geoms: usize = model.bodies.iter().map(|body| body.geoms.len()).sum();
    Ok(json!({
        "format": "MJCF",
        "name": model.name,
        "links": model.bodies.len(),
        "shapes": model.world_geoms.len() + geoms,
        "mass_kg": inertials.fold(0.0, |sum, inertial| sum + inertial.mass),
        "actuators": model.actuators.len(),
        "keyframes": model.keyframes.len(),
        "motions": motions(&joints),
        "joints": joints,
    }))
}

/// Number of joints by motion.
fn motions(joints: &[Value]) -> BTreeMap<&str, usize> {
    let mut motions = BTreeMap::new();
    for motion in joints.iter().filter_map(|joint| joint["motion"].as_str()) {
        *motions.entry(motion).or_default() += 1;
    }
    motions
}
