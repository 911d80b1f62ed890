//! A surface beside a distance field: which of its points touch, and what a contact law sees of them.

use nalgebra::{Matrix3, Point3, Vector3};
use prehend_autodiff::{Fwd, Scalar};
use prehend_geometry::{DistanceField, FieldSample};

use super::gap_smoothing::{GapSmoothing, SmoothedGap};
use super::point::ContactKinematics;
use crate::body_state::BodyState;
use crate::surface::{Cluster, Surface, SurfacePoint};

/// Below this length a distance gradient has no direction, and the point no contact.
const MIN_GRADIENT: f64 = 1e-9;

/// Cosine of the angle from which on two normals are those of opposite sides.
const OPPOSITE: f64 = -0.5;

/// Shortest step along a sample's path, in thicknesses of the solid: no more than to its middle.
const THIN_PART: f64 = 0.25;
/// Shortest such step, as part of the path: a bound on their number.
const SHORT_PART: f64 = 1e-3;

/// True of gradients on opposite sides of a solid.
fn are_opposite(a: Option<Vector3<f64>>, b: Option<Vector3<f64>>) -> bool {
    a.zip(b).is_some_and(|(a, b)| a.dot(&b) < OPPOSITE * a.norm() * b.norm())
}

/// A body's surface beside a distance field, at one moment; everything in the field's frame.
#[derive(Clone, Copy)]
pub struct ContactQuery<'a> {
    /// The samples that may touch.
    pub surface: &'a Surface,
    /// Center of mass of the body that carries them, in its body frame \[m\].
    pub com: Point3<f64>,
    /// The body's state, as the field sees it.
    pub state: BodyState,
    /// Whose surface is at distance zero.
    pub field: &'a dyn DistanceField,
    /// Smoothing of the gap where contact begins.
    pub smoothing: GapSmoothing,
}

/// A point in contact: what both the value and its derivative start from.
pub(crate) struct ContactPoint {
    /// From the center of mass to the sample, and to where it touches.
    pub(crate) arm: Vector3<f64>,
    pub(crate) lever: Vector3<f64>,
    /// Radius of the sample \[m\].
    pub(crate) radius: f64,
    /// Velocity where it touches.
    pub(crate) velocity: Vector3<f64>,
    pub(crate) smoothing: SmoothedGap,
    pub(crate) normal: Vector3<f64>,
    pub(crate) length: f64,
    pub(crate) area: f64,
    pub(crate) hessian: Matrix3<f64>,
    /// Place of the sample among those that the surface was made of.
    pub(crate) index: u32,
}

impl ContactQuery<'_> {
    /// Distance of a sample's center beyond which there is no force, for a law that reaches to `cutoff`.
    #[inline]
    fn reach(&self, cutoff: f64) -> f64 {
        cutoff + self.smoothing.band() + self.surface.rounding()
    }

    /// True if a point of `block` may be nearer to the field than `reach`.
    #[inline]
    fn may_touch(&self, block: &Cluster, reach: f64) -> bool {
        let within = reach + self.field.lipschitz_bound() * block.radius;
        block.radius.is_infinite() || self.distance_within(&block.center, within)
    }

    #[inline]
    fn distance_within(&self, point: &Point3<f64>, within: f64) -> bool {
        self.field.distance(&self.place(point), within).is_some()
    }

    /// Position of a point of the body's body frame.
    #[inline]
    fn place(&self, point: &Point3<f64>) -> Point3<f64> {
        let BodyState { pose, .. } = &self.state;
        Point3::from(pose.translation.vector + pose.rotation * (point - self.com))
    }

    /// The samples of [`ContactQuery::each_near`].
    pub(crate) fn near(&self, cutoff: f64, margin: f64) -> Surface {
        self.surface.only(self.each_near(cutoff, margin).map(|(point, _)| *point).collect())
    }

    /// The samples that may touch, for a law that reaches to `cutoff`, before one of them has moved by `margin` \[m\], each with the
    /// distance of its center \[m\].
    pub(crate) fn each_near(
        &self,
        cutoff: f64,
        margin: f64,
    ) -> impl Iterator<Item = (&SurfacePoint, f64)> {
        let reach = self.reach(cutoff) + self.field.lipschitz_bound() * margin;
        let blocks = self.surface.blocks().filter(move |(block, points)| {
            // One is asked for itself.
            points.len() == 1 || self.may_touch(block, reach)
        });
        blocks.flat_map(|(_, points)| points).filter_map(move |point| {
            Some((point, self.field.distance(&self.place(&point.position), reach)?))
        })
    }

    /// True if a touching sample has come to another side of the field since its body was in `before`: not out of the solid again
    /// but through the middle of it.
    pub(crate) fn has_crossed(&self, before: BodyState) -> bool {
        let reach = self.surface.rounding();
        let earlier = Self { state: before, ..*self };
        let gradient = |query: &Self, point: &SurfacePoint| {
            Some(query.field.sample(&query.place(&point.position), point.radius)?.gradient)
        };
        let crosses =
            |point: &SurfacePoint| are_opposite(gradient(&earlier, point), gradient(self, point));
        let mut touched = self.surface.blocks().filter(|(block, _)| self.may_touch(block, reach));
        touched.any(|(_, points)| points.iter().any(crosses))
    }

    /// True if a sample has gone straight through the middle of the solid since its body was in `before`, whether it touched then or
    /// touches now.
    pub(crate) fn has_passed(&self, before: BodyState) -> bool {
        let earlier = Self { state: before, ..*self };
        self.surface.points().iter().any(|point| {
            let [from, to] = [&earlier, self].map(|query| query.place(&point.position));
            let path = to - from;
            let length = path.norm();
            if length == 0.0 {
                return false;
            }
            let lipschitz = self.field.lipschitz_bound();
            let reach = lipschitz * length;
            let shortest = (THIN_PART * self.field.thickness()).max(SHORT_PART * length);
            let normal = |place: &Point3<f64>| Some(self.field.sample(place, reach)?.gradient);
            // Sphere tracing, from outside to outside of each part of the solid.
            let mut entry = None;
            let mut way = 0.0;
            while way < length {
                let place = from + path * (way / length);
                let Some(distance) = self.field.distance(&place, reach) else { return false };
                match entry {
                    None if distance < 0.0 => entry = normal(&place),
                    Some(entry) if distance >= 0.0 && are_opposite(Some(entry), normal(&place)) => {
                        return true;
                    }
                    Some(_) if distance >= 0.0 => entry = None,
                    _ => {}
                }
                way += (distance.abs() / lipschitz).max(shortest);
            }
            are_opposite(entry, normal(&to))
        })
    }

    /// Calls `visit` with gap \[m\] and area \[m²\] of every sample that a law that reaches to `cutoff` may push.
    pub(crate) fn for_each_gap(&self, cutoff: f64, mut visit: impl FnMut(f64, f64)) {
        let within = cutoff + self.smoothing.force_band();
        for point in self.surface.points() {
            let place = self.place(&point.position);
            if let Some(distance) = self.field.distance(&place, within + point.radius) {
                visit(distance - point.radius, point.area);
            }
        }
    }

    /// Calls `visit` with every point in contact, in order; with `pressing_only` without those that exert no force and only
    /// leak. Points beyond `cutoff` and the band of the smoothing exert no force, so leaving out blocks of them changes
    /// nothing. Says whether every distance was a number.
    #[inline(always)]
    pub(crate) fn for_each_contact(
        &self,
        cutoff: f64,
        pressing_only: bool,
        mut visit: impl FnMut(&ContactPoint),
    ) -> bool {
        let BodyState { pose, linear, angular } = &self.state;
        let (translation, rotation) = (pose.translation.vector, pose.rotation.to_rotation_matrix());
        let reach = self.reach(cutoff);
        let skips = pressing_only && self.smoothing.leaks();
        for (block, points) in self.surface.blocks() {
            // One is asked for itself below.
            if points.len() > 1 && !self.may_touch(block, reach) {
                continue;
            }
            for point in points {
                let radius = point.radius;
                let arm = rotation * (point.position - self.com);
                let place = Point3::from(translation + arm);
                // The distance alone is cheap. What is no number is found below.
                if skips && self.field.distance(&place, reach).is_none_or(|d| d - radius >= cutoff)
                {
                    continue;
                }
                let Some(sample) = self.field.sample(&place, reach) else { continue };
                let FieldSample { distance, gradient, hessian } = sample;
                if distance.is_nan() {
                    return false;
                }
                let Some(smoothing) = self.smoothing.at(distance - radius - cutoff) else {
                    continue;
                };
                let length = gradient.norm();
                if length.is_nan() || length < MIN_GRADIENT {
                    continue;
                }
                let (normal, area) = (gradient / length, point.area);
                let lever = if radius > 0.0 { arm - normal * radius } else { arm };
                let velocity = linear + angular.cross(&lever);
                visit(&ContactPoint {
                    arm,
                    lever,
                    radius,
                    velocity,
                    smoothing,
                    normal,
                    length,
                    area,
                    hessian,
                    index: point.index,
                });
            }
        }
        true
    }
}

impl ContactPoint {
    /// Kinematics that the law sees.
    #[inline(always)]
    pub(crate) fn contact(&self, cutoff: f64) -> ContactKinematics<f64> {
        let speed = self.velocity.dot(&self.normal);
        ContactKinematics {
            gap: cutoff + self.smoothing.gap,
            normal_speed: self.smoothing.activation * speed,
            slip: self.velocity - self.normal * speed,
            normal: self.normal,
            area: self.area,
        }
    }

    /// Kinematics that the law sees with this `normal` and `velocity` where the distance is larger by `change`, a zero that carries
    /// derivatives.
    #[inline(always)]
    pub(crate) fn moved<T: Scalar>(
        &self,
        cutoff: f64,
        change: T,
        normal: Vector3<T>,
        velocity: Vector3<T>,
        area: T,
    ) -> ContactKinematics<T> {
        let SmoothedGap { gap, slope, activation, activation_slope } = self.smoothing;
        let smoothed = |value: f64, slope: f64| change.times(slope).plus(value);
        let speed = velocity.dot(&normal);
        ContactKinematics {
            gap: smoothed(cutoff + gap, slope),
            normal_speed: smoothed(activation, activation_slope) * speed,
            slip: velocity - normal * speed,
            normal,
            area,
        }
    }

    /// Kinematics that the law sees, with derivatives by the point's position (0..3) and velocity (3..6).
    #[inline(always)]
    pub(crate) fn lifted(&self, cutoff: f64) -> ContactKinematics<Fwd<6>> {
        let gradient = self.normal * self.length;
        let along_gradient = |value: f64, slope: f64| {
            let g = gradient * slope;
            Fwd { value, derivative: [g.x, g.y, g.z, 0.0, 0.0, 0.0] }
        };
        let normal = self.lifted_normal();
        let u: Vector3<Fwd<6>> = Vector3::from_fn(|i, _| Fwd::variable(self.velocity[i], 3 + i));
        let speed = u.x * normal.x + u.y * normal.y + u.z * normal.z;
        let activation = along_gradient(self.smoothing.activation, self.smoothing.activation_slope);
        ContactKinematics {
            gap: along_gradient(cutoff + self.smoothing.gap, self.smoothing.slope),
            normal_speed: activation * speed,
            slip: Vector3::from_fn(|i, _| u[i] - normal[i] * speed),
            normal,
            area: Fwd::constant(self.area),
        }
    }

    /// The unit normal with its derivative by position: (I − nnᵀ)·∇²φ/|∇φ|.
    #[inline(always)]
    fn lifted_normal(&self) -> Vector3<Fwd<6>> {
        let n = &self.normal;
        let hessian_n = self.hessian.tr_mul(n);
        Vector3::from_fn(|i, _| {
            let mut derivative = [0.0; 6];
            for j in 0..3 {
                derivative[j] = (self.hessian[(i, j)] - n[i] * hessian_n[j]) / self.length;
            }
            Fwd { value: n[i], derivative }
        })
    }
}
