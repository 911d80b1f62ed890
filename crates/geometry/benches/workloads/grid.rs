//! Signed distance at 128³ points about the body: all of them, and a narrow band.

use nalgebra::{Point3, Vector3};
use prehend_geometry::{ClosestPoints, SdfGrid, TriMesh};

use super::oracle;
use super::table::Comparison;

const COUNT: usize = 128;
/// Half the width of the band, in spacings.
const BAND: f64 = 4.0;

/// A cube of 128³ points, 1.25 times as large as the body.
pub(crate) struct Lattice {
    pub(crate) points: Vec<Point3<f64>>,
    low: Point3<f64>,
    high: Point3<f64>,
    spacing: f64,
}

impl Lattice {
    pub(super) fn about(body: &TriMesh) -> Self {
        let (low, high) = body.bounds().expect("a body with vertices");
        let middle = nalgebra::center(&low, &high);
        let half = Vector3::repeat((high - low).max() / 2.0 * 1.25);
        let (low, high) = (middle - half, middle + half);
        let spacing = 2.0 * half.x / (COUNT - 1) as f64;
        let place = |i: usize| [i / (COUNT * COUNT), i / COUNT % COUNT, i % COUNT];
        let point = |i| low + Vector3::from(place(i).map(|k| k as f64 * spacing));
        Self { points: (0..COUNT.pow(3)).map(point).collect(), low, high, spacing }
    }

    /// The distance up to which the band is asked for \[m\].
    pub(crate) fn reach(&self) -> f64 {
        BAND * self.spacing
    }

    /// A grid of this crate at exactly these points.
    fn grid(&self, distance: impl Fn(&Point3<f64>, f64) -> f64 + Sync) -> SdfGrid {
        // A spacing a little larger keeps rounding from adding another layer of points.
        let spacing = self.spacing * (1.0 + 1e-12);
        SdfGrid::from_fn((self.low, self.high), spacing, 0.0, distance).expect("a sound grid")
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
    let ours = || {
        lattice.grid(|p, bound| match tree.signed_distance_within(p, bound) {
            Some((distance, _)) => distance,
            None => tree.signed_distance(p).0,
        })
    };
    job.add("ours", ours, |grid| lattice.values(&grid));
    job
}

/// The answers are the signed distances where the surface is within four spacings, and four spacings elsewhere.
pub(crate) fn band<'a>(
    body: &TriMesh,
    tree: &'a ClosestPoints,
    lattice: &'a Lattice,
) -> Comparison<'a> {
    let reach = lattice.reach();
    let near = |p: &_| {
        let distance = oracle::signed_distance(body, p);
        if distance.abs() > reach { reach } else { distance }
    };
    let truth = oracle::truth(&lattice.points, 2000, near);
    let mut job = Comparison::new("SDF 128³, band of 4", "m", 1e-7, truth);
    let ours = move || {
        let near = |p| tree.signed_distance_within(p, reach).map_or(reach, |(d, _)| d);
        lattice.points.iter().map(near).collect::<Vec<f64>>()
    };
    job.add("ours", ours, |distances| distances);
    job
}
