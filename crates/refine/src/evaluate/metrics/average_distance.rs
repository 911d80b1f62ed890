//! Average distance of model points (Hinterstoisser et al., ACCV 2012).

use nalgebra::{Isometry3, Point3};
use prehend_geometry::KdTree;

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

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn a_shift_moves_every_point_equally_and_a_symmetry_none() {
        let square: Vec<_> = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
            .map(|(x, y)| Point3::new(x, y, 0.0))
            .into();
        let tree = NearestPoint::new(&square);
        let truth = Isometry3::new(Vector3::new(0.1, 0.2, 3.0), Vector3::new(0.4, -0.5, 0.6));
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
    }

    /// A deterministic stream of numbers in 0..1 (Weyl sequences with irrational steps).
    fn cloud(n: usize, shift: f64) -> Vec<Point3<f64>> {
        let at = |i: usize, step: f64| (shift + i as f64 * step).fract();
        (0..n).map(|i| Point3::new(at(i, 0.618034), at(i, 0.414214), at(i, 0.732051))).collect()
    }

    #[test]
    fn agrees_with_exhaustive_search() {
        let mut points = cloud(2000, 0.1);
        // Duplicates and a flat part, as mesh vertices have them.
        points.extend(cloud(300, 0.1));
        points.extend(cloud(300, 0.7).iter().map(|p| Point3::new(p.x, p.y, 0.25)));
        let tree = NearestPoint::new(&points);
        for q in cloud(500, 0.33).iter().map(|p| p * 1.4) {
            let exhaustive = points.iter().map(|p| (p - q).norm()).fold(f64::INFINITY, f64::min);
            assert!((tree.distance(&q) - exhaustive).abs() < 1e-15);
        }
        assert_eq!(tree.distance(&points[17]), 0.0);
    }

    #[test]
    fn many_equal_points_and_none() {
        let tree = NearestPoint::new(&vec![Point3::new(1.0, 2.0, 2.0); 1000]);
        assert_eq!(tree.distance(&Point3::origin()), 3.0);
        assert_eq!(NearestPoint::new(&[]).distance(&Point3::origin()), f64::INFINITY);
    }
}
