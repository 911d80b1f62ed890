//! Inside or outside of the corner tetrahedron, where closest points on edges and corners are the rule.
//!
//! A library that takes the sign from the closest face alone is wrong for thousands of these points.

use nalgebra::{Point3, Vector3};
use prehend_geometry::{ClosestPoints, SplitMix64, TriMesh};
use rayon::prelude::*;

use super::table::Comparison;

pub(crate) struct Tetrahedron {
    pub(crate) mesh: TriMesh,
    /// 200 000 points in a box five times as large.
    pub(crate) points: Vec<Point3<f64>>,
}

impl Tetrahedron {
    pub(super) fn new() -> Self {
        let corners = [Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()];
        let faces = vec![[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]];
        let mesh = TriMesh::new(corners.map(Point3::from).to_vec(), faces);
        let mut random = SplitMix64::new(0);
        let mut coordinate = || 5.0 * random.uniform() - 2.0;
        let mut point = || Point3::new(coordinate(), coordinate(), coordinate());
        Self { mesh, points: (0..200_000).map(|_| point()).collect() }
    }
}

/// The answers are -1 inside and 1 outside.
pub(crate) fn of_tetrahedron(tetrahedron: &Tetrahedron) -> Comparison<'_> {
    let Tetrahedron { mesh, points } = tetrahedron;
    let sign = |p: &Point3<f64>| {
        let inside = p.iter().all(|x| *x >= 0.0) && p.coords.sum() <= 1.0;
        if inside { -1.0 } else { 1.0 }
    };
    let truth = points.iter().map(sign).enumerate().collect();
    let mut job = Comparison::new("sign, tetrahedron, 200k", "", 0.0, truth);
    let tree = ClosestPoints::new(mesh).expect("a sound mesh");
    let signs = |found: Vec<(f64, _)>| found.iter().map(|(d, _)| d.signum()).collect();
    job.add("ours", move || points.par_iter().map(|p| tree.signed_distance(p)).collect(), signs);
    job
}
