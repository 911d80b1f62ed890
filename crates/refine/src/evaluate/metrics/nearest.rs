//! Exact nearest neighbors among a fixed set of points.

use nalgebra::Point3;
use prehend_geometry::KdTree;

/// A k-d tree over points that knows what to answer without any.
#[derive(Debug)]
pub struct NearestPoint {
    tree: Option<KdTree>,
}

impl NearestPoint {
    /// Builds the tree; coordinates must be finite.
    pub fn new(points: &[Point3<f64>]) -> Self {
        Self { tree: KdTree::new(points).ok() }
    }

    /// The distance from `query` to the nearest point; infinite when there are no points.
    pub fn distance(&self, query: &Point3<f64>) -> f64 {
        let nearest = self.tree.as_ref().and_then(|tree| tree.nearest(query, f64::INFINITY));
        nearest.map_or(f64::INFINITY, |n| n.distance_squared.sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
