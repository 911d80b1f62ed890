//! The longest distance between points.

use nalgebra::Point3;

use crate::box_tree::{Bounds, BoxTree};

/// Largest distance between two of `points`, whose coordinates are finite; 0 without two.
///
/// Boxes of points are compared before points are: O(n log n) for most objects. A sphere, where every point has another one across, is the
/// worst: 500 000 of its points take some seconds.
pub fn diameter(points: &[Point3<f64>]) -> f64 {
    let boxes: Vec<Bounds> = points.iter().map(|p| Bounds { low: *p, high: *p }).collect();
    BoxTree::new(&boxes).diameter()
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::random::SplitMix64;
    use crate::shapes;

    fn of_all_pairs(points: &[Point3<f64>]) -> f64 {
        let from = |p: &Point3<f64>| points.iter().map(|q| (q - p).norm()).fold(0.0, f64::max);
        points.iter().map(from).fold(0.0, f64::max)
    }

    #[test]
    fn it_is_that_of_all_pairs() {
        let mut random = SplitMix64::new(3);
        let scales =
            [[1.0, 1.0, 1.0], [1.0, 1e-3, 1e-6], [0.0, 0.0, 1.0], [0.0; 3], [1e9, 1.0, 1e9]];
        for (count, scale) in scales.iter().enumerate() {
            let mut point = || {
                let unit = Vector3::from_fn(|_, _| random.uniform() - 0.5);
                Point3::from(unit.component_mul(&Vector3::from(*scale)))
            };
            for count in [0, 1, 2, 3, 40 + count, 1000] {
                let points: Vec<_> = (0..count).map(|_| point()).collect();
                assert_eq!(diameter(&points), of_all_pairs(&points), "{count} of {scale:?}");
            }
        }
        let sphere = shapes::sphere(0.05, 40).vertices;
        assert_eq!(diameter(&sphere), of_all_pairs(&sphere));
    }

    #[test]
    fn a_fine_mesh_has_one() {
        // Half a million points: all pairs of them would take minutes.
        let fine = shapes::superellipsoid([0.03, 0.03, 0.07], [0.6, 0.8], 1000);
        let found = diameter(&fine.vertices);
        assert!((found - 0.14).abs() < 0.01, "{found} m");
    }
}
