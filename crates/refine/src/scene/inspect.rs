//! What looks wrong with an input before any refinement.

use nalgebra::Isometry3;
use prehend_render::depth_map;

use super::frame::hand_depth;
use super::{Hand, Object, Observation};

/// Sizes between which an object's extent is believed to be in meters \[m\].
const PLAUSIBLE_EXTENT: std::ops::Range<f64> = 5e-3..5.0;

/// Warnings about an object's model, in plain sentences; empty if all looks well.
pub(crate) fn inspect_object(object: &Object) -> Vec<String> {
    let mut warnings = Vec::new();
    let extent = 2.0 * object.radius;
    if !PLAUSIBLE_EXTENT.contains(&extent) {
        warnings.push(format!(
            "the mesh is {extent:.4} m across: is it in meters, or in millimeters as BOP has it?"
        ));
    }
    if object.inertial_assumed {
        warnings.push(format!(
            "the object's mass is unknown: {:.3} kg was assumed from 500 kg/m³",
            object.inertial.mass
        ));
    }
    if !object.report.watertight {
        warnings.push(format!(
            "the mesh is not closed ({} open edges): what is inside it is a guess",
            object.report.open_edges
        ));
    }
    warnings
}

/// Warnings about units and frames at a pose (object → camera), in plain sentences; empty if all looks
/// well. Those about the object alone are [`inspect_object`]'s.
pub(crate) fn inspect_pose(
    observation: &Observation,
    object: &Object,
    robot: Option<&Hand>,
    t_cam_object: &Isometry3<f64>,
) -> Vec<String> {
    let mut warnings = Vec::new();
    let center = t_cam_object * object.center;
    if center.z <= 0.0 {
        warnings.push(format!("the object is behind the camera (z = {:.3} m)", center.z));
        return warnings;
    }
    if let (Some(robot), Some(hand)) = (robot, &observation.hand)
        && let Err(error) = robot.check_joints(&hand.joints)
    {
        warnings.push(error.to_string());
        return warnings;
    }
    let rendered = depth_map(&observation.camera, &[(&object.model, *t_cam_object)]);
    let hand = hand_depth(&observation.camera, robot.zip(observation.hand.as_ref()));
    let mut ratios = Vec::new();
    let (mut overlap, mut union) = (0_usize, 0_usize);
    let pixels = rendered.pixels().iter().zip(hand.pixels());
    let observed = observation.depth.pixels().iter().zip(observation.mask.pixels());
    for ((&object_z, &hand_z), (&sensor_z, &masked)) in pixels.zip(observed) {
        let visible = object_z > 0.0 && (hand_z == 0.0 || object_z < hand_z);
        overlap += usize::from(visible && masked);
        union += usize::from(visible || masked);
        if visible && masked && sensor_z > 0.0 {
            ratios.push(sensor_z / object_z);
        }
    }
    if overlap == 0 {
        warnings
            .push("the object at this pose does not touch its mask: wrong frame or pose?".into());
    } else if (overlap as f64) < 0.3 * union as f64 {
        let share = 100.0 * overlap as f64 / union as f64;
        warnings.push(format!("the object at this pose overlaps its mask by only {share:.0} %"));
    }
    ratios.sort_by(f32::total_cmp);
    let median = ratios.get(ratios.len() / 2).copied();
    if let Some(ratio) = median.filter(|r| !(0.5..2.0).contains(r)) {
        warnings.push(format!(
            "sensor depth is {ratio:.3} times the depth at this pose: check depth_scale and units"
        ));
    }
    warnings
}
