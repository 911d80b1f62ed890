//! The point that neighbors are asked of.

use nalgebra::{Point3, Vector3};

use super::build::{KdNode, LEAF, Leaf, above, below};

/// A point, and the box around it in single precision, rounded outwards.
pub(super) struct KdProbe {
    point: Vector3<f64>,
    lo: [f32; 3],
    hi: [f32; 3],
}

impl KdProbe {
    /// `None` for a point that is not finite.
    #[inline]
    pub(super) fn new(point: &Point3<f64>) -> Option<Self> {
        point.iter().all(|x| x.is_finite()).then(|| Self {
            point: point.coords,
            lo: [0, 1, 2].map(|i| below(point[i])),
            hi: [0, 1, 2].map(|i| above(point[i])),
        })
    }

    /// Squared distances from the four boxes of `node`.
    #[inline]
    pub(super) fn to_boxes(&self, node: &KdNode) -> [f32; 4] {
        let mut sum = [0.0_f32; 4];
        for axis in 0..3 {
            let (lo, hi) = (&node.lo[axis], &node.hi[axis]);
            for i in 0..4 {
                let outside = (lo[i] - self.hi[axis]).max(self.lo[axis] - hi[i]).max(0.0);
                sum[i] += outside * outside;
            }
        }
        sum
    }

    /// Squared distance of each point of `leaf` \[m²\].
    #[inline]
    pub(super) fn to_points(&self, leaf: &Leaf) -> [f64; LEAF] {
        let mut sum = [0.0; LEAF];
        for axis in 0..3 {
            for (s, c) in sum.iter_mut().zip(&leaf.coordinates[axis]) {
                let d = self.point[axis] - c;
                *s += d * d;
            }
        }
        sum
    }
}
