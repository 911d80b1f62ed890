//! Analytic distance fields.

use nalgebra::{Isometry3, Matrix3, Point3, Unit, Vector3};
use prehend_autodiff::Scalar;
use prehend_geometry::{DistanceField, FieldSample};

use crate::body::error::BodyError;
use crate::surface::Surface;

/// A field that is moved in the body frame: what was at the origin is at `pose`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed<F> {
    /// The field.
    pub field: F,
    /// Center \[m\].
    pub pose: Isometry3<f64>,
}

impl<F: DistanceField> DistanceField for Placed<F> {
    fn sample(&self, point: &Point3<f64>, reach: f64) -> Option<FieldSample> {
        let local = self.pose.inverse_transform_point(point);
        let FieldSample { distance, gradient, hessian } = self.field.sample(&local, reach)?;
        let rotation = self.pose.rotation.to_rotation_matrix().into_inner();
        let hessian = rotation * hessian * rotation.transpose();
        Some(FieldSample { distance, gradient: rotation * gradient, hessian })
    }

    fn distance(&self, point: &Point3<f64>, reach: f64) -> Option<f64> {
        self.field.distance(&self.pose.inverse_transform_point(point), reach)
    }

    fn lipschitz_bound(&self) -> f64 {
        self.field.lipschitz_bound()
    }

    fn thickness(&self) -> f64 {
        self.field.thickness()
    }

    fn bounding_ball(&self) -> Option<(Point3<f64>, f64)> {
        self.field.bounding_ball().map(|(center, radius)| (self.pose * center, radius))
    }
}

/// A half-space: everything below a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    /// Unit normal of the plane, out of the half-space.
    pub normal: Unit<Vector3<f64>>,
    /// Coordinate of the plane along the normal \[m\].
    pub height: f64,
}

impl HalfSpace {
    /// The half-space z < 0.
    pub fn floor() -> Self {
        Self { normal: Vector3::z_axis(), height: 0.0 }
    }
}

impl DistanceField for HalfSpace {
    fn sample(&self, point: &Point3<f64>, reach: f64) -> Option<FieldSample> {
        let distance = self.normal.dot(&point.coords) - self.height;
        let (gradient, hessian) = (self.normal.into_inner(), Matrix3::zeros());
        (distance <= reach).then_some(FieldSample { distance, gradient, hessian })
    }
}

/// A solid sphere. At its center the gradient is zero, which is no contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Its center \[m\].
    pub center: Point3<f64>,
    /// Its radius \[m\].
    pub radius: f64,
}

impl DistanceField for Sphere {
    fn sample(&self, point: &Point3<f64>, reach: f64) -> Option<FieldSample> {
        let offset = point - self.center;
        let length = offset.norm();
        let distance = length - self.radius;
        let (gradient, hessian) = if length < f64::MIN_POSITIVE {
            (Vector3::zeros(), Matrix3::zeros())
        } else {
            let outward = offset / length;
            (outward, (Matrix3::identity() - outward * outward.transpose()) / length)
        };
        (distance <= reach).then_some(FieldSample { distance, gradient, hessian })
    }

    fn thickness(&self) -> f64 {
        2.0 * self.radius
    }

    fn bounding_ball(&self) -> Option<(Point3<f64>, f64)> {
        Some((self.center, self.radius))
    }
}

/// Everything outside of a sphere. At its center the gradient is zero, which is no contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphereCavity {
    /// Center of the sphere \[m\].
    pub center: Point3<f64>,
    /// Radius of the sphere \[m\].
    pub radius: f64,
}

impl DistanceField for SphereCavity {
    fn sample(&self, point: &Point3<f64>, reach: f64) -> Option<FieldSample> {
        let Self { center, radius } = *self;
        let FieldSample { distance, gradient, hessian } =
            Sphere { center, radius }.sample(point, f64::INFINITY)?;
        let sample = FieldSample { distance: -distance, gradient: -gradient, hessian: -hessian };
        (sample.distance <= reach).then_some(sample)
    }
}

/// A box around the origin, along the axes, with round edges. It is C¹ outside and to the depth of its rounding.
///
/// The samples that go with it are those of [`Cuboid::surface`]; [`Body::with_cuboid`](crate::Body::with_cuboid) gives a body both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cuboid {
    /// Half of its edges, rounding included \[m\].
    pub half_extents: Vector3<f64>,
    /// Radius of its edges \[m\]: more than the depth to which anything presses, often 1 mm. Of
    /// [`rounded`](crate::Surface::rounded) samples the depth of their centers counts.
    pub rounding: f64,
}

/// Distance from the edges at which samples begin, in multiples of the rounding. Where flat turns into round the curvature jumps: samples
/// of a box that lies just there on an equal one would cross it with every tremor, and take twenty times as many steps.
pub(crate) const INSET: f64 = 1.25;

impl Cuboid {
    /// Samples of the box: on each face a lattice with distances of `spacing` \[m\] at most, that begins 5/4 of the rounding from the
    /// edges and so touches an equal box with all of its samples. Areas are those of the trapezoid rule, stretched to the edges: a
    /// face presses with its own area, evenly, and has lost 5/4 of the rounding as a support.
    ///
    /// # Errors
    /// If a length is not positive and finite, or the rounding leaves nothing of a face.
    pub fn surface(&self, spacing: f64) -> Result<Surface, BodyError> {
        let inset = INSET * self.rounding;
        if !(inset > 0.0 && inset < self.half_extents.min()) {
            return Err(BodyError::Edges(self.rounding));
        }
        Surface::flat_faces(self.half_extents.into(), inset, spacing)
    }
}

/// Excess of a point over the faces of a box around the origin.
pub(crate) struct BeyondBox<T: Scalar> {
    beyond: Vector3<T>,
    outside: Vector3<T>,
    sign: Vector3<T>,
    length: T,
    /// The axis of the face that the point is farthest beyond, and how far.
    nearest: usize,
    depth: T,
}

impl<T: Scalar> BeyondBox<T> {
    #[inline]
    pub(crate) fn new(half_extents: &Vector3<T>, point: &Point3<T>) -> Self {
        let sign = point.coords.map(|x| T::constant(x.value().signum()));
        let beyond = point.coords.component_mul(&sign) - half_extents;
        let outside = beyond.map(|x| if x.value() > 0.0 { x } else { T::zero() });
        let nearest = beyond.map(T::value).imax();
        let (length, depth) = (outside.norm(), beyond[nearest]);
        Self { beyond, outside, sign, length, nearest, depth }
    }

    /// From the box, negative inside.
    #[inline]
    pub(crate) fn distance(&self) -> T {
        if self.depth.value() > 0.0 { self.length } else { self.depth }
    }

    /// Gradient and Hessian of the distance.
    #[inline]
    pub(crate) fn derivatives(&self) -> (Vector3<T>, Matrix3<T>) {
        let Self { beyond, outside, sign, length, nearest, depth } = self;
        if depth.value() > 0.0 {
            let gradient = outside.component_mul(sign) / *length;
            let is_beyond = |x: T| if x.value() > 0.0 { T::one() } else { T::zero() };
            let curved = Matrix3::from_diagonal(&beyond.map(is_beyond));
            (gradient, (curved - gradient * gradient.transpose()) / *length)
        } else {
            (Vector3::ith(*nearest, sign[*nearest]), Matrix3::zeros())
        }
    }
}

impl DistanceField for Cuboid {
    fn sample(&self, point: &Point3<f64>, reach: f64) -> Option<FieldSample> {
        // From the box without its round shell.
        let core = self.half_extents.add_scalar(-self.rounding);
        let beyond = BeyondBox::new(&core, point);
        let distance = beyond.distance() - self.rounding;
        if distance > reach {
            return None;
        }
        let (gradient, hessian) = beyond.derivatives();
        Some(FieldSample { distance, gradient, hessian })
    }

    fn thickness(&self) -> f64 {
        2.0 * self.half_extents.min()
    }

    fn bounding_ball(&self) -> Option<(Point3<f64>, f64)> {
        Some((Point3::origin(), self.half_extents.norm()))
    }
}

#[cfg(test)]
mod tests {
    use prehend_autodiff::check::{compare_gradients, finite_difference_jacobian};

    use super::*;
    use crate::SurfacePoint;

    #[test]
    fn every_sample_of_a_face_touches_an_equal_box_and_they_press_as_all_of_it() {
        let cuboid = Cuboid { half_extents: Vector3::new(0.03, 0.02, 0.01), rounding: 1e-3 };
        let surface = cuboid.surface(0.009).unwrap();
        for (axis, area) in [8e-4, 12e-4, 24e-4].into_iter().enumerate() {
            let half = cuboid.half_extents[axis];
            let on_face = |p: &&SurfacePoint| p.position[axis] == half;
            let face: Vec<_> = surface.points().iter().filter(on_face).collect();
            let depth = 0.5 * cuboid.rounding;
            for point in &face {
                // The other one is above.
                let place = point.position - Vector3::ith(axis, 2.0 * half - depth).abs();
                let sample = cuboid.sample(&place, 0.0).unwrap();
                assert!((sample.distance + depth).abs() < 1e-15 && sample.hessian.norm() == 0.0);
            }
            let sum = |f: &dyn Fn(&SurfacePoint) -> f64| face.iter().map(|p| f(p)).sum::<f64>();
            assert!((sum(&|p| p.area) / area - 1.0).abs() < 1e-12);
            for other in [(axis + 1) % 3, (axis + 2) % 3] {
                assert!(sum(&|p| p.area * p.position[other]).abs() < 1e-15);
                let widest = face.iter().map(|p| p.position[other]).fold(0.0, f64::max);
                assert!((cuboid.half_extents[other] - widest - 1.25e-3).abs() < 1e-15);
            }
        }
        for rounding in [0.0, 8e-3, f64::NAN] {
            let refused = Cuboid { rounding, ..cuboid }.surface(0.01);
            assert!(matches!(refused, Err(BodyError::Edges(_))));
        }
        assert_eq!(cuboid.surface(0.0), Err(BodyError::Length(0.0)));
    }

    #[test]
    fn derivatives_match_differences() {
        let (center, radius) = (Point3::new(0.1, -0.2, 0.3), 0.7);
        let normal = Unit::new_normalize(Vector3::new(1.0, 2.0, -0.5));
        let cuboid = |x, y, z| Cuboid { half_extents: Vector3::new(x, y, z), rounding: 0.1 };
        let pose = Isometry3::new(Vector3::new(0.1, 0.2, -0.1), Vector3::new(0.3, -0.5, 0.2));
        let fields: [&dyn DistanceField; 8] = [
            &Placed { field: Sphere { center, radius }, pose },
            // Nearest to a corner, an edge, a face, and inside of the shell.
            &cuboid(0.2, 0.3, 0.2),
            &cuboid(0.2, 0.7, 0.2),
            &cuboid(0.7, 0.3, 0.7),
            &cuboid(0.7, 0.55, 0.7),
            &HalfSpace { normal, height: 0.4 },
            &Sphere { center, radius },
            &SphereCavity { center, radius },
        ];
        for field in fields {
            let at = [0.3, 0.5, -0.4];
            let sample = |x: &[f64]| field.sample(&Point3::from_slice(x), f64::INFINITY).unwrap();
            let numbers = |x: &[f64]| {
                let FieldSample { distance, gradient, .. } = sample(x);
                vec![distance, gradient.x, gradient.y, gradient.z]
            };
            let FieldSample { distance, gradient, hessian } = sample(&at);
            let differences = finite_difference_jacobian(numbers, &at, 1e-6);
            assert!(compare_gradients(gradient.as_slice(), &differences[0]).relative < 1e-8);
            for row in 0..3 {
                let exact: Vec<f64> = hessian.row(row).iter().copied().collect();
                let error = exact.iter().zip(&differences[1 + row]).map(|(a, b)| (a - b).abs());
                assert!(error.fold(0.0, f64::max) < 1e-8);
            }
            assert!(field.sample(&at.into(), distance - 1e-9).is_none());
        }
    }
}
