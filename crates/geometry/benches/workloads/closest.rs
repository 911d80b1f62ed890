//! Closest points of the body: preparing them, and three sets of queries.

use nalgebra::Point3;
use prehend_geometry::{ClosestPoints, TriMesh};
use rayon::prelude::*;

use super::oracle;
use super::points::QuerySet;
use super::table::Comparison;

/// \[m\]
const TOLERANCE: f64 = 1e-7;

/// Preparing the body; the answers are a few distances that the result must be able to give.
pub(crate) fn build<'a>(body: &'a TriMesh, set: &'a QuerySet) -> Comparison<'a> {
    let few = few(set);
    let truth = oracle::truth(few, few.len(), |p| oracle::distance(body, p));
    let mut job = Comparison::new("prepare 16k faces", "m", TOLERANCE, truth);
    let distances = |tree| each(few, |p| ClosestPoints::closest(&tree, p, f64::INFINITY));
    job.add("ours", || ClosestPoints::new(body).expect("a sound body"), distances);
    job
}

/// The points that a freshly prepared body is asked about.
pub(crate) fn few(set: &QuerySet) -> &[Point3<f64>] {
    &set.points[..100]
}

/// The closest point of every query, and its distance.
pub(crate) fn queries<'a>(
    body: &TriMesh,
    tree: &'a ClosestPoints,
    set: &'a QuerySet,
) -> Comparison<'a> {
    let points = &set.points;
    let truth = oracle::truth(points, 1000, |p| oracle::distance(body, p));
    let job = format!("closest, 100k {}", set.name);
    let mut job = Comparison::new(job, "m", TOLERANCE, truth);
    let distances = |found: Vec<Option<prehend_geometry::closest::Closest>>| {
        found.iter().map(|f| f.map_or(f64::NAN, |f| f.distance)).collect()
    };
    let closest = || points.par_iter().map(|p| tree.closest(p, f64::INFINITY)).collect();
    job.add("ours", closest, distances);
    job
}

fn each(
    points: &[Point3<f64>],
    closest: impl Fn(&Point3<f64>) -> Option<prehend_geometry::closest::Closest>,
) -> Vec<f64> {
    points.iter().map(|p| closest(p).map_or(f64::NAN, |found| found.distance)).collect()
}
