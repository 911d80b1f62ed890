//! The closest point of a whole robot.

use nalgebra::Point3;

use super::PosedRobot;
use crate::closest::Closest;
use crate::closest::box_distance;

/// A closest point of a robot's bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobotClosest {
    /// The link.
    pub link: usize,
    /// The body of the link, in the order of [`LinkShape::parts`](super::LinkShape::parts).
    pub part: usize,
    /// The point in the world frame \[m\], with face, feature and barycentrics on that body.
    pub closest: Closest,
}

impl PosedRobot {
    /// The point of any body's surface that is closest to `point`, or `None` beyond `max_distance` \[m\].
    ///
    /// Links are visited from the nearest box on, each with what is left of the distance, and every body has its own
    /// tree: no tree is rebuilt when the robot moves. Surfaces buried in other bodies count. Of points equally near, the one of the first link is found.
    ///
    /// The gradient of the distance by the point is `(point − closest.point) / distance`, wherever it is unique.
    pub fn closest(&self, point: &Point3<f64>, max_distance: f64) -> Option<RobotClosest> {
        let mut nearest: Vec<(f64, usize)> = self
            .solids()
            .map(|(link, t_link_world, bounds)| {
                (box_distance(bounds, &(t_link_world * point)), link)
            })
            .filter(|(gap, _)| *gap <= max_distance)
            .collect();
        nearest.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut best: Option<RobotClosest> = None;
        for (gap, link) in nearest {
            let limit = best.as_ref().map_or(max_distance, |b| b.closest.distance);
            if gap > limit {
                break;
            }
            let t_world_link = &self.t_world_links()[link];
            let local = t_world_link.inverse_transform_point(point);
            for (part, body) in self.shape().links()[link].closest().iter().enumerate() {
                let limit = best.as_ref().map_or(max_distance, |b| b.closest.distance);
                let Some(found) = body.closest(&local, limit) else { continue };
                let first = best.as_ref().is_none_or(|b| {
                    found.distance < b.closest.distance
                        || found.distance == b.closest.distance && (link, part) < (b.link, b.part)
                });
                if first {
                    let closest = Closest { point: t_world_link * found.point, ..found };
                    best = Some(RobotClosest { link, part, closest });
                }
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Isometry3, Vector3};

    use super::*;
    use crate::closest::ClosestPoints;
    use crate::hand::{ALLEGRO_XELA_URDF, JOINT_COUNT};
    use crate::random::SplitMix64;
    use crate::robot::{KinematicTree, RobotShape};

    #[test]
    fn it_is_the_closest_point_of_all_bodies_in_one_mesh() {
        let robot = KinematicTree::from_urdf_str(ALLEGRO_XELA_URDF, None).unwrap();
        // A coarse grid: it does not enter here.
        let shape = Arc::new(RobotShape::new(&robot, 0.01, 0.01).unwrap());
        let base = Isometry3::new(Vector3::new(0.3, -0.2, 0.5), Vector3::new(0.4, 1.0, -0.7));
        let joints = [0.4; JOINT_COUNT];
        let poses: Vec<_> = robot.forward_kinematics(&joints).iter().map(|t| base * t).collect();
        let posed = PosedRobot::new(shape, poses).unwrap();
        let whole = ClosestPoints::new(&posed.mesh()).unwrap();
        let mut random = SplitMix64::new(2);
        let mut unit = || random.uniform() - 0.5;
        let points: Vec<_> = (0..2000)
            .map(|_| base * Point3::new(0.3 * unit(), 0.4 * unit(), 0.5 * unit()))
            .collect();
        for p in &points {
            let found = posed.closest(p, 1.0).unwrap();
            let expected = whole.closest(p, 1.0).unwrap();
            assert!((found.closest.distance - expected.distance).abs() < 1e-14);
            assert!(((p - found.closest.point).norm() - found.closest.distance).abs() < 1e-14);
            // The answer lies on the face that it names.
            let body = &posed.shape().links()[found.link].parts()[found.part];
            let corners = body.triangle(found.closest.face as usize);
            let on_face = corners
                .iter()
                .zip(found.closest.barycentric)
                .fold(Vector3::zeros(), |sum, (corner, w)| sum + corner.coords * w);
            let on_face = posed.t_world_links()[found.link] * Point3::from(on_face);
            assert!((on_face - found.closest.point).norm() < 1e-14);
            let distance = found.closest.distance;
            assert_eq!(posed.closest(p, distance * 1.001), Some(found));
            assert!(distance == 0.0 || posed.closest(p, distance * 0.999).is_none());
        }
        assert!(posed.closest(&Point3::new(f64::NAN, 0.0, 0.0), 1.0).is_none());
    }
}
