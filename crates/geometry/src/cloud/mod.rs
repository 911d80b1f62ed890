//! Point clouds: neighbors and normals.

mod diameter;
mod kd_tree;
mod normals;

use nalgebra::{Isometry3, Point3, Vector3};

pub use diameter::diameter;
pub use kd_tree::{KdTree, Neighbor};
pub use normals::estimate_normals;

/// Points, and the unit normals of the surface they lie on where those are known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    /// Positions \[m\].
    pub points: Vec<Point3<f64>>,
    /// Unit normals, one a point; zero where a point has none.
    pub normals: Option<Vec<Vector3<f64>>>,
}

/// Why a cloud cannot be made or searched.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CloudError {
    /// A coordinate is NaN, infinite, or beyond 1e9 m.
    #[error("point {index} of the cloud is not finite or farther than 1e9 m from the origin")]
    Coordinate {
        /// The point.
        index: usize,
    },
    /// More points than a tree can address.
    #[error("the cloud has {count} points, more than the limit of {limit}")]
    TooMany {
        /// Points of the cloud.
        count: usize,
        /// The limit.
        limit: usize,
    },
    /// Normals that do not belong to the points.
    #[error("the cloud has {normals} normals for {points} points")]
    NormalCount {
        /// Normals given.
        normals: usize,
        /// Points of the cloud.
        points: usize,
    },
}

impl PointCloud {
    /// A cloud without normals.
    pub fn new(points: Vec<Point3<f64>>) -> Self {
        Self { points, normals: None }
    }

    /// The cloud moved by `t_new_cloud`, which maps its coordinates into the new frame.
    pub fn transformed(&self, t_new_cloud: &Isometry3<f64>) -> Self {
        let normals = self.normals.as_ref();
        Self {
            points: self.points.iter().map(|p| t_new_cloud * p).collect(),
            normals: normals.map(|n| n.iter().map(|n| t_new_cloud * n).collect()),
        }
    }

    /// Whether points and normals are as many, finite and within bounds.
    pub(crate) fn check(&self) -> Result<(), CloudError> {
        check(&self.points)?;
        match &self.normals {
            Some(n) if n.len() != self.points.len() => {
                Err(CloudError::NormalCount { normals: n.len(), points: self.points.len() })
            }
            Some(n) => match n.iter().position(|n| !n.iter().all(|x| x.is_finite())) {
                Some(index) => Err(CloudError::Coordinate { index }),
                None => Ok(()),
            },
            None => Ok(()),
        }
    }
}

fn check(points: &[Point3<f64>]) -> Result<(), CloudError> {
    const LIMIT: usize = 1 << 31;
    if points.len() >= LIMIT {
        return Err(CloudError::TooMany { count: points.len(), limit: LIMIT });
    }
    // Beyond 1e9 m the squares of box sizes would leave single precision.
    match points.iter().position(|p| !p.iter().all(|x| x.abs() <= 1e9)) {
        Some(index) => Err(CloudError::Coordinate { index }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_clouds_are_named() {
        let mut cloud = PointCloud::new(vec![Point3::origin(), Point3::new(0.0, f64::NAN, 0.0)]);
        assert_eq!(cloud.check(), Err(CloudError::Coordinate { index: 1 }));
        assert_eq!(KdTree::new(&cloud.points).err(), Some(CloudError::Coordinate { index: 1 }));
        cloud.points[1] = Point3::new(0.0, 0.0, 2e9);
        assert_eq!(cloud.check(), Err(CloudError::Coordinate { index: 1 }));
        cloud.points[1] = Point3::origin();
        cloud.normals = Some(vec![Vector3::z()]);
        assert_eq!(cloud.check(), Err(CloudError::NormalCount { normals: 1, points: 2 }));
        cloud.normals = Some(vec![Vector3::z(), Vector3::repeat(f64::INFINITY)]);
        assert_eq!(cloud.check(), Err(CloudError::Coordinate { index: 1 }));
    }

    #[test]
    fn normals_turn_with_the_cloud() {
        let cloud = PointCloud {
            points: vec![Point3::new(1.0, 0.0, 0.0)],
            normals: Some(vec![Vector3::x()]),
        };
        let quarter = Vector3::z() * std::f64::consts::FRAC_PI_2;
        let moved = cloud.transformed(&Isometry3::new(Vector3::new(0.0, 0.0, 3.0), quarter));
        assert!((moved.points[0] - Point3::new(0.0, 1.0, 3.0)).norm() < 1e-15);
        assert!(moved.normals.is_some_and(|n| (n[0] - Vector3::y()).norm() < 1e-15));
    }
}
