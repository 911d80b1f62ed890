//! Points in front of a depth camera.

use nalgebra::{Point3, Vector3};

use super::{CloudError, PointCloud};

/// The measured points of a depth image.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DepthPoints {
    /// The points \[m\] in the camera frame, row by row from the top.
    pub cloud: PointCloud,
    /// The pixel each comes from, row-major: to look up its color or mask.
    pub pixels: Vec<u32>,
}

/// Back-projects a row-major `depth` image, z in the camera frame \[m\], of `width` columns.
///
/// `ray` is the camera: the direction X/Z (third component one) through a column and a row of the image, where
/// pixel centers are at integers; for a pinhole ((u − cx)/fx, (v − cy)/fy, 1). Pixels that measured nothing,
/// being zero, negative or not finite, give no point; set those outside a mask to zero.
///
/// ```
/// use nalgebra::{Point3, Vector3};
/// use prehend_geometry::cloud::back_project;
///
/// let pinhole = |u: f64, v: f64| Vector3::new((u - 1.0) / 500.0, (v - 0.5) / 500.0, 1.0);
/// let seen = back_project(&[0.0, 0.0, 0.5, 0.0, 0.0, 0.0], 3, pinhole)?;
/// assert_eq!(seen.cloud.points, [Point3::new(0.001, -0.0005, 0.5)]);
/// assert_eq!(seen.pixels, [2]);
/// # Ok::<(), prehend_geometry::cloud::CloudError>(())
/// ```
///
/// # Errors
/// [`CloudError::DepthSize`] where the pixels do not fill rows of `width`.
pub fn back_project(
    depth: &[f32],
    width: usize,
    ray: impl Fn(f64, f64) -> Vector3<f64>,
) -> Result<DepthPoints, CloudError> {
    if width == 0 || !depth.len().is_multiple_of(width) {
        return Err(CloudError::DepthSize { pixels: depth.len(), width });
    }
    let measured = depth.iter().enumerate().filter(|(_, z)| z.is_finite() && **z > 0.0);
    let (points, pixels) = measured
        .map(|(i, &z)| {
            let direction = ray((i % width) as f64, (i / width) as f64);
            (Point3::from(direction * f64::from(z)), i as u32)
        })
        .unzip();
    Ok(DepthPoints { cloud: PointCloud::new(points), pixels })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pinhole(u: f64, v: f64) -> Vector3<f64> {
        Vector3::new((u - 3.2) / 600.0, (v - 1.7) / 590.0, 1.0)
    }

    #[test]
    fn points_project_back_to_their_pixels() {
        let (width, height) = (7, 5);
        let depth: Vec<f32> = (0..width * height).map(|i| 0.4 + 0.01 * i as f32).collect();
        let seen = back_project(&depth, width, pinhole).unwrap();
        assert_eq!(seen.cloud.points.len(), width * height);
        for (p, &i) in seen.cloud.points.iter().zip(&seen.pixels) {
            let (u, v) = (600.0 * p.x / p.z + 3.2, 590.0 * p.y / p.z + 1.7);
            assert!((u - f64::from(i % 7)).abs() < 1e-12 && (v - f64::from(i / 7)).abs() < 1e-12);
            assert_eq!(p.z as f32, depth[i as usize]);
        }
    }

    #[test]
    fn pixels_without_measurement_give_no_point() {
        let depth = [0.0, -1.0, f32::NAN, f32::INFINITY, 0.5, -0.0];
        assert_eq!(back_project(&depth, 2, pinhole).unwrap().pixels, [4]);
        assert_eq!(back_project(&[], 2, pinhole).unwrap(), DepthPoints::default());
    }

    #[test]
    fn a_ragged_image_is_an_error() {
        for width in [0, 4] {
            let error = back_project(&[0.5; 6], width, pinhole);
            assert_eq!(error, Err(CloudError::DepthSize { pixels: 6, width }));
        }
    }
}
