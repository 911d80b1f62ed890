//! Origin tags of a URDF.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::{Result, RobotError};

/// Refuses numbers that are not finite.
pub(super) fn finite(
    owner: &dyn Fn() -> String,
    field: &'static str,
    numbers: &[f64],
) -> Result<()> {
    if numbers.iter().all(|x| x.is_finite()) {
        return Ok(());
    }
    Err(RobotError::Number { owner: owner(), field, requirement: "must be finite" })
}

/// An origin tag: URDF's roll, pitch and yaw turn about the fixed axes x, y and z in this order.
pub(super) fn isometry(owner: &dyn Fn() -> String, pose: &urdf_rs::Pose) -> Result<Isometry3<f64>> {
    finite(owner, "origin xyz", &pose.xyz.0)?;
    finite(owner, "origin rpy", &pose.rpy.0)?;
    let [roll, pitch, yaw] = pose.rpy.0;
    Ok(Isometry3::from_parts(
        Translation3::from(Vector3::from(pose.xyz.0)),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    ))
}
