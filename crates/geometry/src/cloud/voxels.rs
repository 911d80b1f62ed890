//! One point for each small cube of a cloud.

use nalgebra::{Point3, Vector3};

use super::{CloudError, PointCloud};

impl PointCloud {
    /// The mean of the points in each cube of edge `size` \[m\], with the normalized mean of their normals.
    ///
    /// The cubes are those of a grid through the origin, so a cube's mean does not depend on what else is in the
    /// cloud; they come in the order of their z, y and x. A mean normal is zero where normals cancel.
    ///
    /// # Errors
    /// [`CloudError`] for a cloud that is not finite, normals that are not one a point, and a `size` that is not
    /// positive or below a 2⁵⁰th of the largest coordinate.
    pub fn downsampled(&self, size: f64) -> Result<Self, CloudError> {
        self.check()?;
        let coordinates = self.points.iter().flat_map(|p| p.coords.iter().copied());
        let farthest = coordinates.fold(0.0_f64, |far, x| far.max(x.abs()));
        if !(size > 0.0 && size.is_finite() && farthest / size < (1_u64 << 50) as f64) {
            return Err(CloudError::VoxelSize { size, farthest });
        }
        let cube = |p: &Point3<f64>| [p.z, p.y, p.x].map(|x| (x / size).floor() as i64);
        let mut order: Vec<([i64; 3], usize)> =
            self.points.iter().enumerate().map(|(i, p)| (cube(p), i)).collect();
        order.sort_unstable();

        let mut cubes = Self { points: Vec::new(), normals: self.normals.as_ref().map(|_| vec![]) };
        for members in order.chunk_by(|a, b| a.0 == b.0) {
            let members = || members.iter().map(|(_, i)| *i);
            // About the first of them, so that one point alone stays what it is.
            let first = self.points[members().next().unwrap_or(0)];
            let offsets: Vector3<f64> = members().map(|i| self.points[i] - first).sum();
            cubes.points.push(first + offsets / members().count() as f64);
            if let (Some(means), Some(normals)) = (&mut cubes.normals, &self.normals) {
                let sum: Vector3<f64> = members().map(|i| normals[i]).sum();
                means.push(sum.try_normalize(1e-12).unwrap_or_else(Vector3::zeros));
            }
        }
        Ok(cubes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SplitMix64;
    use std::collections::BTreeMap;

    fn cloud(n: usize) -> PointCloud {
        let mut random = SplitMix64::new(5);
        let mut next = || 0.2 * random.uniform() - 0.1;
        let points = (0..n).map(|_| Point3::new(next(), next(), next())).collect();
        PointCloud { points, normals: Some(vec![Vector3::z(); n]) }
    }

    #[test]
    fn each_cube_has_the_mean_of_its_points() {
        let (cloud, size) = (cloud(3000), 0.03);
        let thin = cloud.downsampled(size).unwrap();
        let mut cubes: BTreeMap<[i64; 3], Vec<Point3<f64>>> = BTreeMap::new();
        for p in &cloud.points {
            cubes.entry([p.z, p.y, p.x].map(|x| (x / size).floor() as i64)).or_default().push(*p);
        }
        assert_eq!(thin.points.len(), cubes.len());
        for (mean, members) in thin.points.iter().zip(cubes.values()) {
            let sum: Vector3<f64> = members.iter().map(|p| p.coords).sum();
            assert!((mean.coords - sum / members.len() as f64).norm() < 1e-15);
        }
        assert_eq!(thin.normals, Some(vec![Vector3::z(); cubes.len()]));
    }

    #[test]
    fn the_order_of_points_decides_rounding_alone() {
        let cloud = cloud(500);
        let mut reversed = cloud.clone();
        reversed.points.reverse();
        let (a, b) = (cloud.downsampled(0.02).unwrap(), reversed.downsampled(0.02).unwrap());
        assert_eq!(a.points.len(), b.points.len());
        assert!(a.points.iter().zip(&b.points).all(|(p, q)| (p - q).norm() < 1e-15));
        let fine = cloud.downsampled(1e-9).unwrap();
        assert_eq!(fine.points.len(), 500);
        assert!(fine.points.iter().all(|p| cloud.points.contains(p)));
    }

    #[test]
    fn sizes_that_mean_nothing_are_errors() {
        for size in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-20] {
            let error = cloud(5).downsampled(size).unwrap_err();
            assert!(matches!(error, CloudError::VoxelSize { .. }), "{error}");
        }
        assert_eq!(PointCloud::default().downsampled(0.1).unwrap(), PointCloud::default());
        let mut opposite = cloud(2);
        opposite.normals = Some(vec![Vector3::z(), -Vector3::z()]);
        assert_eq!(opposite.downsampled(9.0).unwrap().points.len(), 2.min(opposite.points.len()));
    }
}
