//! A robot's collision shape in a pose: signed distance, surface distance, and meshes.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3};

use super::{Result, RobotError, RobotShape};
use crate::closest::box_distance;
use crate::field::{DistanceField, FieldSample};
use crate::mesh::TriMesh;
use crate::sdf::SdfGrid;

/// A [`RobotShape`] with a pose for every link.
///
/// As a [`DistanceField`] it is the smallest of its links' grids: smooth but for creases where two links
/// are equally near. Inside, where links or bodies overlap, the depth is understated.
#[derive(Clone, Debug)]
pub struct PosedRobot {
    shape: Arc<RobotShape>,
    t_world_links: Vec<Isometry3<f64>>,
    /// Links that have a shape.
    solid: Vec<LinkSolid>,
}

/// A link with a shape, ready for queries.
#[derive(Clone, Debug)]
struct LinkSolid {
    link: usize,
    t_link_world: Isometry3<f64>,
    /// Sphere around the link's box, in the world \[m\].
    center: Point3<f64>,
    radius: f64,
    bounds: (Point3<f64>, Point3<f64>),
}

impl PosedRobot {
    /// Poses a robot: `t_world_links` are the link poses in the order of [`super::KinematicTree::links`], such
    /// as forward kinematics times the pose of the base, in whatever frame the queries will be.
    ///
    /// # Errors
    /// [`RobotError::PoseCount`] unless there is one pose a link, [`RobotError::Number`] for one that is not finite.
    pub fn new(shape: Arc<RobotShape>, t_world_links: Vec<Isometry3<f64>>) -> Result<Self> {
        let (given, expected) = (t_world_links.len(), shape.links().len());
        if given != expected {
            return Err(RobotError::PoseCount { given, expected });
        }
        let finite = |t: &Isometry3<f64>| {
            t.translation.vector.iter().chain(t.rotation.coords.iter()).all(|x| x.is_finite())
        };
        if let Some(link) = t_world_links.iter().position(|t| !finite(t)) {
            return Err(RobotError::Number {
                owner: format!("link '{}'", shape.link_names()[link]),
                field: "pose",
                requirement: "must be finite",
            });
        }
        let solid = shape
            .links()
            .iter()
            .enumerate()
            .filter_map(|(link, s)| {
                let bounds = s.grid()?.bounds();
                let t = &t_world_links[link];
                Some(LinkSolid {
                    link,
                    t_link_world: t.inverse(),
                    center: t * nalgebra::center(&bounds.0, &bounds.1),
                    radius: 0.5 * (bounds.1 - bounds.0).norm(),
                    bounds,
                })
            })
            .collect();
        Ok(Self { shape, t_world_links, solid })
    }

    /// The shape that is posed.
    pub fn shape(&self) -> &Arc<RobotShape> {
        &self.shape
    }

    /// Pose of every link, in the order of [`super::KinematicTree::links`].
    pub fn t_world_links(&self) -> &[Isometry3<f64>] {
        &self.t_world_links
    }

    /// Every collision body in the world frame: each a closed surface, overlapping others where links meet.
    pub fn mesh_parts(&self) -> Vec<TriMesh> {
        let links = self.shape.links().iter().zip(&self.t_world_links);
        links.flat_map(|(shape, t)| shape.parts().iter().map(|p| p.transformed(t))).collect()
    }

    /// All collision bodies in the world frame in one mesh (not their union: surfaces inside others are included).
    pub fn mesh(&self) -> TriMesh {
        let mut mesh = TriMesh::default();
        self.mesh_parts().iter().for_each(|p| mesh.append(p));
        mesh
    }

    /// The nearest link and the signed distance to it by its grid, with derivatives in the world frame;
    /// `None` beyond `reach` \[m\].
    pub fn sample_link(&self, point: &Point3<f64>, reach: f64) -> Option<(usize, FieldSample)> {
        let (solid, s) = self.nearest(point, reach, SdfGrid::sample, |s| s.distance)?;
        let rotation = self.t_world_links[solid.link].rotation.to_rotation_matrix();
        let hessian = rotation.matrix() * s.hessian * rotation.matrix().transpose();
        let gradient = rotation * s.gradient;
        Some((solid.link, FieldSample { distance: s.distance, gradient, hessian }))
    }

    /// The nearest link and what `query` says of its grid at the point, in the link's frame; `None` beyond `reach` \[m\].
    #[inline]
    fn nearest<T>(
        &self,
        point: &Point3<f64>,
        reach: f64,
        query: impl Fn(&SdfGrid, &Point3<f64>, f64) -> Option<T>,
        distance: impl Fn(&T) -> f64,
    ) -> Option<(&LinkSolid, T)> {
        let mut best = None;
        let mut limit = reach;
        for solid in &self.solid {
            // A deep point may be deeper still in a link whose box it is in, so zero always counts.
            let near = limit.max(0.0);
            let sphere = solid.radius + near;
            if (point - solid.center).norm_squared() > sphere * sphere {
                continue;
            }
            let local = solid.t_link_world * point;
            if box_distance(&solid.bounds, &local) > near {
                continue;
            }
            let grid = self.shape.links()[solid.link].grid();
            if let Some(found) = grid.and_then(|g| query(g, &local, near))
                && distance(&found) <= limit
            {
                limit = distance(&found);
                best = Some((solid, found));
            }
        }
        best
    }

    /// Exact signed distance to the bodies \[m\] (no grid), or `None` farther outside than `max_distance`.
    ///
    /// Inside, the depth in the deepest body.
    pub fn signed_distance(&self, point: &Point3<f64>, max_distance: f64) -> Option<f64> {
        let mut best: Option<f64> = None;
        for solid in &self.solid {
            let limit = best.unwrap_or(max_distance);
            if let Some(distance) = self.link_distance(solid, point, limit)
                && distance <= limit
            {
                best = Some(distance);
            }
        }
        best
    }

    /// Signed distance to one link, or `None` if its box is farther than `limit`.
    fn link_distance(&self, solid: &LinkSolid, point: &Point3<f64>, limit: f64) -> Option<f64> {
        let local = solid.t_link_world * point;
        let near = box_distance(&solid.bounds, &local) <= limit.max(0.0);
        near.then(|| self.shape.links()[solid.link].signed_distance(&local))
    }
}

impl DistanceField for PosedRobot {
    fn sample(&self, point: &Point3<f64>, reach: f64) -> Option<FieldSample> {
        self.sample_link(point, reach).map(|(_, sample)| sample)
    }

    fn distance(&self, point: &Point3<f64>, reach: f64) -> Option<f64> {
        self.nearest(point, reach, SdfGrid::distance, |d| *d).map(|(_, distance)| distance)
    }

    /// That of the thinnest link.
    fn thickness(&self) -> f64 {
        self.shape.links().iter().map(|link| link.thickness()).fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::robot::KinematicTree;

    /// Two boxes that overlap across a joint and a sphere at the end.
    const HAND: &str = r#"<robot name="hand"><link name="empty"/>
        <link name="palm"><collision><geometry><box size="0.04 0.06 0.08"/></geometry></collision></link>
        <link name="finger"><collision><origin xyz="0 0 0.03"/><geometry><box size="0.02 0.02 0.06"/></geometry></collision>
          <collision><origin xyz="0 0 0.06"/><geometry><sphere radius="0.014"/></geometry></collision></link>
        <joint name="base" type="fixed"><parent link="empty"/><child link="palm"/></joint>
        <joint name="q" type="continuous"><parent link="palm"/><child link="finger"/><origin xyz="0 0 0.035"/><axis xyz="0 1 0"/></joint>
        </robot>"#;

    fn posed(angle: f64, spacing: f64) -> PosedRobot {
        let robot = KinematicTree::from_urdf_str(HAND, None).unwrap();
        let shape = Arc::new(RobotShape::new(&robot, spacing, 0.012).unwrap());
        let base = Isometry3::new(Vector3::new(0.3, -0.2, 0.5), Vector3::new(0.4, 1.0, -0.7));
        let poses = robot.forward_kinematics(&[angle]).iter().map(|t| base * t).collect();
        PosedRobot::new(shape, poses).unwrap()
    }

    fn points(robot: &PosedRobot) -> Vec<Point3<f64>> {
        let palm = robot.t_world_links()[1];
        let range = |i: usize, n: usize| (i * 7919 % n) as f64 / n as f64 - 0.5;
        (0..2000)
            .map(|i| {
                palm * Point3::new(
                    range(i, 101) * 0.07,
                    range(i, 103) * 0.09,
                    range(i, 107) * 0.2 + 0.04,
                )
            })
            .collect()
    }

    #[test]
    fn the_grid_agrees_with_the_exact_distance() {
        let robot = posed(0.5, 0.002);
        let (mut inside, mut outside) = (0, 0);
        let mut errors = Vec::new();
        for p in points(&robot) {
            let exact = robot.signed_distance(&p, 0.01);
            let grid = robot.sample(&p, 0.01);
            assert_eq!(robot.distance(&p, 0.01), grid.map(|g| g.distance));
            match (exact, grid) {
                (Some(e), Some(g)) => {
                    // Kinks are rounded within the spacing, never more.
                    assert!((e - g.distance).abs() < 0.001, "{e} {}", g.distance);
                    errors.push((e - g.distance).abs());
                    if e < 0.0 { inside += 1 } else { outside += 1 }
                }
                (None, None) => {}
                (e, g) => {
                    let d = e.or(g.map(|g| g.distance)).unwrap();
                    assert!((d - 0.01).abs() < 0.001, "only one answers, at {d}");
                }
            }
        }
        assert!(inside > 100 && outside > 100);
        errors.sort_by(f64::total_cmp);
        assert!(errors[errors.len() / 2] < 2e-5, "median {}", errors[errors.len() / 2]);
    }

    #[test]
    fn derivatives_in_the_world_match_differences() {
        let robot = posed(-0.3, 0.002);
        let step = 1e-7;
        let mut checked = 0;
        for p in points(&robot).iter().take(400) {
            let Some((link, s)) = robot.sample_link(p, 0.01) else { continue };
            let around = |sign: f64, i: usize| {
                let mut e = Vector3::zeros();
                e[i] = sign * step;
                robot.sample_link(&(p + e), 0.011)
            };
            for i in 0..3 {
                let (Some((a, plus)), Some((b, minus))) = (around(1.0, i), around(-1.0, i)) else {
                    panic!("a neighbor of {p} is out of reach");
                };
                // On a crease between links there is no derivative.
                if a == link && b == link {
                    let slope = (plus.distance - minus.distance) / (2.0 * step);
                    assert!((slope - s.gradient[i]).abs() < 1e-6);
                    let bend = (plus.gradient - minus.gradient) / (2.0 * step);
                    // The third derivative of the spline jumps at cell faces: step * 4 / spacing².
                    assert!((bend - s.hessian.column(i)).norm() < 0.1);
                    checked += 1;
                }
            }
        }
        assert!(checked > 200);
    }

    #[test]
    fn meshes_and_shapes_follow_the_links() {
        let robot = posed(0.2, 0.004);
        assert_eq!(robot.mesh_parts().len(), 3);
        let faces: usize = robot.mesh_parts().iter().map(|p| p.faces.len()).sum();
        assert_eq!(robot.mesh().faces.len(), faces);
        assert_eq!(robot.shape().link_names(), ["empty", "palm", "finger"]);
        assert!(robot.shape().links()[0].grid().is_none());
        let too_few = PosedRobot::new(robot.shape().clone(), vec![Isometry3::identity()]);
        assert!(matches!(too_few, Err(RobotError::PoseCount { given: 1, expected: 3 })));
    }
}
