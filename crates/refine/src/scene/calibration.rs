//! How a camera differs from its calibration.

use nalgebra::{Isometry3, Matrix3x6, Point3, SMatrix, Translation3, Vector2, Vector3};
use prehend_render::Camera;

/// Errors of a depth camera, as small changes that bring what it measures to where things are.
///
/// The default changes nothing. The parameters of [`Block::Camera`](crate::problem::Block::Camera) are the fields, in order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraCalibrationError {
    /// Factor of measured depth.
    pub depth_scale: f64,
    /// Offset of depth after the factor \[m\].
    pub depth_bias: f64,
    /// Offset of the true principal point from the stated one, right and below \[focal lengths\].
    pub principal_point: Vector2<f64>,
    /// How much larger the images of things are than focal length and models say, as a part of their size.
    pub focal_scale: f64,
    /// How much wider they are besides, and less high, as a part of their size: half of what the two focal lengths differ by.
    pub aspect: f64,
}

/// How another camera differs from what is said of it and of its place. The default changes nothing.
///
/// The parameters of [`Block::View`](crate::problem::Block::View) are translation, rotation vector, and those of the camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ViewCalibrationError {
    /// How far from where it is said to be the object's center is seen, in the camera's frame \[m\].
    pub translation: Vector3<f64>,
    /// How things are turned about that, as a rotation vector \[rad\].
    pub rotation: Vector3<f64>,
    /// Calibration error of the camera itself.
    pub camera: CameraCalibrationError,
}

impl ViewCalibrationError {
    /// Number of parameters.
    pub(crate) const DIMENSION: usize = 6 + CameraCalibrationError::DIMENSION;

    /// The parameters, zero where nothing is corrected.
    pub fn parameters(&self) -> [f64; Self::DIMENSION] {
        let pose = self.translation.iter().chain(&self.rotation).copied();
        let mut all = pose.chain(self.camera.parameters());
        std::array::from_fn(|_| all.next().unwrap_or_default())
    }

    /// With `change` added to the parameters.
    ///
    /// # Panics
    /// If there is not one change a parameter.
    pub fn changed(&self, change: &[f64]) -> Self {
        assert_eq!(change.len(), Self::DIMENSION, "one change a parameter");
        Self {
            translation: self.translation + Vector3::from_column_slice(&change[..3]),
            rotation: self.rotation + Vector3::from_column_slice(&change[3..6]),
            camera: self.camera.changed(&change[6..]),
        }
    }
}

impl Default for CameraCalibrationError {
    fn default() -> Self {
        Self {
            depth_scale: 1.0,
            depth_bias: 0.0,
            principal_point: Vector2::zeros(),
            focal_scale: 0.0,
            aspect: 0.0,
        }
    }
}

impl CameraCalibrationError {
    /// Number of parameters.
    pub(crate) const DIMENSION: usize = 6;

    /// Where they are, in the order of [`parameters`](Self::parameters).
    pub(crate) const DEPTH_BIAS: usize = 1;
    pub(crate) const PRINCIPAL_POINT: usize = 2;
    pub(crate) const FOCAL_SCALE: usize = 4;
    pub(crate) const ASPECT: usize = 5;

    /// The parameters, zero where nothing is corrected.
    pub fn parameters(&self) -> [f64; Self::DIMENSION] {
        let [x, y] = self.principal_point.into();
        [self.depth_scale - 1.0, self.depth_bias, x, y, self.focal_scale, self.aspect]
    }

    /// With `change` added to the parameters.
    ///
    /// # Panics
    /// If there is not one change a parameter.
    pub fn changed(&self, change: &[f64]) -> Self {
        assert_eq!(change.len(), Self::DIMENSION, "one change a parameter");
        Self {
            depth_scale: self.depth_scale + change[0],
            depth_bias: self.depth_bias + change[1],
            principal_point: self.principal_point + Vector2::new(change[2], change[3]),
            focal_scale: self.focal_scale + change[4],
            aspect: self.aspect + change[5],
        }
    }

    /// `camera` without its error.
    pub fn corrected(&self, camera: &Camera) -> Camera {
        Camera {
            cx: camera.cx + self.principal_point.x * camera.fx,
            cy: camera.cy + self.principal_point.y * camera.fy,
            fx: camera.fx * (1.0 + self.focal_scale + self.aspect),
            fy: camera.fy * (1.0 + self.focal_scale - self.aspect),
            ..*camera
        }
    }

    /// Where a point is \[m\] that the camera, as it is said to be, sees along `ray` (x/z, y/z) at `depth` \[m\].
    pub fn point(&self, ray: &Vector2<f64>, depth: f64) -> Point3<f64> {
        let z = self.depth_scale * depth + self.depth_bias;
        let true_ray = (ray - self.principal_point).component_div(&self.sizes());
        Point3::new(true_ray.x * z, true_ray.y * z, z)
    }

    /// Derivatives of [`point`](Self::point) by the parameters.
    pub fn point_jacobian(&self, ray: &Vector2<f64>, depth: f64) -> Matrix3x6<f64> {
        let z = self.depth_scale * depth + self.depth_bias;
        let sizes = self.sizes();
        let true_ray = (ray - self.principal_point).component_div(&sizes);
        let along = true_ray.push(1.0);
        let by_size = true_ray.component_div(&sizes) * -z;
        Matrix3x6::from_columns(&[
            along * depth,
            along,
            Vector3::new(-z / sizes.x, 0.0, 0.0),
            Vector3::new(0.0, -z / sizes.y, 0.0),
            Vector3::new(by_size.x, by_size.y, 0.0),
            Vector3::new(by_size.x, -by_size.y, 0.0),
        ])
    }

    /// Width and height of images over what focal lengths and models say.
    fn sizes(&self) -> Vector2<f64> {
        let larger = 1.0 + self.focal_scale;
        Vector2::new(larger + self.aspect, larger - self.aspect)
    }

    /// The pose at which the camera, as it is said to be, would see a thing of center `center` (camera frame) as it does
    /// see it at `pose`: nearer where images are larger, and shifted. To first order in the thing's size over its distance, and but for
    /// its being wider than high.
    pub(crate) fn reprojected(
        &self,
        pose: &Isometry3<f64>,
        center: &Vector3<f64>,
    ) -> Isometry3<f64> {
        let larger = 1.0 + self.focal_scale;
        let z = center.z / larger;
        let wider = self.aspect / larger;
        let [right, below] = (self.principal_point * z).into();
        Translation3::new(right + wider * center.x, below - wider * center.y, z - center.z) * pose
    }

    /// Derivatives of the place of [`reprojected`](Self::reprojected): by the place of the pose, then by the parameters.
    pub(crate) fn reprojected_jacobian(&self, center: &Vector3<f64>) -> SMatrix<f64, 3, 9> {
        let larger = 1.0 + self.focal_scale;
        let z = center.z / larger;
        let wider = self.aspect / larger;
        let along = self.principal_point.push(1.0);
        let across = Vector3::new(center.x, -center.y, 0.0);
        let mut jacobian = SMatrix::<f64, 3, 9>::identity();
        jacobian[(0, 0)] += wider;
        jacobian[(1, 1)] -= wider;
        jacobian.set_column(2, &(along / larger));
        jacobian[(0, 5)] = z;
        jacobian[(1, 6)] = z;
        jacobian.set_column(7, &((along * z + across * wider) / -larger));
        jacobian.set_column(8, &(across / larger));
        jacobian
    }
}

#[cfg(test)]
mod tests {
    use prehend_autodiff::check::{compare_gradients, finite_difference_gradient};

    use super::*;

    fn some() -> CameraCalibrationError {
        CameraCalibrationError::default().changed(&[0.01, 2e-3, 3e-3, -1e-3, 4e-3, 2e-3])
    }

    /// Compares a Jacobian with finite differences of `f` at zero.
    fn check<const N: usize>(jacobian: &SMatrix<f64, 3, N>, f: impl Fn(&[f64]) -> Point3<f64>) {
        for row in 0..3 {
            let reference = finite_difference_gradient(|x: &[f64]| f(x)[row], &[0.0; N], 1e-6);
            let found: Vec<f64> = jacobian.row(row).iter().copied().collect();
            assert!(compare_gradients(&found, &reference).relative < 1e-6);
        }
    }

    #[test]
    fn points_apparent_poses_and_their_derivatives() {
        let (ray, depth) = (Vector2::new(0.1, -0.2), 0.5);
        let plain = CameraCalibrationError::default();
        assert_eq!(plain.point(&ray, depth), Point3::new(0.05, -0.1, 0.5));
        assert_eq!(plain.parameters(), [0.0; 6]);
        let pose = Isometry3::translation(0.03, -0.02, 0.4);
        let center = pose.translation.vector;
        for correction in [plain, some()] {
            let point = |x: &[f64]| correction.changed(x).point(&ray, depth);
            check(&correction.point_jacobian(&ray, depth), point);
            let apparent = |x: &[f64]| {
                let moved = center + Vector3::new(x[0], x[1], x[2]);
                let pose = Isometry3::from_parts(moved.into(), pose.rotation);
                let seen = correction.changed(&x[3..]).reprojected(&pose, &moved);
                seen.translation.vector.into()
            };
            check(&correction.reprojected_jacobian(&center), apparent);
        }
    }

    #[test]
    fn a_point_is_where_it_appears() {
        // What is at `reprojected` in the camera as it is said to be, is seen along the ray that the true one gives.
        let correction = CameraCalibrationError { depth_scale: 1.0, depth_bias: 0.0, ..some() };
        let place = Vector3::new(0.03, -0.02, 0.4);
        let at = correction.reprojected(&Isometry3::from(place), &place).translation.vector;
        let ray = Vector2::new(at.x / at.z, at.y / at.z);
        assert!((correction.point(&ray, place.z).coords - place).norm() < 1e-12);
    }
}
