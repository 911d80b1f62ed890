//! A pixel inside a face: where it lies on the surface, and how that changes with the pose.

use glam::Vec3;

use crate::shading::surface::Shaded;
use crate::view::Row;

/// Surfaces are taken to be inclined to the viewing ray by at least this sine: of what is seen at a grazing angle, a
/// pixel's center says little, and its derivatives would grow without bound.
pub(crate) const GRAZING: f32 = 1e-3;

#[inline(always)]
pub(crate) fn row(linear: Vec3, angular: Vec3) -> Row {
    [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z]
}

/// How what a fixed pixel shows of a face changes with the pose.
pub(crate) struct InteriorMotion {
    /// Gradients of the barycentric coordinates of corners 1 and 2 by the surface's own motion, reversed.
    gradients: [Vec3; 2],
    arm: Vec3,
    /// Derivative of the depth.
    pub(crate) z_row: Row,
}

impl InteriorMotion {
    /// At barycentric coordinates `b` and depth `z` on the viewing ray `ray` (X/Z) of a face with corners `p` (camera frame
    /// \[m\]).
    ///
    /// A twist with velocity v(X) = t + ω × (X − c) moves the surface; the pixel then sees another material point. The
    /// coordinate of corner 1 of the point on ray X is f(X) = c₁·X / n·X with c₁ = e₂ × p₀ and n = e₁ × e₂ (of corner
    /// 2 likewise with c₂ = p₀ × e₁), so it changes by −h·v, h = (c₁ − f n) / n·X, and the depth by n·v / n·ray.
    #[inline(always)]
    pub(crate) fn new(p: &[Vec3; 3], b: [f32; 3], ray: Vec3, z: f32, twist_center: Vec3) -> Self {
        let (e1, e2) = (p[1] - p[0], p[2] - p[0]);
        let n = e1.cross(e2);
        // Of the corner, where rounding disturbs the plane's offset least.
        let facing = n.dot(p[0]);
        let least = GRAZING * (n.dot(n) * p[0].dot(p[0])).sqrt().max(1e-30);
        let facing = if facing < 0.0 { facing.min(-least) } else { facing.max(least) };
        let inverse = 1.0 / facing;
        let first = inverse * e2.cross(p[0]) - b[1] * inverse * n;
        let second = inverse * p[0].cross(e1) - b[2] * inverse * n;
        let arm = ray * z - twist_center;
        let along = n * (z * inverse);
        Self { gradients: [first, second], arm, z_row: row(along, arm.cross(along)) }
    }

    /// Derivative of color channel `k`.
    #[inline(always)]
    pub(crate) fn color_row(&self, shaded: &Shaded, k: usize) -> Row {
        let [first, second] = self.gradients;
        let h = shaded.along[0][k] * first + shaded.along[1][k] * second;
        row(-h, shaded.turning[k] - self.arm.cross(h))
    }
}

/// Adds to a color's row that the texture's level follows the depth of the model's center: `level` times (0, 0, 1) and
/// arm × (0, 0, 1), with the center's position `arm` from where twists turn.
#[inline(always)]
pub(crate) fn add_level(row: &mut Row, level: f32, arm: Vec3) {
    row[2] += level;
    row[3] += level * arm.y;
    row[4] -= level * arm.x;
}
