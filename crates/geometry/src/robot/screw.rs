//! How the joints of a robot move its links.

use nalgebra::{Isometry3, Point3, Vector3};

use super::{Drive, Joint, KinematicTree, Motion};

/// The motion of what is behind a joint, a unit of its entry of the joint vector: multiplier included.
#[derive(Clone, Copy, Debug)]
pub struct Screw {
    /// Entry of the joint vector.
    pub variable: usize,
    /// Rate of rotation \[1\].
    pub angular: Vector3<f64>,
    /// Velocity of the point of the body at the origin \[m/rad or 1\].
    pub linear: Vector3<f64>,
}

impl Screw {
    /// Velocity of the point of the body at `point` \[m/rad or 1\].
    #[inline]
    pub fn velocity(&self, point: &Point3<f64>) -> Vector3<f64> {
        self.linear + self.angular.cross(&point.coords)
    }
}

impl Joint {
    /// Entry of the joint vector and its factor, if the joint moves.
    fn entry(&self) -> Option<(usize, f64)> {
        match self.drive {
            Drive::Variable { index, multiplier, .. } if self.motion != Motion::Fixed => {
                Some((index, multiplier))
            }
            _ => None,
        }
    }
}

impl KinematicTree {
    /// The screws of the joints that move, with the links at `poses`, in whose frame they are.
    ///
    /// # Panics
    /// If there are fewer poses than links.
    pub fn screws(&self, poses: &[Isometry3<f64>]) -> Vec<Screw> {
        let screw = |&j: &usize| {
            let joint = &self.joints[j];
            let (variable, multiplier) = joint.entry()?;
            let t_joint = poses[joint.parent] * joint.t_parent_joint;
            let axis = t_joint.rotation * joint.axis.into_inner() * multiplier;
            let (angular, linear) = match joint.motion {
                Motion::Prismatic => (Vector3::zeros(), axis),
                _ => (axis, t_joint.translation.vector.cross(&axis)),
            };
            Some(Screw { variable, angular, linear })
        };
        self.order.iter().filter_map(screw).collect()
    }

    /// For each link the joints that move it, from the link to the base, by their place among the
    /// [`screws`](KinematicTree::screws).
    pub fn paths(&self) -> Vec<Vec<usize>> {
        let mut paths: Vec<Vec<usize>> = vec![Vec::new(); self.links.len()];
        let mut screws = 0..;
        for &j in &self.order {
            let joint = &self.joints[j];
            let own = joint.entry().and_then(|_| screws.next());
            paths[joint.child] = own.into_iter().chain(paths[joint.parent].clone()).collect();
        }
        paths
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand::ALLEGRO_XELA_URDF;

    #[test]
    fn paths_lead_from_links_to_the_base() {
        let robot = KinematicTree::from_urdf_str(ALLEGRO_XELA_URDF, None).unwrap();
        let paths = robot.paths();
        let link = robot.link_index("link_15.0").unwrap();
        let tip = robot.link_index("link_14.0").unwrap();
        assert_eq!((paths[link].len(), paths[tip].len()), (4, 3));
        assert_eq!(paths[link][1..], paths[tip]);
        assert!(paths[robot.link_index("base_link").unwrap()].is_empty());
    }
}
