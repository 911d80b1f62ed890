//! Two clouds of 100 000 points: preparing one, nearest points in it, and aligning the other with it.

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};
use prehend_geometry::icp::{CloudTarget, IcpSettings, align};
use prehend_geometry::{KdTree, PointCloud, SplitMix64, TriMesh};

use super::points::{Sample, on_surface};
use super::table::Comparison;

const COUNT: usize = 100_000;
/// Noise of the points that are aligned \[m\].
const NOISE: f64 = 0.0005;

/// Points of the body, and others that a pose maps onto it.
pub(crate) struct Registration {
    pub(crate) target: Vec<Point3<f64>>,
    /// Unit normals of the target.
    pub(crate) normals: Vec<Vector3<f64>>,
    pub(crate) source: Vec<Point3<f64>>,
    /// The pose that is looked for.
    t_target_source: Isometry3<f64>,
}

impl Registration {
    /// Pairs farther apart do not count \[m\].
    pub(crate) const REACH: f64 = 0.02;
    /// Steps from no motion at all.
    pub(crate) const STEPS: usize = 20;

    /// 7° and 6.7 mm away.
    pub(super) fn new(body: &TriMesh) -> Self {
        let (target, normals) = on_surface(body, COUNT, 21)
            .into_iter()
            .map(|Sample { point, normal }| (point, normal))
            .unzip();
        let axis = Unit::new_normalize(Vector3::new(1.0, 0.5, -0.3));
        let turn = Rotation3::from_axis_angle(&axis, 7_f64.to_radians());
        let pose = Translation3::new(0.004, -0.003, 0.0045) * UnitQuaternion::from(turn);
        let mut random = SplitMix64::new(5);
        let mut noise = || Vector3::from_fn(|_, _| NOISE * random.normal());
        let source = on_surface(body, COUNT, 22)
            .into_iter()
            .map(|sample| pose.inverse_transform_point(&(sample.point + noise())))
            .collect();
        Self { target, normals, source, t_target_source: pose }
    }

    /// The target, ready to be searched and aligned with.
    pub(crate) fn prepared(&self) -> (KdTree, CloudTarget) {
        let cloud = PointCloud { points: self.target.clone(), normals: Some(self.normals.clone()) };
        let tree = KdTree::new(&self.target).expect("finite points");
        (tree, CloudTarget::new(&cloud).expect("a normal for each point"))
    }

    /// Where a pose brings the corners of a box about the body.
    pub(crate) fn corners(&self, pose: &Isometry3<f64>) -> Vec<f64> {
        let corner = |i: usize| [4, 2, 1].map(|bit| if i & bit == 0 { -0.06 } else { 0.06 });
        (0..8).flat_map(|i| (pose * Point3::from(corner(i))).coords.data.0[0]).collect()
    }
}

/// Preparing the target; the answers are a few distances that the result must be able to give.
pub(crate) fn build(clouds: &Registration) -> Comparison<'_> {
    let truth = nearest_by_force(clouds, few(clouds));
    let mut job = Comparison::new("prepare 100k points", "m", 1e-9, truth);
    let distances = |tree: KdTree| distances(&tree, few(clouds));
    job.add("ours", || KdTree::new(&clouds.target).expect("finite points"), distances);
    job
}

/// The points that a freshly prepared cloud is asked about.
pub(crate) fn few(clouds: &Registration) -> &[Point3<f64>] {
    &clouds.source[..100]
}

/// The nearest point of the target for every point of the source, where it is.
pub(crate) fn nearest<'a>(clouds: &'a Registration, tree: &'a KdTree) -> Comparison<'a> {
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

/// Point-to-plane ICP of twenty steps, the target prepared before; the answer is where it brings a box.
pub(crate) fn registration<'a>(
    clouds: &'a Registration,
    target: &'a CloudTarget,
) -> Comparison<'a> {
    let truth = clouds.corners(&clouds.t_target_source).into_iter().enumerate().collect();
    let mut job = Comparison::new("ICP, 100k points, 20 steps", "m", 5e-5, truth);
    // Tolerances of zero: all the steps are taken.
    let settings = IcpSettings {
        max_distance: Registration::REACH,
        max_iterations: Registration::STEPS,
        translation_tolerance: 0.0,
        rotation_tolerance: 0.0,
        ..IcpSettings::default()
    };
    let start = Isometry3::identity();
    let ours = move || align(&clouds.source, target, &start, &settings).expect("close clouds");
    job.add("ours", ours, |found| clouds.corners(&found.t_target_source));
    job
}

/// True distances of some of `points` from the target \[m\].
fn nearest_by_force(clouds: &Registration, points: &[Point3<f64>]) -> Vec<(usize, f64)> {
    super::oracle::truth(points, 100, |p| {
        let distances = clouds.target.iter().map(|t| nalgebra::distance(p, t));
        distances.fold(f64::INFINITY, f64::min)
    })
}
