//! Maximum surface distances up to symmetry (Hodaň et al., "BOP Challenge 2020", ECCVW 2020).

use nalgebra::{Isometry3, Point3};
use prehend_render::Camera;

/// MSSD: the least over `symmetries` (see [`Symmetries::transforms`](crate::data::Symmetries::transforms)) of the largest distance
/// between corresponding model points, in the points' unit.
pub(super) fn mssd(
    estimate: &Isometry3<f64>,
    truth: &Isometry3<f64>,
    points: &[Point3<f64>],
    symmetries: &[Isometry3<f64>],
) -> f64 {
    let estimated: Vec<_> = points.iter().map(|p| estimate * p).collect();
    least_maximum(symmetries, |s, bound| {
        let t = truth * s;
        largest(points.iter().zip(&estimated).map(|(p, e)| (t * p - e).norm_squared()), bound)
    })
    .sqrt()
}

/// MSPD: the same for the projections of the points into the image \[px\]; infinite when a point lies
/// behind the camera in the estimated pose or in every symmetric true pose.
pub(super) fn mspd(
    estimate: &Isometry3<f64>,
    truth: &Isometry3<f64>,
    points: &[Point3<f64>],
    symmetries: &[Isometry3<f64>],
    camera: &Camera,
) -> f64 {
    let estimated: Vec<_> = points.iter().map(|p| camera.project(&(estimate * p))).collect();
    least_maximum(symmetries, |s, bound| {
        let t = truth * s;
        let squares =
            points.iter().zip(&estimated).map(|(p, e)| match (camera.project(&(t * p)), e) {
                (Some(a), Some(b)) => (a.x - b.x).powi(2) + (a.y - b.y).powi(2),
                _ => f64::INFINITY,
            });
        largest(squares, bound)
    })
    .sqrt()
}

/// The least of `maximum(symmetry, least so far)`.
fn least_maximum(
    symmetries: &[Isometry3<f64>],
    maximum: impl Fn(&Isometry3<f64>, f64) -> f64,
) -> f64 {
    symmetries.iter().fold(f64::INFINITY, |least, s| least.min(maximum(s, least)))
}

/// The largest value, or some value of at least `bound`, where it no longer matters how large.
fn largest(values: impl Iterator<Item = f64>, bound: f64) -> f64 {
    let mut largest = 0.0_f64;
    for value in values {
        largest = largest.max(value);
        if largest >= bound {
            break;
        }
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{ContinuousSymmetry, Symmetries};
    use nalgebra::Vector3;

    const CAMERA: Camera =
        Camera { fx: 600.0, fy: 500.0, cx: 320.0, cy: 240.0, width: 640, height: 480 };

    fn corners() -> Vec<Point3<f64>> {
        (0..8)
            .map(|i| {
                Point3::new(
                    f64::from(i & 1) - 0.5,
                    f64::from(i >> 1 & 1) - 0.5,
                    f64::from(i >> 2) - 0.5,
                )
            })
            .collect()
    }

    #[test]
    fn without_symmetry_it_is_the_largest_distance() {
        let truth = Isometry3::new(Vector3::new(0.1, -0.2, 4.0), Vector3::new(0.3, 0.1, 0.2));
        let estimate = Isometry3::translation(0.0, 0.4, 0.0) * truth;
        let identity = [Isometry3::identity()];
        assert!((mssd(&estimate, &truth, &corners(), &identity) - 0.4).abs() < 1e-14);
        // A vertical shift by 0.4 at depth z is 0.4 · 500 / z pixels: largest for the nearest corner.
        let nearest = corners().iter().map(|p| (truth * p).z).fold(f64::INFINITY, f64::min);
        assert!(
            (mspd(&estimate, &truth, &corners(), &identity, &CAMERA) - 200.0 / nearest).abs()
                < 1e-10
        );
    }

    #[test]
    fn symmetric_poses_count_as_equal() {
        let truth = Isometry3::new(Vector3::new(0.1, -0.2, 4.0), Vector3::new(0.3, 0.1, 0.2));
        let quarter = Isometry3::rotation(Vector3::z() * std::f64::consts::FRAC_PI_2);
        let symmetries = Symmetries { discrete: vec![quarter], continuous: vec![] }.transforms();
        let estimate = truth * quarter;
        assert!(mssd(&estimate, &truth, &corners(), &symmetries[..1]) > 0.9);
        assert!(mssd(&estimate, &truth, &corners(), &symmetries) < 1e-14);
        assert!(mspd(&estimate, &truth, &corners(), &symmetries, &CAMERA) < 1e-10);
        let axis = ContinuousSymmetry { axis: Vector3::z_axis(), point: Point3::origin() };
        let spins = Symmetries { discrete: vec![], continuous: vec![axis] }.transforms();
        let spun = truth * Isometry3::rotation(Vector3::z() * 1.234);
        // Half a step of 1.14° at radius 1/√2.
        assert!(
            mssd(&spun, &truth, &corners(), &spins)
                < 0.00999 * std::f64::consts::FRAC_1_SQRT_2 + 1e-6
        );
    }

    #[test]
    fn a_point_behind_the_camera_is_infinitely_wrong() {
        let truth = Isometry3::translation(0.0, 0.0, 4.0);
        let behind = Isometry3::translation(0.0, 0.0, -4.0);
        let identity = [Isometry3::identity()];
        assert_eq!(mspd(&behind, &truth, &corners(), &identity, &CAMERA), f64::INFINITY);
        assert_eq!(mspd(&truth, &behind, &corners(), &identity, &CAMERA), f64::INFINITY);
    }
}
