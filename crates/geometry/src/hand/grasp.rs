//! A ready-made grasp: the mustard bottle in a power grasp of the built-in hand.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion};

use super::JOINT_COUNT;
use crate::objects::YcbObject;

/// An object held in the built-in hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grasp {
    /// Object held.
    pub object: YcbObject,
    /// Joint angles \[rad\] in the order of [`super::JOINT_NAMES`].
    pub joints: [f64; JOINT_COUNT],
    /// Maps object coordinates into the frame of the hand's base link.
    pub t_base_object: Isometry3<f64>,
}

/// The mustard bottle lying against the palm, its neck towards +y and its front away from the palm, three fingers
/// curled around it and the thumb across its front.
///
/// Found by closing each joint until its finger pressed 0.1 mm into the bottle; the palm, two phalanges of every
/// finger and the thumb's tip touch.
pub fn default_grasp() -> Grasp {
    let joints = [
        [0.0, 0.2331, 1.0413, 0.8245],
        [0.0, 0.2659, 1.0452, 0.8680],
        [0.0, 0.2183, 1.0400, 0.8166],
        [1.38, 0.2, 0.6603, 0.6828],
    ];
    // The object's x, y and z are the hand's x, −z and y.
    let turn = Rotation3::from_matrix_unchecked(Matrix3::new(
        1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0,
    ));
    Grasp {
        object: YcbObject::MustardBottle,
        joints: std::array::from_fn(|i| joints[i / 4][i % 4]),
        t_base_object: Isometry3::from_parts(
            Translation3::new(0.0463, 0.035, 0.015),
            UnitQuaternion::from_rotation_matrix(&turn),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand::ALLEGRO_XELA_URDF;
    use crate::hand::posed::{dense, gap, link_poses, posed, surface};
    use crate::robot::KinematicTree;

    #[test]
    fn palm_fingers_and_thumb_touch_and_hardly_penetrate() {
        let grasp = default_grasp();
        let points = dense(&grasp.object.mesh().transformed(&grasp.t_base_object), 0.0015);
        let poses = link_poses(&grasp.joints);
        let links = std::iter::once(None).chain((0..JOINT_COUNT).map(Some));
        let gaps: Vec<f64> = links.map(|link| gap(&posed(link, &poses), &points)).collect();
        assert!(gaps[0] < 1e-3, "palm {}", gaps[0]);
        for finger in 0..4 {
            let tip = gaps[1 + 4 * finger + 3];
            assert!(tip < 1e-3, "tip of finger {finger}: {tip}");
        }
        let depths: Vec<f64> = gaps.iter().filter(|g| **g < 1e-3).map(|g| (-g).max(0.0)).collect();
        assert!(depths.len() >= 8, "{gaps:?}");
        assert!(depths.iter().sum::<f64>() / (depths.len() as f64) < 5e-4, "{gaps:?}");
        assert!(gaps.iter().all(|g| *g > -2.5e-4), "{gaps:?}");
    }

    #[test]
    fn joints_are_within_limits_and_the_thumb_clears_the_fingers() {
        let grasp = default_grasp();
        let robot = KinematicTree::from_urdf_str(ALLEGRO_XELA_URDF, None).unwrap();
        robot.check_joints(&grasp.joints).unwrap();
        let poses = link_poses(&grasp.joints);
        let thumb: Vec<_> = [14, 15].iter().flat_map(|i| posed(Some(*i), &poses)).collect();
        let thumb: Vec<_> = thumb
            .iter()
            .flat_map(|(pose, part)| dense(&surface(part).transformed(pose), 2e-3))
            .collect();
        for i in 0..12 {
            let clearance = gap(&posed(Some(i), &poses), &thumb);
            assert!(clearance > 0.01, "link {i}: {clearance}");
        }
    }
}
