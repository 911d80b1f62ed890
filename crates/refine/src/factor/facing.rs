//! Whether a camera can see a surface.

use std::f64::consts::PI;

use nalgebra::Vector3;

/// How much a surface looks at the camera at `place`, where it has the outward `normal`, of any length (camera frame): from 0
/// if it looks away to 1 from the sine `grazing` of its inclination to the line of sight on, in a smooth step, so that costs do not jump as a surface turns.
pub(super) fn facing(normal: &Vector3<f64>, place: &Vector3<f64>, grazing: f64) -> f64 {
    let cosine = -normal.dot(place) / (normal.norm() * place.norm());
    // Nothing where there is no normal, either.
    let x = if cosine > 0.0 { (cosine / grazing).min(1.0) } else { 0.0 };
    0.5 - 0.5 * (PI * x).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfaces_count_more_the_more_they_face_the_camera() {
        let place = Vector3::new(0.1, -0.05, 0.5);
        let across = place.cross(&Vector3::x());
        let at = |sine: f64| {
            let normal = across.normalize() * (1.0 - sine * sine).sqrt() - place.normalize() * sine;
            facing(&(3.0 * normal), &place, 0.2)
        };
        for sine in [-1.0, -0.3, -1e-9, 0.0] {
            assert_eq!(at(sine), 0.0);
        }
        assert!((at(0.1) - 0.5).abs() < 1e-12);
        assert!([0.02, 0.05, 0.1, 0.15, 0.19].windows(2).all(|w| at(w[0]) < at(w[1])));
        assert_eq!([at(0.21), at(1.0)], [1.0; 2]);
        assert_eq!(facing(&Vector3::zeros(), &place, 0.2), 0.0);
    }
}
