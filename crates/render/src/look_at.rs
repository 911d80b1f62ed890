//! Where a camera stands that looks at something.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

/// Pose base → camera (OpenCV's axes: x right, y down, z forward) of a camera at `eye` that looks at `target`, both in the base frame \[m\],
/// with the direction `up` (of any length from 1e-9 on) up in the image but for a turn by `roll` \[rad\] about the optical axis.
pub fn look_at(
    eye: &Point3<f64>,
    target: &Point3<f64>,
    up: &Vector3<f64>,
    roll: f64,
) -> Isometry3<f64> {
    let forward = in_range(&(target - eye)).try_normalize(1e-12).unwrap_or_else(Vector3::z);
    // Straight up or down, any direction serves as right.
    let right = forward
        .cross(&in_range(up))
        .try_normalize(1e-9)
        .or_else(|| forward.cross(&Vector3::x()).try_normalize(1e-6))
        .unwrap_or_else(|| forward.cross(&Vector3::y()).normalize());
    let down = forward.cross(&right);
    let rows = Matrix3::from_rows(&[right.transpose(), down.transpose(), forward.transpose()]);
    let upright = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rows));
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), roll) * upright;
    Isometry3::from_parts(Translation3::from(-(rotation * eye.coords)), rotation)
}

/// The vector, or a shorter one of its direction whose square is a number.
fn in_range(v: &Vector3<f64>) -> Vector3<f64> {
    if v.amax() > 1e150 { v / v.amax() } else { *v }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_camera_looks_at_its_target_with_the_world_upright() {
        let (eye, target) = (Point3::new(0.3, -0.2, 0.4), Point3::new(0.05, 0.01, 0.02));
        let up = Vector3::new(0.2, 0.1, 1.0);
        let pose = look_at(&eye, &target, &up, 0.0);
        let seen = pose * target;
        assert!(seen.x.abs() < 1e-12 && seen.y.abs() < 1e-12);
        assert!((seen.z - (target - eye).norm()).abs() < 1e-12);
        let up_seen = pose.rotation * up;
        assert!(up_seen.x.abs() < 1e-12 && up_seen.y < 0.0);
        let turned = look_at(&eye, &target, &up, 0.3).rotation * up;
        assert!((turned.x / -turned.y - 0.3f64.tan()).abs() < 1e-9);
        for straight in [Vector3::x(), Vector3::z(), -Vector3::y()] {
            let pose = look_at(&Point3::from(straight), &Point3::origin(), &straight, 0.0);
            assert!((pose * Point3::origin() - Point3::new(0.0, 0.0, 1.0)).norm() < 1e-12);
        }
    }
}
