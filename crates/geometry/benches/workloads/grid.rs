//! Signed distance at 128³ points about the body.

use nalgebra::{Point3, Vector3};
use prehend_geometry::{ClosestPoints, SdfGrid, TriMesh};

use super::oracle;
use super::table::Comparison;

const COUNT: usize = 128;

/// A cube of 128³ points, 1.25 times as large as the body.
pub(crate) struct Lattice {
    pub(crate) points: Vec<Point3<f64>>,
    low: Point3<f64>,
    spacing: f64,
}

impl Lattice {
    pub(super) fn about(body: &TriMesh) -> Self {
        let (low, high) = body.bounds().expect("a body with vertices");
        let middle = nalgebra::center(&low, &high);
        let half = Vector3::repeat((high - low).max() / 2.0 * 1.25);
        let low = middle - half;
        let spacing = 2.0 * half.x / (COUNT - 1) as f64;
        let place = |i: usize| [i / (COUNT * COUNT), i / COUNT % COUNT, i % COUNT];
        let point = |i| low + Vector3::from(place(i).map(|k| k as f64 * spacing));
        Self { points: (0..COUNT.pow(3)).map(point).collect(), low, spacing }
    }

    /// The lattice in this crate's type.
    fn ours(&self) -> prehend_geometry::sdf::Lattice {
        let lattice = prehend_geometry::sdf::Lattice::new(self.low, self.spacing, [COUNT; 3]);
        lattice.expect("a sound lattice")
    }

    fn values(&self, grid: &SdfGrid) -> Vec<f64> {
        assert_eq!(grid.dims(), [COUNT; 3]);
        self.points.iter().map(|p| grid.evaluate(p).distance).collect()
    }
}

/// The answers are the signed distances at all points. Ours includes the coefficients of the spline.
pub(crate) fn whole<'a>(
    body: &TriMesh,
    tree: &'a ClosestPoints,
    lattice: &'a Lattice,
) -> Comparison<'a> {
    let truth = oracle::truth(&lattice.points, 2000, |p| oracle::signed_distance(body, p));
    let mut job = Comparison::new("SDF 128³", "m", 1e-7, truth);
    let ours = || SdfGrid::build_on(tree, lattice.ours());
    job.add("ours", ours, |grid| lattice.values(&grid));
    job
}
