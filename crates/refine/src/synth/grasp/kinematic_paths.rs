//! Joints that move each link, and their screws.

use nalgebra::{Isometry3, Point3, Vector3};
use prehend_geometry::robot::{Drive, KinematicTree, Motion};

/// Which joints move which link.
pub(super) struct KinematicPaths {
    /// Joints between the root and each link.
    paths: Vec<Vec<usize>>,
}

/// The motion of the bodies behind a joint, a unit of the joint variable, in the hand's frame.
#[derive(Clone, Copy)]
pub(super) struct Screw {
    /// Entry of the joint vector.
    pub(super) variable: usize,
    /// Rate of rotation.
    pub(super) angular: Vector3<f64>,
    /// Velocity of the body's point at the origin.
    linear: Vector3<f64>,
}

impl Screw {
    /// Velocity of a body's point that is at `point`.
    pub(super) fn velocity(&self, point: &Point3<f64>) -> Vector3<f64> {
        self.linear + self.angular.cross(&point.coords)
    }
}

impl KinematicPaths {
    pub(super) fn new(robot: &KinematicTree) -> Self {
        let path = |link: usize| {
            let mut path = Vec::new();
            let mut current = link;
            while let Some(j) = robot.joints().iter().position(|j| j.child == current) {
                let joint = &robot.joints()[j];
                if joint.motion != Motion::Fixed && joint.drive != Drive::None {
                    path.push(j);
                }
                current = joint.parent;
            }
            path
        };
        Self { paths: (0..robot.links().len()).map(path).collect() }
    }

    /// Joints that move `link`.
    pub(super) fn path(&self, link: usize) -> &[usize] {
        &self.paths[link]
    }

    /// Entries of the joint vector that move one of two links relative to the other.
    pub(super) fn between(&self, robot: &KinematicTree, a: usize, b: usize) -> Vec<usize> {
        let (a, b) = (&self.paths[a], &self.paths[b]);
        let own = a.iter().filter(|j| !b.contains(j)).chain(b.iter().filter(|j| !a.contains(j)));
        own.filter_map(|&j| variable(robot, j)).collect()
    }

    /// The screw of every joint (none for those that do not move) with the links at `poses`.
    pub(super) fn screws(robot: &KinematicTree, poses: &[Isometry3<f64>]) -> Vec<Option<Screw>> {
        let screw = |joint: &prehend_geometry::robot::Joint| {
            let Drive::Variable { index: variable, multiplier, .. } = joint.drive else {
                return None;
            };
            let t_hand_joint = poses[joint.parent] * joint.t_parent_joint;
            let axis = t_hand_joint.rotation * joint.axis.into_inner() * multiplier;
            let (angular, linear) = match joint.motion {
                Motion::Fixed => return None,
                Motion::Revolute => (axis, t_hand_joint.translation.vector.cross(&axis)),
                Motion::Prismatic => (Vector3::zeros(), axis),
            };
            Some(Screw { variable, angular, linear })
        };
        robot.joints().iter().map(screw).collect()
    }
}

fn variable(robot: &KinematicTree, joint: usize) -> Option<usize> {
    match robot.joints()[joint].drive {
        Drive::Variable { index, .. } => Some(index),
        Drive::None => None,
    }
}

#[cfg(test)]
mod tests {
    use prehend_geometry::hand::allegro_xela_urdf;

    use super::*;

    #[test]
    fn screws_are_the_columns_of_the_jacobian() {
        let robot = KinematicTree::from_urdf_str(&allegro_xela_urdf(), None).unwrap();
        let joints: Vec<f64> = (0..16).map(|i| 0.3 + 0.05 * f64::from(i)).collect();
        let poses = robot.forward_kinematics(&joints);
        let (paths, screws) = (KinematicPaths::new(&robot), KinematicPaths::screws(&robot, &poses));
        let link = robot.link_index("link_15.0").unwrap();
        let point = Point3::new(0.01, 0.02, 0.03);
        let jacobian = robot.jacobian(&joints, link, &point);
        let path = paths.path(link);
        assert_eq!(path.len(), 4);
        for &j in path {
            let screw = screws[j].unwrap();
            let column = jacobian.column(screw.variable);
            let velocity = screw.velocity(&(poses[link] * point));
            assert!((velocity - column.fixed_rows::<3>(0)).norm() < 1e-12);
            assert!((screw.angular - column.fixed_rows::<3>(3)).norm() < 1e-12);
        }
        let palm = robot.link_index("base_link").unwrap();
        assert_eq!(paths.between(&robot, palm, link).len(), 4);
        let other = robot.link_index("link_14.0").unwrap();
        assert_eq!(paths.between(&robot, other, link).len(), 1);
    }
}
