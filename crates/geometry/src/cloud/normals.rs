//! Normals of the surface that a cloud samples.

use nalgebra::{Matrix3, Point3, Vector3};
use rayon::prelude::*;

use super::KdTree;

/// How much narrower than long a neighborhood may be before it counts as a line (ratio of variances).
const LINE: f64 = 1e-10;

/// The unit normal at every point of `tree`, towards `sensor` \[m\] (the origin for a cloud in its camera's frame).
///
/// The direction of least variance of the `neighbors` points nearest to each, itself among them (Hoppe et al.,
/// "Surface reconstruction from unorganized points", 1992); 10 to 30 are usual, more for noisier clouds. Zero
/// where they lie on a line or a point, which have no normal. The sign is towards the sensor, which sees the
/// surface from outside.
pub fn estimate_normals(
    tree: &KdTree,
    neighbors: usize,
    sensor: &Point3<f64>,
) -> Vec<Vector3<f64>> {
    let points = tree.points();
    points
        .par_iter()
        .with_min_len(256)
        .map(|p| {
            let near = tree.k_nearest(p, neighbors);
            let normal = least_variance(near.iter().map(|n| points[n.index] - p));
            if normal.dot(&(sensor - p)) < 0.0 { -normal } else { normal }
        })
        .collect()
}

/// The unit direction in which `offsets` vary least, or zero where there are several.
fn least_variance(offsets: impl Iterator<Item = Vector3<f64>> + Clone) -> Vector3<f64> {
    let count = offsets.clone().count().max(1) as f64;
    let mean = offsets.clone().sum::<Vector3<f64>>() / count;
    let covariance =
        offsets.fold(Matrix3::zeros(), |sum, d| sum + (d - mean) * (d - mean).transpose());
    let spread = covariance.trace();
    if spread <= 0.0 {
        return Vector3::zeros();
    }
    let eigen = (covariance / spread).symmetric_eigen();
    let least = eigen.eigenvalues.imin();
    let other = (0..3).filter(|&i| i != least).map(|i| eigen.eigenvalues[i]).fold(1.0, f64::min);
    if other <= LINE { Vector3::zeros() } else { eigen.eigenvectors.column(least).into_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::surface_samples;
    use crate::shapes::sphere;

    #[test]
    fn normals_of_a_sphere_point_outwards_to_a_sensor_outside() {
        let samples = surface_samples(&sphere(0.05, 96), 4000, 3);
        let points: Vec<_> = samples.iter().map(|s| s.point).collect();
        let tree = KdTree::new(&points).unwrap();
        let sensor = Point3::new(0.0, 0.0, 1.0);
        let normals = estimate_normals(&tree, 12, &sensor);
        for (p, n) in points.iter().zip(&normals) {
            let radial = p.coords.normalize();
            assert!(n.dot(&radial).abs() > 0.995, "{p} {n}");
            assert!(n.dot(&(sensor - p)) >= 0.0);
        }
    }

    #[test]
    fn normals_of_a_plane_are_exact() {
        let points: Vec<_> = (0..100)
            .map(|i| Point3::new(f64::from(i % 10) * 0.01, f64::from(i / 10) * 0.01, 0.3))
            .collect();
        let tree = KdTree::new(&points).unwrap();
        for n in estimate_normals(&tree, 8, &Point3::origin()) {
            assert!((n + Vector3::z()).norm() < 1e-12);
        }
    }

    #[test]
    fn lines_and_lone_points_have_no_normal() {
        let line: Vec<_> = (0..9).map(|i| Point3::new(0.1 * f64::from(i), 0.0, 0.5)).collect();
        let tree = KdTree::new(&line).unwrap();
        for k in [0, 1, 2, 6] {
            let normals = estimate_normals(&tree, k, &Point3::origin());
            assert!(normals.iter().all(|n| *n == Vector3::zeros()), "{k}");
        }
        assert!(estimate_normals(&KdTree::new(&[]).unwrap(), 9, &Point3::origin()).is_empty());
        let same = KdTree::new(&[Point3::new(1.0, 2.0, 3.0); 20]).unwrap();
        assert_eq!(estimate_normals(&same, 9, &Point3::origin()), [Vector3::zeros(); 20]);
    }
}
