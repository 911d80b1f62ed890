//! The ground below a height field.

use nalgebra::{Matrix2, Matrix2x3, Matrix3, Matrix3x2, Point3, Vector2, Vector3};
use prehend_geometry::sdf::{HeightSample, HeightSpline};
use prehend_geometry::{DistanceField, FieldSample};

/// Newton steps at most: three or four do near the ground.
const STEPS: usize = 12;
/// Part of the distance between heights within which heights and slopes of the ground are those of its quadratic to rounding, and
/// curvatures change by as little.
const SHORT: f64 = 1e-8;

/// Everything below y = h(x, z), where h is a C² spline through the heights.
///
/// The distance is that of the closest point, found from the point below; its gradient is the normal there. It is C² to within the
/// least radius of curvature of the ground.
pub(crate) struct HeightField {
    heights: HeightSpline,
    /// Least part of a height above the ground that the distance is.
    least_part: f64,
    /// Distance between heights along the axis where it is less \[m\].
    spacing: f64,
}

/// The closest point of the ground.
struct GroundPoint {
    place: Vector2<f64>,
    ground: HeightSample,
    /// Derivative of the equations by the place.
    jacobian: Matrix2<f64>,
}

impl HeightField {
    /// Height field y = h(x, z).
    pub(crate) fn new(heights: HeightSpline) -> Self {
        let steepest = heights.steepest();
        let least_part = 1.0 / (1.0 + steepest * steepest).sqrt();
        let [along_u, along_v] = heights.spacing();
        Self { heights, least_part, spacing: along_u.min(along_v) }
    }

    /// Foot of the normal from `point` to the ground; none if that is farther than `reach`, for certain.
    #[inline]
    fn foot(&self, point: &Point3<f64>, reach: f64) -> Option<GroundPoint> {
        let target = Vector2::new(point.x, point.z);
        let mut ground = self.heights.at(point.x, point.z);
        let above = point.y - ground.height;
        // Written so that NaN is far away.
        let near = above.min(above * self.least_part) <= reach;
        if !near {
            return None;
        }
        let mut place = target;
        let mut step = 0;
        loop {
            let slopes = Vector2::from(ground.slopes);
            let [uu, uv, vv] = ground.curvatures;
            let above = point.y - ground.height;
            let residual = place - target - slopes * above;
            let steep = Matrix2::identity() + slopes * slopes.transpose();
            let full = steep - Matrix2::new(uu, uv, uv, vv) * above;
            // Too far below a hill, or above a hollow, a step as for a plane leads to a minimum, too.
            let convex = full.m11 > 0.0 && full.determinant() > 0.0;
            let jacobian = if convex { full } else { steep };
            let change = jacobian.try_inverse().map_or(-residual, |inverse| -(inverse * residual));
            step += 1;
            let length = change.norm();
            if length <= 1e-12 * (above.abs() + length) + 1e-15 || step > STEPS {
                return Some(GroundPoint { place, ground, jacobian });
            }
            place += change;
            if length <= SHORT * self.spacing {
                let bend =
                    Vector2::new(uu * change.x + uv * change.y, uv * change.x + vv * change.y);
                ground.height += change.dot(&(slopes + bend * 0.5));
                ground.slopes = (slopes + bend).into();
                return Some(GroundPoint { place, ground, jacobian });
            }
            ground = self.heights.at(place.x, place.y);
        }
    }
}

impl GroundPoint {
    /// Up, out of the ground, and its length.
    #[inline]
    fn upward(&self) -> (Vector3<f64>, f64) {
        let [u, v] = self.ground.slopes;
        let upward = Vector3::new(-u, 1.0, -v);
        (upward, upward.norm())
    }

    #[inline]
    fn distance(&self, point: &Point3<f64>) -> f64 {
        let (upward, length) = self.upward();
        let foot = Point3::new(self.place.x, self.ground.height, self.place.y);
        upward.dot(&(point - foot)) / length
    }
}

impl DistanceField for HeightField {
    fn sample(&self, point: &Point3<f64>, reach: f64) -> Option<FieldSample> {
        let foot = self.foot(point, reach)?;
        let distance = foot.distance(point);
        if distance > reach {
            return None;
        }
        let (upward, length) = foot.upward();
        let gradient = upward / length;
        let ([u, v], [uu, uv, vv]) = (foot.ground.slopes, foot.ground.curvatures);
        // How the foot moves with the point, and the normal with the foot.
        let moves = foot.jacobian.try_inverse()? * Matrix2x3::new(1.0, u, 0.0, 0.0, v, 1.0);
        let turns = Matrix3x2::new(-uu, -uv, 0.0, 0.0, -uv, -vv) / length;
        let across = Matrix3::identity() - gradient * gradient.transpose();
        let hessian = across * turns * moves;
        let hessian = (hessian + hessian.transpose()) * 0.5;
        Some(FieldSample { distance, gradient, hessian })
    }

    fn distance(&self, point: &Point3<f64>, reach: f64) -> Option<f64> {
        let distance = self.foot(point, reach)?.distance(point);
        (distance <= reach).then_some(distance)
    }
}
