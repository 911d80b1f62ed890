//! The hand's own numbers: joints within their limits, a base that the camera can see.

use nalgebra::Isometry3;
use prehend_geometry::robot::{KinematicTree, Motion};
use prehend_render::{Camera, DepthImage};

use super::limits::{BASE_DISTANCE, JOINT_EXCESS, JOINT_RATIO};
use super::warning::{Subject, Warning};
use crate::scene::{HandMeasurement, hand_depth};

/// Warnings of the pose and joints of a hand, and its depth image \[m\] if it makes sense to compare anything with that.
pub(super) fn check(
    measured: &HandMeasurement,
    camera: &Camera,
) -> (Vec<Warning>, Option<DepthImage>) {
    let hand = &measured.hand;
    let broken = |count: usize, finding: String| {
        (vec![Warning::new(Subject::Hand, (count as f64, ""), finding, "")], None)
    };
    if let Err(error) = hand.check_joints(&measured.joints) {
        return broken(measured.joints.len(), error.to_string());
    }
    let pose = measured.t_cam_hand.to_homogeneous();
    let numbers = measured.joints.iter().chain(pose.iter());
    match numbers.filter(|number| !number.is_finite()).count() {
        0 => {}
        count => return broken(count, "the hand's pose or a joint is no number".into()),
    }
    let joints = joints(&hand.tree, &measured.joints);
    let drawn = hand_depth(camera, Some(measured));
    let base = base(&measured.t_cam_hand, drawn.pixels().iter().any(|z| *z > 0.0));
    let other_unit = joints.as_ref().is_some_and(|(_, other_unit)| *other_unit);
    let plausible = base.is_none() && !other_unit;
    let warnings = joints.map(|(warning, _)| warning).into_iter().chain(base).collect();
    (warnings, plausible.then_some(drawn))
}

/// The joint that is farthest beyond its limits, and whether it is in another unit.
fn joints(tree: &KinematicTree, joints: &[f64]) -> Option<(Warning, bool)> {
    let excess = |q: f64, (low, high): (f64, f64)| (low - q).max(q - high).max(0.0);
    let limits = tree.joint_limits();
    let slides = |name: &String| {
        tree.joints().iter().any(|j| j.name == *name && j.motion == Motion::Prismatic)
    };
    let slides: Vec<bool> = tree.joint_names().iter().map(slides).collect();
    // Relative to what is allowed, so that radians and meters compare.
    let beyond = |j: usize, q: f64| excess(q, limits[j]) / JOINT_EXCESS[usize::from(slides[j])];
    let outside = || (0..joints.len()).filter(|&j| beyond(j, joints[j]) > 1.0);
    let worst = outside().max_by(|&a, &b| beyond(a, joints[a]).total_cmp(&beyond(b, joints[b])))?;
    let (q, (low, high)) = (joints[worst], limits[worst]);
    let (unit, factor, question) = match slides[worst] {
        true => ("m", 1e-3, "are positions of sliding joints in millimeters?"),
        false => ("rad", 1_f64.to_radians(), "are joints in degrees?"),
    };
    let mut alike = (0..joints.len()).filter(|&j| slides[j] == slides[worst]);
    let other_unit = q.abs() > JOINT_RATIO * low.abs().max(high.abs())
        && alike.all(|j| beyond(j, joints[j] * factor) <= 1.0);
    let hint = if other_unit { question } else { "are its name, sign and zero those of the URDF?" };
    let (name, by) = (&tree.joint_names()[worst], excess(q, limits[worst]));
    let (count, of) = (outside().count(), joints.len());
    let finding = format!(
        "joint {name} is at {q:.3} {unit}, {by:.3} {unit} outside its limits {low:.3} to {high:.3} \
         ({count} of {of} joints are outside)"
    );
    Some((Warning::new(Subject::Hand, (by, unit), finding, hint), other_unit))
}

/// A pose of the base (base → camera) at which no camera sees the hand; `seen` says whether it is in the image.
fn base(t_cam_hand: &Isometry3<f64>, seen: bool) -> Option<Warning> {
    let place = t_cam_hand.translation.vector;
    let distance = place.norm();
    let at = format!("(its base is at ({:.3}, {:.3}, {:.3}) m)", place.x, place.y, place.z);
    let (value, finding, hint) = if !BASE_DISTANCE.contains(&distance) {
        let finding = format!("the hand's base is {distance:.4} m from the camera");
        let hint = "is its position in the unit of the format (cam_t_b2c: millimeters)?";
        ((distance, "m"), finding, hint)
    } else if seen {
        return None;
    } else if place.z <= 0.0 {
        let hint =
            "does its pose map the base into the camera frame, z forward, and not the reverse?";
        ((place.z, "m"), format!("the hand is behind the camera {at}"), hint)
    } else {
        let hint = "is its pose in the camera frame, and cam_K that of this image?";
        ((0.0, "px"), format!("no pixel of the hand is in the image {at}"), hint)
    };
    Some(Warning::new(Subject::Hand, value, finding, hint))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_of_turning_and_sliding_joints_are_told_apart() {
        let joint = |name: &str, kind: &str, from: &str, to: &str, limit: &str| {
            format!(
                r#"<link name="{to}"/><joint name="{name}" type="{kind}"><parent link="{from}"/><child link="{to}"/>
                <axis xyz="0 0 1"/><limit {limit} effort="1" velocity="1"/></joint>"#
            )
        };
        let xml = format!(
            r#"<robot name="r"><link name="a"/>{}{}</robot>"#,
            joint("turn", "revolute", "a", "b", r#"lower="-0.5" upper="1.5""#),
            joint("slide", "prismatic", "b", "c", r#"lower="0" upper="0.04""#)
        );
        let tree = KinematicTree::from_urdf_str(&xml, None).unwrap();
        let told =
            |q: [f64; 2]| joints(&tree, &q).map(|(w, other)| (w.value, w.to_string(), other));
        assert_eq!(told([1.55, 0.043]), None);
        let (by, sentence, other_unit) = told([60.0, 0.02]).unwrap();
        assert!(other_unit && by == 58.5 && sentence.contains("degrees?"), "{sentence}");
        let (by, sentence, other_unit) = told([0.3, 25.0]).unwrap();
        assert!(other_unit && by == 24.96, "{sentence}");
        assert!(
            sentence.contains("joint slide is at 25.000 m") && sentence.contains("millimeters?")
        );
        // No angle within the limits is 120 degrees.
        let (_, sentence, other_unit) = told([120.0, 0.02]).unwrap();
        assert!(!other_unit && sentence.contains("name, sign and zero"), "{sentence}");
    }
}
