//! Contact area: which of 100 000 points of the body are within 5 mm of the hand?

use nalgebra::Point3;
use prehend_geometry::{ClosestPoints, TriMesh};
use rayon::prelude::*;

use super::oracle;
use super::table::Comparison;

/// Largest distance of a contact \[m\].
pub(crate) const REACH: f64 = 0.005;

/// The answers are the distances from the hand, or the reach where they are larger.
pub(crate) fn area<'a>(hand: &TriMesh, samples: &'a [Point3<f64>]) -> Comparison<'a> {
    let truth = oracle::truth(samples, 1000, |p| oracle::distance(hand, p).min(REACH));
    let tree = ClosestPoints::new(hand).expect("a sound hand");
    let mut job = Comparison::new("contact area, 100k samples", "m", 1e-7, truth);
    job.add(
        "ours",
        move || samples.par_iter().map(|p| tree.closest(p, REACH)).collect(),
        |found: Vec<Option<prehend_geometry::closest::Closest>>| {
            found.iter().map(|f| f.map_or(REACH, |f| f.distance)).collect()
        },
    );
    job
}
