//! Convex solids with a round border: what is within a distance of a core.

use nalgebra::{Matrix3, Point3, Unit, Vector3};
use prehend_autodiff::Scalar;
use prehend_geometry::{DistanceField, FieldSample};

use super::nearest::Nearest;
use super::polytope::Polytope;
use super::profile::Profile;
use crate::fields::BeyondBox;

/// A convex solid without its border.
#[derive(Clone, Debug)]
pub(crate) enum Core<T: Scalar> {
    /// The origin.
    Point,
    /// A segment around a center.
    Segment { center: Point3<f64>, axis: Unit<Vector3<f64>>, half: T },
    /// A box around the origin along the axes, by its half edges.
    Cuboid(Vector3<T>),
    /// A solid of revolution around the y axis.
    Profile(Profile<T>),
    /// A polyhedron.
    Polytope(Polytope<T>),
}

/// All within `border` \[m\] of a core. Outside of the core the distance is exact, inside it is the depth below the nearest face: it
/// is C¹ outside and to the depth of the border.
#[derive(Clone, Debug)]
pub(crate) struct Round<T: Scalar = f64> {
    pub(crate) core: Core<T>,
    pub(crate) border: T,
}

impl<T: Scalar> Round<T> {
    /// The distance alone.
    #[inline]
    fn distance_to(&self, point: &Point3<T>) -> T {
        let to_core = match &self.core {
            Core::Point => point.coords.norm(),
            Core::Segment { center, axis, half } => {
                offset_of_segment(point, center, axis, *half).0.norm()
            }
            Core::Cuboid(half) => BeyondBox::new(half, point).distance(),
            Core::Profile(profile) => profile.distance(point),
            Core::Polytope(polytope) => polytope.nearest(point).distance,
        };
        to_core - self.border
    }

    /// The distance with its derivatives. On the axis of a capsule and at the center of a ball they are zero, which is no contact.
    #[inline]
    pub(crate) fn nearest(&self, point: &Point3<T>) -> Nearest<T> {
        let mut nearest = match &self.core {
            Core::Point => Nearest::vertex(point.coords),
            Core::Segment { center, axis, half } => {
                let (offset, inner) = offset_of_segment(point, center, axis, *half);
                match inner {
                    true => Nearest::edge(offset, &axis.map(T::constant)),
                    false => Nearest::vertex(offset),
                }
            }
            Core::Cuboid(half) => {
                let beyond = BeyondBox::new(half, point);
                let (gradient, hessian) = beyond.derivatives();
                Nearest { distance: beyond.distance(), gradient, hessian }
            }
            Core::Profile(profile) => profile.nearest(point),
            Core::Polytope(polytope) => polytope.nearest(point),
        };
        nearest.distance -= self.border;
        nearest
    }
}

/// From the closest point of a segment, and whether that is between its ends.
#[inline]
fn offset_of_segment<T: Scalar>(
    point: &Point3<T>,
    center: &Point3<f64>,
    axis: &Unit<Vector3<f64>>,
    half: T,
) -> (Vector3<T>, bool) {
    let offset = point - center.map(T::constant);
    let axis = axis.map(T::constant);
    let along = offset.dot(&axis);
    let inner = along.value().abs() <= half.value();
    let clamped = match (inner, along.value() > 0.0) {
        (true, _) => along,
        (false, true) => half,
        (false, false) => -half,
    };
    (offset - axis * clamped, inner)
}

impl DistanceField for Round {
    fn sample(&self, point: &Point3<f64>, reach: f64) -> Option<FieldSample> {
        let Nearest { distance, gradient, hessian } = self.nearest(point);
        (distance <= reach).then_some(FieldSample { distance, gradient, hessian })
    }

    fn distance(&self, point: &Point3<f64>, reach: f64) -> Option<f64> {
        let distance = self.distance_to(point);
        (distance <= reach).then_some(distance)
    }

    fn thickness(&self) -> f64 {
        let core = match &self.core {
            Core::Point | Core::Segment { .. } => 0.0,
            Core::Cuboid(half) => 2.0 * half.min(),
            Core::Profile(profile) => profile.thickness(),
            Core::Polytope(polytope) => polytope.thickness(),
        };
        core + 2.0 * self.border
    }

    fn bounding_ball(&self) -> Option<(Point3<f64>, f64)> {
        let (center, radius) = match &self.core {
            Core::Point => (Point3::origin(), 0.0),
            Core::Segment { center, half, .. } => (*center, *half),
            Core::Cuboid(half) => (Point3::origin(), half.norm()),
            Core::Profile(profile) => (Point3::origin(), profile.radius_about_origin()),
            Core::Polytope(polytope) => polytope.ball(),
        };
        Some((center, radius + self.border))
    }
}

impl<T: Scalar> Nearest<T> {
    /// Distance, gradient and Hessian of a solid of revolution around y, from the derivatives by radius and height at the point.
    pub(super) fn revolved(
        distance: T,
        [by_out, by_up]: [T; 2],
        [out_out, out_up, up_up]: [T; 3],
        point: &Point3<T>,
        out: T,
    ) -> Self {
        // On the axis any direction is as good.
        let axial = out.value() == 0.0;
        let outward = match axial {
            true => Vector3::x(),
            false => Vector3::new(point.x / out, T::zero(), point.z / out),
        };
        let around = Vector3::new(-outward.z, T::zero(), outward.x);
        let up = Vector3::y();
        let turn = match (axial, by_out.value() == 0.0) {
            (true, _) => out_out,
            (false, true) => T::zero(),
            (false, false) => by_out / out,
        };
        let mixed = outward * up.transpose();
        let hessian: Matrix3<T> = outward * outward.transpose() * out_out
            + (mixed + mixed.transpose()) * out_up
            + up * up.transpose() * up_up
            + around * around.transpose() * turn;
        Self { distance, gradient: outward * by_out + up * by_up, hessian }
    }
}
