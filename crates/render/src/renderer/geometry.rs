//! Where a pixel meets a face or the nearest point of a contour, and the reverse derivatives.

use nalgebra::Vector3;
use prehend_autodiff::{LocalFunction, Scalar};

use crate::contour::GRAZING;

/// Where a ray meets the plane of a face.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// Perspective-correct barycentric coordinates.
    pub(super) b: [f64; 3],
    /// Depth \[m\].
    pub(super) z: f64,
}

/// Adjoints of what a hit depends on.
pub(super) struct HitAdjoint {
    pub(super) corners: [Vector3<f64>; 3],
    /// Adjoint of the ray X/Z.
    pub(super) ray: Vector3<f64>,
}

/// With corners p_i, barycentric coordinates b_i = d·(p_j × p_k)/(d·n) and Z = n·p_0/(d·n), d = X/Z, n the area
/// vector. A ray within the plane gets corner 0.
#[inline]
pub(super) fn hit([p0, p1, p2]: &[Vector3<f64>; 3], ray: &Vector3<f64>) -> Hit {
    let n = (p1 - p0).cross(&(p2 - p0));
    let facing = ray.dot(&n);
    if facing == 0.0 {
        return Hit { b: [1.0, 0.0, 0.0], z: p0.z };
    }
    let (b1, b2) = (ray.dot(&p2.cross(p0)) / facing, ray.dot(&p0.cross(p1)) / facing);
    Hit { b: [1.0 - b1 - b2, b1, b2], z: n.dot(p0) / facing }
}

/// The reverse derivative of [`hit`], given adjoints of its results. Σ b_i p_i = Z d implies
/// Σ p_i δb_i − d δZ = Z δd − Σ b_i δp_i, so one solution λ of the transposed 3×3 system gives all adjoints:
/// Z λ that of the ray, −b_i λ those of the corners. Planes count as inclined to the ray by at least the sine [`GRAZING`], as in
/// `PoseLoss`. None where the ray lies within the plane.
#[inline]
pub(super) fn hit_adjoint(
    [p0, p1, p2]: &[Vector3<f64>; 3],
    ray: &Vector3<f64>,
    hit: &Hit,
    by_b: [f64; 3],
    by_z: f64,
) -> Option<HitAdjoint> {
    let (e1, e2) = (p1 - p0, p2 - p0);
    let n = e1.cross(&e2);
    let least = f64::from(GRAZING) * n.norm() * ray.norm();
    let determinant = -ray.dot(&n);
    if determinant == 0.0 || least == 0.0 {
        return None;
    }
    let determinant = determinant.abs().max(least).copysign(determinant);
    let (a1, a2) = (by_b[1] - by_b[0], by_b[2] - by_b[0]);
    let sum = ray.cross(&e2) * a1 + e1.cross(ray) * a2 + n * by_z;
    // Rows of the system: e1·λ = a1, e2·λ = a2, −d·λ = by_z.
    let lambda = sum / determinant;
    Some(HitAdjoint { corners: hit.b.map(|b| lambda * -b), ray: lambda * hit.z })
}

/// The point of a contour edge next to a pixel, as a function of the ends of the edge (A, B; camera frame \[m\]) and of
/// fx, fy, cx, cy \[px\]: its share of the edge in space, from A, and the signed distance of the pixel from it \[px\].
#[derive(Clone, Copy, Debug)]
pub(super) struct ScreenFoot {
    pub(super) pixel: [f64; 2],
    /// The part of the edge (share of its screen length) that belongs to the contour.
    pub(super) range: [f64; 2],
    /// Unit normal in the image, away from the surface: the direction of the distance at the contour itself.
    pub(super) outward: [f64; 2],
    /// −1 inside, 1 outside.
    pub(super) side: f64,
}

impl LocalFunction<10, 2> for ScreenFoot {
    #[inline]
    fn evaluate<S: Scalar>(&self, x: [S; 10]) -> [S; 2] {
        let [fx, fy, cx, cy] = [x[6], x[7], x[8], x[9]];
        let project = |i: usize| [fx * x[i] / x[i + 2] + cx, fy * x[i + 1] / x[i + 2] + cy];
        let (a, b) = (project(0), project(3));
        let d = [b[0] - a[0], b[1] - a[1]];
        let r = [0, 1].map(|k| S::constant(self.pixel[k]) - a[k]);
        let free = (r[0] * d[0] + r[1] * d[1]) / (d[0] * d[0] + d[1] * d[1]);
        let [low, high] = self.range;
        let t = match free.value() {
            t if t <= low => S::constant(low),
            t if t >= high => S::constant(high),
            _ => free,
        };
        // In space the far end counts more: (t/Z_B) / ((1 − t)/Z_A + t/Z_B).
        let near = t * x[2];
        let share = near / ((S::one() - t) * x[5] + near);
        let offset = [r[0] - t * d[0], r[1] - t * d[1]];
        let squared = offset[0] * offset[0] + offset[1] * offset[1];
        let distance = self.side * squared.value().sqrt();
        let signed = if distance.abs() > 1e-3 {
            squared.sqrt().times(self.side)
        } else {
            // The root has no derivative at the contour, but the distance along the normal has.
            let along = offset[0].times(self.outward[0]) + offset[1].times(self.outward[1]);
            along.plus(distance - along.value())
        };
        [share, signed]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use prehend_autodiff::Fwd;
    use prehend_autodiff::check::finite_difference_gradient;

    const FACE: [f64; 9] = [-0.1, -0.05, 0.5, 0.12, -0.07, 0.6, 0.01, 0.11, 0.45];

    #[test]
    fn the_adjoint_of_a_hit_matches_differences() {
        let weights = ([0.3, -1.2, 0.7], 2.5);
        let split = |x: &[f64]| {
            let corners = [0, 3, 6].map(|i| Vector3::new(x[i], x[i + 1], x[i + 2]));
            (corners, Vector3::new(x[9], x[10], 1.0))
        };
        let value = |x: &[f64]| {
            let (corners, ray) = split(x);
            let hit = hit(&corners, &ray);
            (0..3).map(|i| weights.0[i] * hit.b[i]).sum::<f64>() + weights.1 * hit.z
        };
        let x = [FACE.as_slice(), &[0.05, 0.02]].concat();
        let (corners, ray) = split(&x);
        let at = hit(&corners, &ray);
        let point = corners[0] * at.b[0] + corners[1] * at.b[1] + corners[2] * at.b[2];
        assert!((point - ray * at.z).norm() < 1e-15);
        let adjoint = hit_adjoint(&corners, &ray, &at, weights.0, weights.1).unwrap();
        let mut exact: Vec<f64> = adjoint.corners.iter().flat_map(|c| [c.x, c.y, c.z]).collect();
        exact.extend([adjoint.ray.x, adjoint.ray.y]);
        let differences = finite_difference_gradient(value, &x, 1e-6);
        for (a, b) in exact.iter().zip(&differences) {
            assert!((a - b).abs() < 1e-6 * (1.0 + b.abs()), "{exact:?} {differences:?}");
        }
    }

    #[test]
    fn a_grazing_ray_has_a_bounded_derivative() {
        let largest = |sine: f64| {
            let corners = [
                Vector3::new(-0.1, 0.5 * sine, 0.5),
                Vector3::new(0.1, 0.5 * sine, 0.5),
                Vector3::new(0.0, 0.5 * sine, 0.9),
            ];
            let ray = Vector3::new(0.0, 0.7 * sine, 1.0);
            let at = hit(&corners, &ray);
            let adjoint = hit_adjoint(&corners, &ray, &at, [0.0; 3], 1.0).unwrap();
            adjoint.corners.iter().map(Vector3::amax).fold(0.0, f64::max)
        };
        // As steep as it is down to the bound, and no steeper beyond.
        assert!((largest(1e-2) / largest(1e-1) - 10.0).abs() < 1.0);
        assert!(largest(1e-6) <= 1.0 / f64::from(GRAZING), "{}", largest(1e-6));
    }

    #[test]
    fn a_ray_within_the_plane_has_no_derivative() {
        let corners =
            [Vector3::new(0.0, 0.0, 0.5), Vector3::new(0.1, 0.0, 0.6), Vector3::new(0.0, 0.0, 0.7)];
        let ray = Vector3::z();
        let at = hit(&corners, &ray);
        assert_eq!((at.b, at.z), ([1.0, 0.0, 0.0], 0.5));
        assert!(hit_adjoint(&corners, &ray, &at, [1.0; 3], 1.0).is_none());
    }

    #[test]
    fn the_foot_has_derivatives_at_the_contour_and_beyond_its_ends() {
        let edge = [-0.1, -0.05, 0.5, 0.12, -0.02, 0.6, 300.0, 310.0, 64.0, 48.0];
        let mut foot =
            ScreenFoot { pixel: [64.0, 30.0], range: [0.0, 1.0], outward: [0.0, 1.0], side: 1.0 };
        for (pixel, range) in
            [([64.0, 30.0], [0.0, 1.0]), ([64.0, 30.0], [0.7, 0.9]), ([0.0, 20.0], [0.0, 1.0])]
        {
            (foot.pixel, foot.range) = (pixel, range);
            let jacobian = foot.evaluate(Fwd::<10>::variables(edge)).map(|y| y.derivative);
            for k in 0..2 {
                let difference = finite_difference_gradient(
                    |x| foot.evaluate(std::array::from_fn(|i| x[i]))[k],
                    &edge,
                    1e-6,
                );
                for (a, b) in jacobian[k].iter().zip(&difference) {
                    assert!((a - b).abs() < 1e-5 * (1.0 + b.abs()), "{jacobian:?} {difference:?}");
                }
            }
        }
        // On the contour itself the slope is that just beside it.
        let a = [300.0 * -0.2 + 64.0, 310.0 * -0.1 + 48.0];
        let b = [300.0 * 0.2 + 64.0, 310.0 * (-0.02 / 0.6) + 48.0];
        let d: [f64; 2] = [b[0] - a[0], b[1] - a[1]];
        let length = d[0].hypot(d[1]);
        let normal = [-d[1] / length, d[0] / length];
        let middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
        let at = |distance: f64| {
            let pixel = [middle[0] + distance * normal[0], middle[1] + distance * normal[1]];
            let foot = ScreenFoot { pixel, range: [0.0, 1.0], outward: normal, side: 1.0 };
            foot.evaluate(Fwd::<10>::variables(edge))
        };
        let (on, beside) = (at(0.0), at(0.01));
        assert!(on[1].value.abs() < 1e-12);
        for (a, b) in on[1].derivative.iter().zip(&beside[1].derivative) {
            assert!((a - b).abs() < 2e-3 * (1.0 + b.abs()), "{on:?} {beside:?}");
        }
    }
}
