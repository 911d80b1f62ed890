//! Stiffness and damping from what one knows of a contact, and the time step they allow.

use nalgebra::{Matrix6, UnitQuaternion};
use thiserror::Error;

pub use super::restitution::{damping_ratio, restitution};
use super::wrench::WrenchJacobian;
use crate::body::RigidBody;

/// Stiffness per area K = m g/(δ A) \[N/m³\] at which a body of `mass` \[kg\] resting on `contact_area`
/// \[m²\] under `gravity` \[m/s²\] sinks in by `penetration` \[m\] (usually 0.2–1 mm).
pub fn stiffness_per_area(mass: f64, gravity: f64, penetration: f64, contact_area: f64) -> f64 {
    mass * gravity / (penetration * contact_area)
}

/// Damping per area D = 2ζ√(K m/A) \[N s/m³\] for a damping ratio ζ of a `mass` \[kg\] on
/// `contact_area` \[m²\] of `stiffness` per area \[N/m³\].
pub fn damping_per_area(mass: f64, stiffness: f64, contact_area: f64, ratio: f64) -> f64 {
    2.0 * ratio * (stiffness * mass / contact_area).sqrt()
}

/// A time step too long for the stiffness or damping of the contacts.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error("time step {dt} s is too long for these contacts: at most {limit} s")]
pub struct StepError {
    /// The time step \[s\].
    pub dt: f64,
    /// The longest step that resolves these contacts \[s\].
    pub limit: f64,
}

/// Checks dt·ω_max ≤ 1 (semi-implicit Euler diverges at 2) and the same for the damping rate, from the
/// contact stiffness and damping matrices of `contact` for `body` at `rotation`.
///
/// # Errors
/// With the longest step that passes.
pub fn check_time_step(
    body: &RigidBody,
    rotation: &UnitQuaternion<f64>,
    contact: &WrenchJacobian,
    dt: f64,
) -> Result<(), StepError> {
    let fastest = contact_frequency(body, rotation, contact);
    let ok = dt > 0.0 && dt * fastest <= 1.0;
    if ok { Ok(()) } else { Err(StepError { dt, limit: fastest.recip() }) }
}

/// The largest of the contact's natural frequency ω_max and damping rate \[1/s\]: of M⁻¹K and M⁻¹D,
/// with the symmetric parts of the contact's stiffness K and damping D.
pub fn contact_frequency(
    body: &RigidBody,
    rotation: &UnitQuaternion<f64>,
    contact: &WrenchJacobian,
) -> f64 {
    let mut inverse_root = Matrix6::identity() / body.mass().sqrt();
    let eigen = body.inverse_world_inertia(rotation).symmetric_eigen();
    let root = eigen.eigenvectors
        * nalgebra::Matrix3::from_diagonal(&eigen.eigenvalues.map(|x| x.max(0.0).sqrt()))
        * eigen.eigenvectors.transpose();
    inverse_root.fixed_view_mut::<3, 3>(3, 3).copy_from(&root);
    let largest = |m: &Matrix6<f64>| {
        let scaled = inverse_root * (m + m.transpose()) * inverse_root * -0.5;
        scaled.symmetric_eigenvalues().max().max(0.0)
    };
    largest(&contact.pose).sqrt().max(largest(&contact.velocity))
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

    use super::*;
    use crate::contact::wrench::contact_wrench_jacobian;
    use crate::fields::HalfSpace;
    use crate::{Onset, Penalty, State, SurfacePoint};

    #[test]
    fn frequency_of_a_point_mass_on_a_spring() {
        let body = RigidBody::new(0.5, Matrix3::identity(), Point3::origin()).unwrap();
        let law = Penalty::new(2e8, 1e3, 0.0, 1e-3).unwrap();
        let points = [SurfacePoint { position: Vector3::zeros(), area: 1e-4 }];
        let state = State::at_rest(&body, &Isometry3::translation(0.0, 0.0, -1e-3));
        let floor = HalfSpace::floor();
        let contact = contact_wrench_jacobian(&law, Onset::Hard, points.iter(), &state, &floor);
        let (rotation, omega) = (UnitQuaternion::identity(), 200.0);
        assert!((contact_frequency(&body, &rotation, &contact) - omega).abs() < 1e-9);
        assert_eq!(check_time_step(&body, &rotation, &contact, 4.9e-3), Ok(()));
        let error = check_time_step(&body, &rotation, &contact, 6e-3).unwrap_err();
        assert!((error.limit - 5e-3).abs() < 1e-12);
    }
}
