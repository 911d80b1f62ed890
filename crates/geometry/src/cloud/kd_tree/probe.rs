//! What neighbors are asked of: a point or a triangle.

use nalgebra::{Point3, Vector3};

use super::build::{LEAF, Leaf, Node, above, below};
use crate::closest::triangle::Triangle;

/// A box in single precision, rounded outwards.
pub(super) struct Interval {
    lo: [f32; 3],
    hi: [f32; 3],
}

impl Interval {
    fn new(lo: &Point3<f64>, hi: &Point3<f64>) -> Option<Self> {
        (lo.iter().chain(hi.iter()).all(|x| x.is_finite())).then(|| Self {
            lo: [0, 1, 2].map(|i| below(lo[i])),
            hi: [0, 1, 2].map(|i| above(hi[i])),
        })
    }

    /// Squared distances from the four boxes of `node`.
    #[inline]
    pub(super) fn distances_squared(&self, node: &Node) -> [f32; 4] {
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
}

/// Something that points can be near to.
pub(super) trait Probe {
    /// A box around it.
    fn interval(&self) -> &Interval;
    /// Squared distance of each point of `leaf` \[m²\]; anything larger will do for those above `limit`.
    fn distances_squared(&self, leaf: &Leaf, limit: f64) -> [f64; LEAF];
}

pub(super) struct PointProbe {
    point: Vector3<f64>,
    interval: Interval,
}

impl PointProbe {
    #[inline]
    pub(super) fn new(point: &Point3<f64>) -> Option<Self> {
        Some(Self { point: point.coords, interval: Interval::new(point, point)? })
    }
}

impl Probe for PointProbe {
    #[inline]
    fn interval(&self) -> &Interval {
        &self.interval
    }

    #[inline]
    fn distances_squared(&self, leaf: &Leaf, _: f64) -> [f64; LEAF] {
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

pub(super) struct TriangleProbe<'a> {
    triangle: &'a Triangle,
    interval: Interval,
}

impl<'a> TriangleProbe<'a> {
    /// `triangle` is that of `corners`.
    pub(super) fn new(corners: &[Point3<f64>; 3], triangle: &'a Triangle) -> Option<Self> {
        let [a, b, c] = corners;
        // `inf` and `sup` may lose a coordinate that is not a number.
        let finite = corners.iter().flat_map(|p| p.iter()).all(|x| x.is_finite());
        let interval = Interval::new(&a.inf(b).inf(c), &a.sup(b).sup(c)).filter(|_| finite)?;
        Some(Self { triangle, interval })
    }
}

impl Probe for TriangleProbe<'_> {
    fn interval(&self) -> &Interval {
        &self.interval
    }

    fn distances_squared(&self, leaf: &Leaf, limit: f64) -> [f64; LEAF] {
        std::array::from_fn(|lane| {
            let p = Vector3::from_fn(|axis, _| leaf.coordinates[axis][lane]);
            if leaf.indices[lane] == u32::MAX || self.triangle.plane_distance_squared(&p) > limit {
                return f64::INFINITY;
            }
            self.triangle.closest(&p).distance_squared
        })
    }
}
