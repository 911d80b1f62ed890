//! A point of a cloud and the point of a triangle nearest to it.

use nalgebra::{Matrix3, Point3, Vector3};

use crate::closest::triangle::Foot;
use crate::closest::{Closest, Feature};

/// All in the cloud's frame.
pub(super) struct Pair {
    pub(super) face: u32,
    pub(super) barycentric: [f64; 3],
    pub(super) feature: Feature,
    pub(super) point: Point3<f64>,
    corners: [Point3<f64>; 3],
}

impl Pair {
    /// What is found at a pose that is not finite.
    pub(super) const NOWHERE: Self = {
        let nowhere = Point3::new(f64::NAN, f64::NAN, f64::NAN);
        Self {
            face: 0,
            barycentric: [f64::NAN; 3],
            feature: Feature::Face,
            point: nowhere,
            corners: [nowhere; 3],
        }
    };

    pub(super) fn new(corners: [Point3<f64>; 3], closest: &Closest, point: Point3<f64>) -> Self {
        let Closest { face, barycentric, feature, .. } = *closest;
        Self { face, barycentric, feature, point, corners }
    }

    pub(super) fn of_foot(
        corners: [Point3<f64>; 3],
        face: u32,
        foot: &Foot,
        point: Point3<f64>,
    ) -> Self {
        let barycentric = [1.0 - foot.v - foot.w, foot.v, foot.w];
        Self { face, barycentric, feature: foot.feature, point, corners }
    }

    /// From the triangle to the point \[m\].
    pub(super) fn offset(&self) -> Vector3<f64> {
        let [a, b, c] = &self.corners;
        let [_, v, w] = self.barycentric;
        (self.point - a) - (b - a) * v - (c - a) * w
    }

    /// Half the second derivative of the squared distance by the point: along the normal over the interior, across
    /// an edge, and in every direction about a corner.
    pub(super) fn curvature(&self) -> Matrix3<f64> {
        let along = |v: Vector3<f64>| {
            v.try_normalize(0.0).map_or_else(Matrix3::zeros, |n| n * n.transpose())
        };
        let corner = |i: u8| self.corners[usize::from(i % 3)];
        match self.feature {
            Feature::Face => along((corner(1) - corner(0)).cross(&(corner(2) - corner(0)))),
            Feature::Edge(i) => Matrix3::identity() - along(corner(i + 1) - corner(i)),
            Feature::Vertex(_) => Matrix3::identity(),
        }
    }
}
