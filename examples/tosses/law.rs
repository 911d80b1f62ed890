//! A contact law made for the cube: every number of it may be identified.

use prehend::autodiff::Scalar;
use prehend::sim::{ContactForce, ContactKinematics, ContactLaw};

/// A normal force with hysteresis, N = k dⁿ (1 − c ḋ/√(ḋ² + s²)) for the depth d that falls at ḋ, so that restitution is the
/// same at all speeds above s, and friction whose coefficient changes with slip u and falls with load:
///
/// μ = (μ₀ + μ₁ u/(u + u₁)) (1 − a x), regularized by the slip scale v₀ + v₁ x, for x = N/(N + N₁).
///
/// Parameters: k \[N/mⁿ\], n, c, s \[m/s\], μ₀, μ₁, u₁ \[m/s\], v₀ \[m/s\], v₁ \[m/s\], a, N₁ \[N\].
pub(crate) struct CubeLaw(pub(crate) [f64; 11]);

/// Slip below which it has no direction \[m/s\].
const STILL: f64 = 1e-4;

impl ContactLaw for CubeLaw {
    fn params(&self) -> &[f64] {
        &self.0
    }

    fn law<S: Scalar>(&self, p: &[S], contact: &ContactKinematics<S>) -> ContactForce<S> {
        let depth = -contact.gap;
        if depth.value() <= 0.0 {
            return ContactForce::zero();
        }
        let speed = contact.normal_speed;
        let damped = S::one() - p[2] * speed / (speed * speed + p[3] * p[3]).sqrt();
        let normal = p[0] * depth.powf(p[1]) * damped.max(S::zero());
        let slip2 = contact.slip.dot(&contact.slip);
        let slip = slip2.plus(STILL * STILL).sqrt();
        let grown = p[4] + p[5] * slip / (slip + p[6]);
        let load = normal / (normal + p[10]);
        let slip_scale = p[7] + p[8] * load;
        let coefficient = grown * (S::one() - p[9] * load);
        let scale = -(coefficient * normal) / (slip2 + slip_scale * slip_scale).sqrt();
        ContactForce { normal, tangential: contact.slip * scale }
    }

    fn cutoff(&self) -> f64 {
        0.0
    }
}
