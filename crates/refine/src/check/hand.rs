//! The hand's own numbers: joints within their limits, a base that the camera can see.

use nalgebra::Isometry3;
use prehend_geometry::robot::KinematicTree;
use prehend_render::{Camera, DepthImage};

use super::limits;
use super::warning::{Subject, Warnings};
use crate::scene::{HandMeasurement, hand_depth, prismatic_joints};

/// Adds what is wrong with pose and joints of a hand to `found`; returns its depth image \[m\] if it makes sense to compare anything with that.
pub(super) fn check(
    measured: &HandMeasurement,
    camera: &Camera,
    found: &mut Warnings,
) -> Option<DepthImage> {
    if let Some(broken) = broken(measured) {
        found.add(Subject::Hand, broken);
        return None;
    }
    let drawn = hand_depth(camera, Some(measured));
    let joints = joints(&measured.hand.tree, &measured.joints);
    let other_unit = joints.as_ref().is_some_and(|(_, other_unit)| *other_unit);
    let base = base(&measured.t_cam_hand, drawn.pixels().iter().any(|z| *z > 0.0));
    let plausible = base.is_none() && !other_unit;
    let messages = joints.map(|(message, _)| message).into_iter().chain(base);
    messages.for_each(|message| found.add(Subject::Hand, message));
    plausible.then_some(drawn)
}

/// Reason why a hand cannot be drawn.
pub(super) fn broken(measured: &HandMeasurement) -> Option<String> {
    let pose = measured.t_cam_hand.to_homogeneous();
    let mut numbers = measured.joints.iter().chain(pose.iter());
    let error = measured.hand.check_joints(&measured.joints).err();
    error.map(|error| error.to_string()).or_else(|| {
        let is_finite = numbers.all(|number| number.is_finite());
        (!is_finite).then(|| "the hand's pose or a joint is no number".to_owned())
    })
}

/// The joint that is farthest beyond its limits, and whether it is in another unit.
fn joints(tree: &KinematicTree, joints: &[f64]) -> Option<(String, bool)> {
    let excess = |q: f64, (low, high): (f64, f64)| (low - q).max(q - high).max(0.0);
    let limits = tree.joint_limits();
    let slides = prismatic_joints(tree);
    // Relative to what is allowed, so that radians and meters compare.
    let beyond =
        |j: usize, q: f64| excess(q, limits[j]) / limits::JOINT_EXCESS[usize::from(slides[j])];
    let outside = || (0..joints.len()).filter(|&j| beyond(j, joints[j]) > 1.0);
    let worst = outside().max_by(|&a, &b| beyond(a, joints[a]).total_cmp(&beyond(b, joints[b])))?;
    let (q, (low, high)) = (joints[worst], limits[worst]);
    let (unit, factor, question) = match slides[worst] {
        true => ("m", 1e-3, "are positions of sliding joints in millimeters?"),
        false => ("rad", 1_f64.to_radians(), "are joints in degrees?"),
    };
    let mut alike = (0..joints.len()).filter(|&j| slides[j] == slides[worst]);
    let other_unit = q.abs() > limits::JOINT_RATIO * low.abs().max(high.abs())
        && alike.all(|j| beyond(j, joints[j] * factor) <= 1.0);
    let cause =
        if other_unit { question } else { "are its name, sign and zero those of its description?" };
    let (name, by) = (&tree.joint_names()[worst], excess(q, limits[worst]));
    let (count, of) = (outside().count(), joints.len());
    let message = format!(
        "joint {name} is at {q:.3} {unit}, {by:.3} {unit} outside its limits {low:.3} to {high:.3} \
         ({count} of {of} joints are outside): {cause}"
    );
    Some((message, other_unit))
}

/// A pose of the base (base → camera) at which no camera sees the hand; `seen` says whether it is in the image.
fn base(t_cam_hand: &Isometry3<f64>, seen: bool) -> Option<String> {
    let place = t_cam_hand.translation.vector;
    let distance = place.norm();
    let at = format!("(its base is at ({:.3}, {:.3}, {:.3}) m)", place.x, place.y, place.z);
    if !limits::BASE_DISTANCE.contains(&distance) {
        return Some(format!(
            "the hand's base is {distance:.4} m from the camera: is its position in the unit of the format (cam_t_b2c: millimeters)?"
        ));
    }
    let message = match place.z <= 0.0 {
        true => format!(
            "the hand is behind the camera {at}: does its pose map the base into the camera frame, z forward, and not the reverse?"
        ),
        false => format!(
            "no pixel of the hand is in the image {at}: is its pose in the camera frame, and cam_K that of this image?"
        ),
    };
    (!seen).then_some(message)
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
        let told = |q: [f64; 2]| joints(&tree, &q);
        assert_eq!(told([1.55, 0.043]), None);
        let (sentence, other_unit) = told([60.0, 0.02]).unwrap();
        assert!(other_unit && sentence.contains("58.500 rad outside"), "{sentence}");
        assert!(sentence.contains("degrees?"), "{sentence}");
        let (sentence, other_unit) = told([0.3, 25.0]).unwrap();
        assert!(other_unit && sentence.contains("24.960 m outside"), "{sentence}");
        assert!(
            sentence.contains("joint slide is at 25.000 m") && sentence.contains("millimeters?")
        );
        // No angle within the limits is 120 degrees.
        let (sentence, other_unit) = told([120.0, 0.02]).unwrap();
        assert!(!other_unit && sentence.contains("name, sign and zero"), "{sentence}");
    }
}
