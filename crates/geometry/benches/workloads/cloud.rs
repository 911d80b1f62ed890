//! Two clouds of 100 000 points: preparing one, and nearest points in it.

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};
use prehend_geometry::{KdTree, SplitMix64, TriMesh};

use super::points::on_surface;
use super::table::Comparison;

const COUNT: usize = 100_000;
/// Noise of the points that are looked for \[m\].
const NOISE: f64 = 0.0005;

/// Points of the body, and others 7° and 6.7 mm away.
pub(crate) struct Clouds {
    pub(crate) target: Vec<Point3<f64>>,
    pub(crate) source: Vec<Point3<f64>>,
}

impl Clouds {
    pub(super) fn new(body: &TriMesh) -> Self {
        let target = on_surface(body, COUNT, 21).into_iter().map(|sample| sample.point).collect();
        let axis = Unit::new_normalize(Vector3::new(1.0, 0.5, -0.3));
        let turn = Rotation3::from_axis_angle(&axis, 7_f64.to_radians());
        let pose: Isometry3<f64> =
            Translation3::new(0.004, -0.003, 0.0045) * UnitQuaternion::from(turn);
        let mut random = SplitMix64::new(5);
        let mut noise = || Vector3::from_fn(|_, _| NOISE * random.normal());
        let source = on_surface(body, COUNT, 22)
            .into_iter()
            .map(|sample| pose.inverse_transform_point(&(sample.point + noise())))
            .collect();
        Self { target, source }
    }
}

/// Preparing the target; the answers are a few distances that the result must be able to give.
pub(crate) fn build(clouds: &Clouds) -> Comparison<'_> {
    let truth = nearest_by_force(clouds, few(clouds));
    let mut job = Comparison::new("prepare 100k points", "m", 1e-9, truth);
    let distances = |tree: KdTree| distances(&tree, few(clouds));
    job.add("ours", || KdTree::new(&clouds.target).expect("finite points"), distances);
    job
}

/// The points that a freshly prepared cloud is asked about.
pub(crate) fn few(clouds: &Clouds) -> &[Point3<f64>] {
    &clouds.source[..100]
}

/// The nearest point of the target for every point of the source, where it is.
pub(crate) fn nearest<'a>(clouds: &'a Clouds, tree: &'a KdTree) -> Comparison<'a> {
    let truth = nearest_by_force(clouds, &clouds.source);
    let mut job = Comparison::new("nearest of 100k points, 100k", "m", 1e-9, truth);
    job.add("ours", || distances(tree, &clouds.source), |found| found);
    job
}

fn distances(tree: &KdTree, points: &[Point3<f64>]) -> Vec<f64> {
    let distance =
        |p| tree.nearest(p, f64::INFINITY).map_or(f64::NAN, |found| found.distance_squared.sqrt());
    points.iter().map(distance).collect()
}

/// True distances of some of `points` from the target \[m\].
fn nearest_by_force(clouds: &Clouds, points: &[Point3<f64>]) -> Vec<(usize, f64)> {
    super::oracle::truth(points, 100, |p| {
        let distances = clouds.target.iter().map(|t| nalgebra::distance(p, t));
        distances.fold(f64::INFINITY, f64::min)
    })
}
