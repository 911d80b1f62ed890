//! Distances of model points between two poses: their average (Hinterstoisser et al., ACCV 2012), and their maximum up to
//! symmetry (Hodaň et al., "BOP Challenge 2020", ECCVW 2020).

use nalgebra::{Isometry3, Point3};
use prehend_geometry::KdTree;
use prehend_render::Camera;

/// ADD: the mean distance between corresponding model points in the two poses, in the points' unit;
/// NaN without points.
pub(super) fn add(
    estimate: &Isometry3<f64>,
    truth: &Isometry3<f64>,
    points: &[Point3<f64>],
) -> f64 {
    let sum: f64 = points.iter().map(|p| (estimate * p - truth * p).norm()).sum();
    sum / points.len() as f64
}

/// ADI (also ADD-S): the mean distance from each model point in the true pose to the nearest model point
/// in the estimated pose, in the points' unit; NaN without points. `nearest` holds the same points.
pub(super) fn adi(
    estimate: &Isometry3<f64>,
    truth: &Isometry3<f64>,
    points: &[Point3<f64>],
    nearest: &NearestPoint,
) -> f64 {
    // Seen from the estimated model frame the searched points never move, so one tree serves all poses.
    let t_estimate_truth = estimate.inverse() * truth;
    let sum: f64 = points.iter().map(|p| nearest.distance(&(t_estimate_truth * p))).sum();
    sum / points.len() as f64
}

/// A k-d tree over points that knows what to answer without any.
#[derive(Debug)]
pub(super) struct NearestPoint {
    tree: Option<KdTree>,
}

impl NearestPoint {
    /// Builds the tree; coordinates must be finite.
    pub(super) fn new(points: &[Point3<f64>]) -> Self {
        Self { tree: KdTree::new(points).ok() }
    }

    /// The distance from `query` to the nearest point; infinite when there are no points.
    pub(super) fn distance(&self, query: &Point3<f64>) -> f64 {
        let nearest = self.tree.as_ref().and_then(|tree| tree.nearest(query, f64::INFINITY));
        nearest.map_or(f64::INFINITY, |n| n.distance_squared.sqrt())
    }
}

/// MSSD: the least over `symmetries` (see [`Symmetries::transforms`](crate::data::Symmetries::transforms)) of the largest distance
/// between corresponding model points, in the points' unit.
pub(super) fn mssd(
    estimate: &Isometry3<f64>,
    truth: &Isometry3<f64>,
    points: &[Point3<f64>],
    symmetries: &[Isometry3<f64>],
) -> f64 {
    let estimated: Vec<_> = points.iter().map(|p| estimate * p).collect();
    least_maximum(symmetries, |s, bound| {
        let t = truth * s;
        largest(points.iter().zip(&estimated).map(|(p, e)| (t * p - e).norm_squared()), bound)
    })
    .sqrt()
}

/// MSPD: the same for the projections of the points into the image \[px\]; infinite when a point lies
/// behind the camera in the estimated pose or in every symmetric true pose.
pub(super) fn mspd(
    estimate: &Isometry3<f64>,
    truth: &Isometry3<f64>,
    points: &[Point3<f64>],
    symmetries: &[Isometry3<f64>],
    camera: &Camera,
) -> f64 {
    let estimated: Vec<_> = points.iter().map(|p| camera.project(&(estimate * p))).collect();
    least_maximum(symmetries, |s, bound| {
        let t = truth * s;
        let squares =
            points.iter().zip(&estimated).map(|(p, e)| match (camera.project(&(t * p)), e) {
                (Some(a), Some(b)) => (a.x - b.x).powi(2) + (a.y - b.y).powi(2),
                _ => f64::INFINITY,
            });
        largest(squares, bound)
    })
    .sqrt()
}

/// The least of `maximum(symmetry, least so far)`.
fn least_maximum(
    symmetries: &[Isometry3<f64>],
    maximum: impl Fn(&Isometry3<f64>, f64) -> f64,
) -> f64 {
    symmetries.iter().fold(f64::INFINITY, |least, s| least.min(maximum(s, least)))
}

/// The largest value, or some value of at least `bound`, where it no longer matters how large.
fn largest(values: impl Iterator<Item = f64>, bound: f64) -> f64 {
    let mut largest = 0.0_f64;
    for value in values {
        largest = largest.max(value);
        if largest >= bound {
            break;
        }
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{ContinuousSymmetry, Symmetries};
    use nalgebra::Vector3;

    const CAMERA: Camera =
        Camera { fx: 600.0, fy: 500.0, cx: 320.0, cy: 240.0, width: 640, height: 480 };

    fn corners() -> Vec<Point3<f64>> {
        let corner = |i: u8| [i & 1, i >> 1 & 1, i >> 2].map(|side| f64::from(side) - 0.5);
        (0..8).map(|i| Point3::from(corner(i))).collect()
    }

    fn somewhere() -> Isometry3<f64> {
        Isometry3::new(Vector3::new(0.1, -0.2, 4.0), Vector3::new(0.3, 0.1, 0.2))
    }

    #[test]
    fn a_shift_moves_every_point_equally_and_a_symmetry_none() {
        let square: Vec<_> = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
            .map(|(x, y)| Point3::new(x, y, 0.0))
            .into();
        let tree = NearestPoint::new(&square);
        let truth = somewhere();
        let shifted = Isometry3::translation(0.0, 0.3, 0.0) * truth;
        assert!((add(&shifted, &truth, &square) - 0.3).abs() < 1e-14);
        let quarter_turn = truth * Isometry3::rotation(Vector3::z() * std::f64::consts::FRAC_PI_2);
        assert!((add(&quarter_turn, &truth, &square) - 2.0).abs() < 1e-14);
        assert!(adi(&quarter_turn, &truth, &square, &tree) < 1e-14);
    }

    #[test]
    fn the_nearest_point_is_sought_from_the_truth() {
        // Points 0 and 1 on a line, the estimate shifted by 0.8: from the truth 0 → 0.8, 1 → 0.8 (0.2).
        let points = [Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(5.0, 0.0, 0.0)];
        let tree = NearestPoint::new(&points);
        let estimate = Isometry3::translation(0.8, 0.0, 0.0);
        let expected = (0.8 + 0.2 + 0.8) / 3.0;
        assert!((adi(&estimate, &Isometry3::identity(), &points, &tree) - expected).abs() < 1e-15);
        let far = Isometry3::translation(3.0, 0.0, 0.0);
        // From the truth: 0 → 3, 1 → 3 (2), 5 → 4 (1); the other way round it would be 2, 1, 3.
        assert!((adi(&far, &Isometry3::identity(), &points, &tree) - 2.0).abs() < 1e-15);
        assert!((adi(&Isometry3::identity(), &far, &points, &tree) - 2.0).abs() < 1e-15);
        assert_eq!(NearestPoint::new(&[]).distance(&Point3::origin()), f64::INFINITY);
    }

    #[test]
    fn without_symmetry_it_is_the_largest_distance() {
        let truth = somewhere();
        let estimate = Isometry3::translation(0.0, 0.4, 0.0) * truth;
        let identity = [Isometry3::identity()];
        assert!((mssd(&estimate, &truth, &corners(), &identity) - 0.4).abs() < 1e-14);
        // A vertical shift by 0.4 at depth z is 0.4 · 500 / z pixels: largest for the nearest corner.
        let nearest = corners().iter().map(|p| (truth * p).z).fold(f64::INFINITY, f64::min);
        let found = mspd(&estimate, &truth, &corners(), &identity, &CAMERA);
        assert!((found - 200.0 / nearest).abs() < 1e-10);
    }

    #[test]
    fn symmetric_poses_count_as_equal() {
        let truth = somewhere();
        let quarter = Isometry3::rotation(Vector3::z() * std::f64::consts::FRAC_PI_2);
        let symmetries = Symmetries { discrete: vec![quarter], continuous: vec![] }.transforms();
        let estimate = truth * quarter;
        assert!(mssd(&estimate, &truth, &corners(), &symmetries[..1]) > 0.9);
        assert!(mssd(&estimate, &truth, &corners(), &symmetries) < 1e-14);
        assert!(mspd(&estimate, &truth, &corners(), &symmetries, &CAMERA) < 1e-10);
        let axis = ContinuousSymmetry { axis: Vector3::z_axis(), point: Point3::origin() };
        let spins = Symmetries { discrete: vec![], continuous: vec![axis] }.transforms();
        let spun = truth * Isometry3::rotation(Vector3::z() * 1.234);
        // Half a step of 1.14° at radius 1/√2.
        let half_step = 0.00999 * std::f64::consts::FRAC_1_SQRT_2;
        assert!(mssd(&spun, &truth, &corners(), &spins) < half_step + 1e-6);
    }

    #[test]
    fn a_point_behind_the_camera_is_infinitely_wrong() {
        let truth = Isometry3::translation(0.0, 0.0, 4.0);
        let behind = Isometry3::translation(0.0, 0.0, -4.0);
        let identity = [Isometry3::identity()];
        assert_eq!(mspd(&behind, &truth, &corners(), &identity, &CAMERA), f64::INFINITY);
        assert_eq!(mspd(&truth, &behind, &corners(), &identity, &CAMERA), f64::INFINITY);
    }
}
