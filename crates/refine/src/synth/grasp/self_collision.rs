//! Collisions between links of the hand.

use nalgebra::{Isometry3, Point3};
use prehend_geometry::TriMesh;
use prehend_geometry::sample::surface_samples;

use super::kinematic_paths::KinematicPaths;
use crate::scene::Hand;

/// Surface samples of a link.
const SAMPLES: usize = 150;
/// Links that are nearer than this while the hand is open are meant to be \[m\].
const APART: f64 = 2e-3;

/// Pairs of links that should stay apart.
pub(super) struct SelfCollision {
    bodies: Vec<Link>,
    pairs: Vec<Pair>,
}

struct Link {
    shape: std::sync::Arc<prehend_geometry::robot::LinkShape>,
    points: Vec<Point3<f64>>,
    center: Point3<f64>,
    radius: f64,
}

struct Pair {
    /// Samples of the one against the field of the other: links and places in `bodies`.
    links: [usize; 2],
    bodies: [usize; 2],
    /// Entries of the joint vector that move one relative to the other.
    variables: Vec<usize>,
}

impl SelfCollision {
    /// The links that are apart with the hand at `open`.
    pub(super) fn new(robot: &Hand, paths: &KinematicPaths, open: &[Isometry3<f64>]) -> Self {
        let mut bodies = Vec::new();
        let mut numbers = Vec::new();
        for (link, shape) in robot.shape.links().iter().enumerate() {
            let Some(grid) = shape.grid() else { continue };
            let mut mesh = TriMesh::default();
            shape.parts().iter().for_each(|p| mesh.append(p));
            let points = surface_samples(&mesh, SAMPLES, 0).into_iter().map(|s| s.point).collect();
            let (low, high) = grid.bounds();
            let (center, radius) = (nalgebra::center(&low, &high), 0.5 * (high - low).norm());
            bodies.push(Link { shape: shape.clone(), points, center, radius });
            numbers.push(link);
        }
        let mut pairs = Vec::new();
        for (i, &a) in numbers.iter().enumerate() {
            for (k, &b) in numbers.iter().enumerate() {
                let variables = paths.between(&robot.tree, a, b);
                let pair = Pair { links: [a, b], bodies: [i, k], variables };
                if !pair.variables.is_empty() && !pair.meets(&bodies, open, APART) {
                    pairs.push(pair);
                }
            }
        }
        Self { bodies, pairs }
    }

    /// Entries of the joint vector that bring links into each other at `poses`.
    pub(super) fn stopped(&self, poses: &[Isometry3<f64>]) -> Vec<usize> {
        let meets = self.pairs.iter().filter(|pair| pair.meets(&self.bodies, poses, 0.0));
        meets.flat_map(|pair| pair.variables.iter().copied()).collect()
    }
}

impl Pair {
    /// Whether a sample of the one is within `reach` of the other.
    fn meets(&self, bodies: &[Link], poses: &[Isometry3<f64>], reach: f64) -> bool {
        let [a, b] = self.bodies.map(|i| &bodies[i]);
        let [t_a, t_b] = self.links.map(|l| &poses[l]);
        let t_b_a = t_b.inverse() * t_a;
        if (t_b_a * a.center - b.center).norm() > a.radius + b.radius + reach {
            return false;
        }
        let Some(grid) = b.shape.grid() else { return false };
        a.points.iter().any(|p| {
            let local = t_b_a * p;
            grid.lower_bound(&local) <= reach && grid.evaluate(&local).distance <= reach
        })
    }
}
