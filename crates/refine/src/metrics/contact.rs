//! How much of an object's surface lies at the hand.

use nalgebra::{Isometry3, Point3};
use rayon::prelude::*;

/// Surface samples closer to the hand than this count as contact \[m\].
pub const CONTACT_DISTANCE: f64 = 0.005;

/// Surface samples the contact area is estimated from.
pub const CONTACT_SAMPLES: usize = 100_000;

/// CA: the fraction of the object's surface within [`CONTACT_DISTANCE`] of the hand's surface, inside or
/// outside, times its area \[cm²\].
///
/// `samples` are area-uniform points of the surface in the model frame \[m\] and `area` is its area
/// \[m²\]; `distance_to_hand` is the unsigned distance from a point of the camera frame to the hand's
/// surface \[m\]. The standard error is area·√(f(1−f)/n), f the fraction. NaN without samples.
pub fn contact_area_cm2(
    samples: &[Point3<f64>],
    area: f64,
    t_cam_model: &Isometry3<f64>,
    distance_to_hand: &(dyn Fn(&Point3<f64>) -> f64 + Sync),
) -> f64 {
    let touching = samples
        .par_iter()
        .filter(|p| distance_to_hand(&(t_cam_model * **p)) < CONTACT_DISTANCE)
        .count();
    touching as f64 / samples.len() as f64 * area * 1e4
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn a_square_on_a_plane_touches_by_its_lower_edge() {
        // A 10 cm square, upright in the model's xy plane, held in a pose that turns its y to the camera's z.
        let n = 200;
        let at = |i: usize| (i as f64 + 0.5) / n as f64 * 0.1;
        let samples: Vec<_> = (0..n * n).map(|i| Point3::new(at(i % n), at(i / n), 0.0)).collect();
        let pose = Isometry3::new(
            Vector3::new(3.0, 0.0, 0.52),
            Vector3::x() * std::f64::consts::FRAC_PI_2,
        );
        let plane = |p: &Point3<f64>| (p.z - 0.5201).abs();
        // Points with y below 5.1 mm lie within 5 mm of the plane: the first 10 of 200 rows, 0.5 mm apart.
        let area = contact_area_cm2(&samples, 0.01, &pose, &plane);
        assert!((area - 100.0 * 10.0 / 200.0).abs() < 1e-9, "{area}");
        assert_eq!(
            contact_area_cm2(&samples, 0.01, &Isometry3::translation(0.0, 0.0, 3.0), &plane),
            0.0
        );
    }
}
