//! The pinhole camera.

use nalgebra::{Point3, Vector2, Vector3};

/// A pinhole camera without distortion, in the OpenCV frame (x right, y down, z forward).
///
/// Pixel centers lie at integer coordinates: the center of the top-left pixel is (0, 0), and a point
/// (X, Y, Z) \[m\] projects to `u = fx X/Z + cx`, `v = fy Y/Z + cy` \[px\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Focal length along the columns \[px\].
    pub fx: f64,
    /// Focal length along the rows \[px\].
    pub fy: f64,
    /// Column of the principal point \[px\].
    pub cx: f64,
    /// Row of the principal point \[px\].
    pub cy: f64,
    /// Columns of the image.
    pub width: usize,
    /// Rows of the image.
    pub height: usize,
}

/// Why a matrix is no pinhole camera of this crate.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CameraError {
    /// An entry is infinite or not a number.
    #[error("camera matrix entry {index} is {value}, expected a finite number")]
    NotFinite {
        /// Row-major index into the matrix.
        index: usize,
        /// The entry.
        value: f64,
    },
    /// A focal length is zero, negative or larger than [`Camera::MAX_FOCAL_LENGTH`].
    #[error("focal length {name} is {value} px, expected more than zero and 1e9 at most")]
    FocalLength {
        /// `"fx"` or `"fy"`.
        name: &'static str,
        /// The focal length \[px\].
        value: f64,
    },
    /// An entry that must be 0 or 1 is not: the matrix is skewed, transposed or not a camera matrix.
    #[error("camera matrix entry {index} is {value}, expected {expected} (row-major, no skew)")]
    Layout {
        /// Row-major index into the matrix.
        index: usize,
        /// The entry.
        value: f64,
        /// Value of the entry in a matrix without skew.
        expected: f64,
    },
    /// The image has no pixels.
    #[error("image size {width} x {height} has no pixels")]
    Empty {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
}

impl Camera {
    /// The longest focal length \[px\]: with it derivatives by poses stay within single precision.
    pub const MAX_FOCAL_LENGTH: f64 = 1e9;

    /// A camera from its row-major matrix `[fx, 0, cx, 0, fy, cy, 0, 0, 1]` \[px\] and image size.
    ///
    /// # Errors
    /// When an entry is not finite, a focal length is not positive or longer than [`Camera::MAX_FOCAL_LENGTH`], the matrix has
    /// skew or the image is empty.
    pub fn from_k(k: [f64; 9], width: usize, height: usize) -> Result<Self, CameraError> {
        for (index, expected) in [(1, 0.0), (3, 0.0), (6, 0.0), (7, 0.0), (8, 1.0)] {
            let value = k[index];
            if value.is_nan() || (value - expected).abs() > 1e-9 {
                return Err(CameraError::Layout { index, value, expected });
            }
        }
        let camera = Self { fx: k[0], fy: k[4], cx: k[2], cy: k[5], width, height };
        camera.check()?;
        Ok(camera)
    }

    /// Whether a camera can be like this, whoever made it.
    ///
    /// # Errors
    /// When a number is not finite, a focal length is not positive or longer than [`Camera::MAX_FOCAL_LENGTH`], or the image is empty.
    pub fn check(&self) -> Result<(), CameraError> {
        let Self { width, height, .. } = *self;
        if width == 0 || height == 0 {
            return Err(CameraError::Empty { width, height });
        }
        let k = self.k();
        if let Some((index, &value)) = k.iter().enumerate().find(|(_, v)| !v.is_finite()) {
            return Err(CameraError::NotFinite { index, value });
        }
        for (name, value) in [("fx", self.fx), ("fy", self.fy)] {
            if value <= 0.0 || value > Self::MAX_FOCAL_LENGTH {
                return Err(CameraError::FocalLength { name, value });
            }
        }
        Ok(())
    }

    /// The row-major camera matrix \[px\].
    pub fn k(&self) -> [f64; 9] {
        [self.fx, 0.0, self.cx, 0.0, self.fy, self.cy, 0.0, 0.0, 1.0]
    }

    /// Image position (column, row) \[px\] of a point in the camera frame \[m\]; `None` unless it lies in
    /// front of the camera (Z > 0). The position may lie outside the image, but not so far that it is no number.
    pub fn project(&self, point: &Point3<f64>) -> Option<Vector2<f64>> {
        let position = || {
            Vector2::new(
                self.fx * point.x / point.z + self.cx,
                self.fy * point.y / point.z + self.cy,
            )
        };
        let finite = |position: &Vector2<f64>| position.iter().all(|p| p.is_finite());
        (point.z > 0.0).then(position).filter(finite)
    }

    /// The point in the camera frame \[m\] at image position (`u`, `v`) \[px\] and depth `z` (its Z) \[m\].
    pub fn unproject(&self, u: f64, v: f64, z: f64) -> Point3<f64> {
        Point3::from(self.ray(u, v) * z)
    }

    /// The viewing ray X/Z through image position (`u`, `v`) \[px\]: its third component is one.
    pub fn ray(&self, u: f64, v: f64) -> Vector3<f64> {
        Vector3::new((u - self.cx) / self.fx, (v - self.cy) / self.fy, 1.0)
    }

    /// Camera of the same view with `factor` times the resolution, for pyramid levels (0.5) and supersampling (3).
    ///
    /// Image borders are kept in place, so the principal point moves to `(cx + 0.5) factor - 0.5`. Sizes
    /// round down and stay at least one pixel.
    pub fn scaled(&self, factor: f64) -> Self {
        let size = |n: usize| ((n as f64 * factor + 1e-9).floor() as usize).max(1);
        Self {
            fx: self.fx * factor,
            fy: self.fy * factor,
            cx: (self.cx + 0.5) * factor - 0.5,
            cy: (self.cy + 0.5) * factor - 0.5,
            width: size(self.width),
            height: size(self.height),
        }
    }

    /// The camera of the sub-image of `width` by `height` pixels whose top-left pixel is (`left`, `top`).
    pub fn cropped(&self, left: usize, top: usize, width: usize, height: usize) -> Self {
        Self { cx: self.cx - left as f64, cy: self.cy - top as f64, width, height, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const K: [f64; 9] = [600.0, 0.0, 319.5, 0.0, 590.0, 239.5, 0.0, 0.0, 1.0];

    #[test]
    fn unprojecting_undoes_projecting() {
        let camera = Camera::from_k(K, 640, 480).unwrap();
        let point = Point3::new(0.07, -0.04, 0.55);
        let uv = camera.project(&point).unwrap();
        assert!((camera.unproject(uv.x, uv.y, point.z) - point).norm() < 1e-15);
        assert!(camera.project(&Point3::new(0.0, 0.0, -1.0)).is_none());
        assert_eq!(camera.k(), K);
    }

    #[test]
    fn scaling_keeps_the_image_borders() {
        let camera = Camera::from_k(K, 640, 480).unwrap();
        let half = camera.scaled(0.5);
        assert_eq!((half.width, half.height), (320, 240));
        // The outer corner of the bottom-right pixel stays the outer corner.
        let (fine, coarse) = (camera.ray(639.5, 479.5), half.ray(319.5, 239.5));
        assert!((fine - coarse).norm() < 1e-12);
        // Pixel (u, v) tripled has its center in the middle sample of three.
        assert!(
            (camera.scaled(3.0).ray(3.0 * 10.0 + 1.0, 1.0) - camera.ray(10.0, 0.0)).norm() < 1e-12
        );
    }

    #[test]
    fn cropping_moves_the_origin() {
        let camera = Camera::from_k(K, 640, 480).unwrap();
        let crop = camera.cropped(100, 50, 64, 32);
        assert_eq!(crop.ray(3.0, 4.0), camera.ray(103.0, 54.0));
    }

    #[test]
    fn bad_matrices_are_named() {
        let with = |index: usize, value: f64| {
            let mut k = K;
            k[index] = value;
            Camera::from_k(k, 640, 480).unwrap_err()
        };
        assert!(matches!(with(2, f64::NAN), CameraError::NotFinite { index: 2, .. }));
        assert!(matches!(with(4, -1.0), CameraError::FocalLength { name: "fy", .. }));
        assert!(matches!(with(0, 1e30), CameraError::FocalLength { name: "fx", .. }));
        assert!(matches!(with(1, 0.3), CameraError::Layout { index: 1, .. }));
        assert!(matches!(Camera::from_k(K, 0, 480), Err(CameraError::Empty { .. })));
    }
}
