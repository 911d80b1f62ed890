//! Collisions between links of the hand.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3};
use prehend_geometry::TriMesh;
use prehend_geometry::robot::LinkShape;
use prehend_geometry::sample::surface_samples;

use crate::scene::Hand;

/// Surface samples of a link.
const SAMPLES: usize = 150;
/// Links that are nearer than this while the hand is open are meant to be \[m\].
const APART: f64 = 2e-3;

/// Pairs of links that should stay apart.
pub(super) struct SelfCollision {
    links: Vec<HandLink>,
    pairs: Vec<LinkPair>,
}

struct HandLink {
    number: usize,
    shape: Arc<LinkShape>,
    points: Vec<Point3<f64>>,
    center: Point3<f64>,
    radius: f64,
}

struct LinkPair {
    /// Samples of the one against the field of the other: places in `links`.
    links: [usize; 2],
    /// Entries of the joint vector that move one relative to the other.
    variables: Vec<usize>,
}

impl SelfCollision {
    /// The links that are apart with the hand at `open`.
    pub(super) fn new(robot: &Hand, paths: &[Vec<usize>], open: &[Isometry3<f64>]) -> Self {
        let screws = robot.tree.screws(open);
        let mut links = Vec::new();
        for (number, shape) in robot.shape.links().iter().enumerate() {
            let Some((center, radius)) = ball(shape) else { continue };
            let mut mesh = TriMesh::default();
            shape.parts().iter().for_each(|p| mesh.append(p));
            let points = surface_samples(&mesh, SAMPLES, 0).into_iter().map(|s| s.point).collect();
            links.push(HandLink { number, shape: shape.clone(), points, center, radius });
        }
        let mut pairs = Vec::new();
        for i in 0..links.len() {
            for k in 0..links.len() {
                let [a, b] = [i, k].map(|l| &paths[links[l].number]);
                let of_one = a.iter().filter(|s| !b.contains(s));
                let of_one = of_one.chain(b.iter().filter(|s| !a.contains(s)));
                let variables: Vec<usize> = of_one.map(|&s| screws[s].variable).collect();
                let pair = LinkPair { links: [i, k], variables };
                if !pair.variables.is_empty() && !pair.meets(&links, open, APART) {
                    pairs.push(pair);
                }
            }
        }
        Self { links, pairs }
    }

    /// Entries of the joint vector that bring links into each other at `poses`.
    pub(super) fn stopped(&self, poses: &[Isometry3<f64>]) -> Vec<usize> {
        let meets = self.pairs.iter().filter(|pair| pair.meets(&self.links, poses, 0.0));
        meets.flat_map(|pair| pair.variables.iter().copied()).collect()
    }
}

impl LinkPair {
    /// True if a sample of the one is within `reach` of the other.
    fn meets(&self, links: &[HandLink], poses: &[Isometry3<f64>], reach: f64) -> bool {
        let [a, b] = self.links.map(|l| &links[l]);
        let t_b_a = poses[b.number].inverse() * poses[a.number];
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

/// Center and radius of a ball about a link that has a shape, link frame \[m\].
pub(super) fn ball(shape: &LinkShape) -> Option<(Point3<f64>, f64)> {
    let (low, high) = shape.grid()?.bounds();
    Some((nalgebra::center(&low, &high), 0.5 * (high - low).norm()))
}
