//! Scenes that stand upright in a viewer.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// The rotation of a frame into that of glTF, in which `up` becomes y, and `forward`, as far as it is level, −z: what cameras look along there.
///
/// Any direction is level enough where `forward` is upright itself, or one of them has no direction.
pub(super) fn upright(up: &Vector3<f64>, forward: &Vector3<f64>) -> UnitQuaternion<f64> {
    let y = up.try_normalize(0.0).unwrap_or_else(Vector3::y);
    let level = |v: &Vector3<f64>| (v - y * y.dot(v)).try_normalize(1e-6 * v.norm());
    let mut back = [-forward, Vector3::x(), Vector3::z()].into_iter().filter_map(|v| level(&v));
    let z = back.next().unwrap_or_else(Vector3::z);
    let rows = [y.cross(&z).transpose(), y.transpose(), z.transpose()];
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(Matrix3::from_rows(
        &rows,
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn up_is_y_and_forward_is_as_level_as_can_be() {
        let (up, forward) = (Vector3::new(0.1, -9.0, -2.0), Vector3::z());
        let turn = upright(&up, &forward);
        assert!((turn * up - Vector3::y() * up.norm()).norm() < 1e-12);
        let ahead = turn * forward;
        assert!(ahead.x.abs() < 1e-12 && ahead.z < -0.9, "{ahead}");
        // A camera that looks down.
        let turn = upright(&-Vector3::z(), &Vector3::z());
        assert!((turn * -Vector3::z() - Vector3::y()).norm() < 1e-12);
        assert!(upright(&Vector3::zeros(), &Vector3::y()).into_inner().norm().is_finite());
    }
}
