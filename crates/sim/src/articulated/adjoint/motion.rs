//! Terms of adjoints of motions.

use nalgebra::{Vector3, Vector6};

use super::inputs::LinkAdjoint;
use crate::articulated::kinematics::Kinematics;
use crate::spatial::{angular, linear};

/// Adjoints of a link's motions, and of those of all that hangs on it: forces about the origin.
#[derive(Clone, Copy, Default)]
pub(super) struct Force {
    pub(super) velocity: Vector6<f64>,
    pub(super) acceleration: Vector6<f64>,
    pub(super) motion: Vector6<f64>,
    /// Along a turn: forces on links keep their direction.
    pub(super) turn: Vector3<f64>,
}

impl std::ops::AddAssign for Force {
    fn add_assign(&mut self, other: Self) {
        self.velocity += other.velocity;
        self.acceleration += other.acceleration;
        self.motion += other.motion;
        self.turn += other.turn;
    }
}

/// Adds `factor` times the derivative of m·(I n) by mass, center of mass and inertia of a link, for two motions.
pub(super) fn mass_adjoint(
    at: &Kinematics<'_>,
    link: usize,
    motions: [&Vector6<f64>; 2],
    factor: f64,
    adjoint: &mut LinkAdjoint,
) {
    let rotation = &at.rotations[link];
    let body = &at.tree.links()[link];
    let center = at.places[link] + rotation * body.com.coords;
    let [(m, a), (n, b)] = motions.map(|motion| {
        let spin = angular(motion);
        let velocity = linear(motion) + spin.cross(&center);
        (rotation.tr_mul(&velocity), rotation.tr_mul(&spin))
    });
    adjoint.mass += factor * m.dot(&n);
    adjoint.com += (n.cross(&a) + m.cross(&b)) * (factor * body.mass);
    adjoint.inertia += a * b.transpose() * factor;
}
