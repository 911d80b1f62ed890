//! Point clouds: neighbors, normals and diameter.

mod diameter;
mod kd_tree;
mod normals;

use nalgebra::Point3;

pub use diameter::diameter;
pub use kd_tree::{KdTree, Neighbor};
pub use normals::estimate_normals;

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
        for bad in [f64::NAN, 2e9] {
            let points = [Point3::origin(), Point3::new(0.0, 0.0, bad)];
            assert_eq!(KdTree::new(&points).err(), Some(CloudError::Coordinate { index: 1 }));
        }
    }
}
