//! Whether a camera can see a surface.

use nalgebra::Vector3;

/// Surface that is inclined to the line of sight by less than this sine counts less, down to nothing where it looks away.
const INCLINED: f64 = 0.2;

/// How much a surface faces the camera.
pub(super) struct Facing {
    /// From 0, which looks away, to 1, in a smooth step, so that costs do not jump as a surface turns.
    pub(super) share: f64,
    /// Its derivative by the place of the surface \[1/m\].
    pub(super) by_place: Vector3<f64>,
    /// Its derivative by a rotation vector of the normal alone \[1/rad\].
    pub(super) by_rotation: Vector3<f64>,
}

impl Facing {
    /// Of a surface at `place` that has the outward `normal`, of any length (camera frame).
    pub(super) fn new(normal: &Vector3<f64>, place: &Vector3<f64>) -> Self {
        let distance = place.norm();
        let (normal, ray) = (normal / normal.norm(), place / distance);
        let cosine = -normal.dot(&ray);
        // Not so either where there is no normal: the cosine is no number then.
        if !(cosine > 0.0) {
            return Self { share: 0.0, by_place: Vector3::zeros(), by_rotation: Vector3::zeros() };
        }
        let x = (cosine / INCLINED).min(1.0);
        let slope = 6.0 * x * (1.0 - x) / INCLINED;
        Self {
            share: x * x * (3.0 - 2.0 * x),
            by_place: (normal + ray * cosine) * (-slope / distance),
            by_rotation: ray.cross(&normal) * slope,
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;
    use prehend_autodiff::check::{compare_gradients, finite_difference_gradient};

    use super::*;

    #[test]
    fn derivatives_match_differences() {
        let place = Vector3::new(0.1, -0.05, 0.5);
        let normal = Vector3::new(0.8, 0.5, -0.25);
        let share = |x: &[f64]| {
            let turned = UnitQuaternion::from_scaled_axis(Vector3::new(x[3], x[4], x[5])) * normal;
            Facing::new(&turned, &(place + Vector3::new(x[0], x[1], x[2]))).share
        };
        let Facing { share: value, by_place, by_rotation } = Facing::new(&normal, &place);
        assert!(value > 0.1 && value < 0.9, "{value}");
        let found = [by_place.as_slice(), by_rotation.as_slice()].concat();
        let reference = finite_difference_gradient(share, &[0.0; 6], 1e-6);
        assert!(compare_gradients(&found, &reference).relative < 1e-8);
    }

    #[test]
    fn surfaces_count_more_the_more_they_face_the_camera() {
        let place = Vector3::new(0.1, -0.05, 0.5);
        let across = place.cross(&Vector3::x());
        let at = |sine: f64| {
            let normal = across.normalize() * (1.0 - sine * sine).sqrt() - place.normalize() * sine;
            Facing::new(&(3.0 * normal), &place).share
        };
        for sine in [-1.0, -0.3, -1e-9, 0.0] {
            assert_eq!(at(sine), 0.0);
        }
        assert!((at(0.1) - 0.5).abs() < 1e-12);
        assert!([0.02, 0.05, 0.1, 0.15, 0.19].windows(2).all(|w| at(w[0]) < at(w[1])));
        assert_eq!([at(0.21), at(1.0)], [1.0; 2]);
        assert_eq!(Facing::new(&Vector3::zeros(), &place).share, 0.0);
    }
}
