//! By what a camera is off from place to place in its image.

use nalgebra::{SMatrix, Vector2};

use super::DepthField;
use crate::scene::CameraCalibrationError;

/// Radial distortion, k1 and k2 of Brown and Conrady, and a smooth field by which depth is off: coefficients that no state holds, in this order.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ImageWarp {
    /// By which depth is off.
    pub(crate) depth: DepthField,
}

/// Number of coefficients of radial distortion.
pub(crate) const RADIAL: usize = 2;

impl ImageWarp {
    /// Number of coefficients.
    pub(crate) fn len(&self) -> usize {
        RADIAL + self.depth.len()
    }

    /// Derivatives by those coefficients that count of a residual about what is seen at `pixel` along `ray` (x/z, y/z), whose derivatives by the
    /// camera are `by_camera`.
    pub(crate) fn derivatives(
        &self,
        pixel: &Vector2<f64>,
        ray: &Vector2<f64>,
        by_camera: &[f64],
    ) -> impl Iterator<Item = (usize, f64)> + use<> {
        let along = ray.x * by_camera[CameraCalibrationError::PRINCIPAL_POINT]
            + ray.y * by_camera[CameraCalibrationError::PRINCIPAL_POINT + 1];
        let squared = ray.norm_squared();
        // At one pixel distortion is a shift, and depth's field a bias.
        let radial = [squared * along, squared * squared * along];
        let by_bias = by_camera[CameraCalibrationError::DEPTH_BIAS];
        let depth = self.depth.weights(pixel.x, pixel.y);
        let depth = depth.map(move |(k, weight)| (RADIAL + k, weight * by_bias));
        radial.into_iter().enumerate().chain(depth)
    }
}

/// The changes of a camera's parameters, a column for each coefficient, that are to the image around `ray` (x/z, y/z) what radial distortion is: to
/// first order in the size of that image, and but for its shear.
pub(crate) fn radial_as_camera(
    ray: &Vector2<f64>,
) -> SMatrix<f64, { CameraCalibrationError::DIMENSION }, RADIAL> {
    let mut changes = SMatrix::<f64, { CameraCalibrationError::DIMENSION }, RADIAL>::zeros();
    let squared = ray.norm_squared();
    for power in 1..=RADIAL {
        // Displacements r²ⁿ x, and half the sum and half the difference of their derivatives along the image's axes.
        let n = power as f64;
        let lower = squared.powi(power as i32 - 1);
        let shift = ray * (lower * squared);
        let larger = (1.0 + n) * lower * squared;
        let wider = n * lower * (ray.x * ray.x - ray.y * ray.y);
        let mut change = changes.column_mut(power - 1);
        change[CameraCalibrationError::PRINCIPAL_POINT] = shift.x - (larger + wider) * ray.x;
        change[CameraCalibrationError::PRINCIPAL_POINT + 1] = shift.y - (larger - wider) * ray.y;
        change[CameraCalibrationError::FOCAL_SCALE] = larger;
        change[CameraCalibrationError::ASPECT] = wider;
    }
    changes
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use prehend_render::BrownConrady;

    use super::*;

    fn lens(k1: f64, k2: f64) -> BrownConrady {
        BrownConrady { radial: [k1, k2, 0.0, 0.0, 0.0, 0.0], tangential: [0.0; 2] }
    }

    #[test]
    fn points_move_as_the_lens_moves_them() {
        let warp = ImageWarp { depth: DepthField::new(640, 480, 4) };
        let (seen, depth, pixel) = (Vector2::new(0.3, -0.2), 0.5, Vector2::new(500.0, 100.0));
        let plain = CameraCalibrationError::default();
        let jacobian = plain.point_jacobian(&seen, depth);
        let step = 1e-6;
        for row in 0..3 {
            let by_camera: Vec<f64> = jacobian.row(row).iter().copied().collect();
            let mut found = [0.0; RADIAL];
            let mut bias = 0.0;
            for (k, derivative) in warp.derivatives(&pixel, &seen, &by_camera) {
                *found.get_mut(k).unwrap_or(&mut bias) += derivative;
            }
            for (k, found) in found.iter().enumerate() {
                let point = |sign: f64| {
                    let mut radial = [0.0; RADIAL];
                    radial[k] = sign * step;
                    let ideal = lens(radial[0], radial[1]).undistort(seen).unwrap();
                    plain.point(&ideal, depth)[row]
                };
                let expected = (point(1.0) - point(-1.0)) / (2.0 * step);
                assert!((found - expected).abs() < 1e-9, "row {row}: {found}, not {expected}");
            }
            assert!((bias - by_camera[1]).abs() < 1e-12);
        }
    }

    #[test]
    fn images_are_shifted_and_sized_as_by_the_lens() {
        let center = Vector3::new(0.15, -0.1, 0.5);
        let (step, size) = (1e-6, 1e-4);
        let ideal = |place: Vector3<f64>| place.xy() / place.z;
        let changes = radial_as_camera(&ideal(center));
        for k in 0..RADIAL {
            let mut radial = [0.0; RADIAL];
            radial[k] = step;
            let lens = lens(radial[0], radial[1]);
            let change: Vec<f64> = changes.column(k).iter().map(|c| c * step).collect();
            let camera = CameraCalibrationError::default().changed(&change);
            // Of three points across and down, where a corrected camera shows them and where the lens does.
            let shown = |place: Vector3<f64>| {
                let ray = ideal(place);
                let sizes = Vector2::new(
                    1.0 + camera.focal_scale + camera.aspect,
                    1.0 + camera.focal_scale - camera.aspect,
                );
                ray.component_mul(&sizes) + camera.principal_point
            };
            let off = |place: Vector3<f64>| (shown(place) - lens.distort(ideal(place))) / step;
            assert!(off(center).norm() < 1e-6, "{}", off(center));
            let across = off(center + Vector3::new(size, 0.0, 0.0));
            let down = off(center + Vector3::new(0.0, size, 0.0));
            // But for shear, which is twice the product of the ray's parts.
            assert!(across.x.abs() < 1e-6 && down.y.abs() < 1e-6, "{across} {down}");
            assert!(across.y.abs() > 1e-6);
        }
    }
}
