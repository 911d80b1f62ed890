//! Friction laws: the force across the normal.

pub(crate) mod anisotropic;
pub(crate) mod bristle;
pub(crate) mod coulomb;
pub(crate) mod stribeck;

use nalgebra::Vector3;
use prehend_autodiff::Scalar;

use super::bristles::Bristles;
use super::parameters::Parameters;
use super::point::ContactKinematics;

/// Force across the normal: the other factor of a [`Law`](super::composite::Law).
pub trait FrictionLaw: Parameters {
    /// Force across the normal \[N\] of a contact pressed by `normal_force` \[N\], with parameters `p`.
    fn force<S: Scalar>(
        &self,
        p: Self::Params<S>,
        normal_force: S,
        contact: &ContactKinematics<S>,
    ) -> Vector3<S>;

    /// See [`ContactLaw::bristles`](super::law::ContactLaw::bristles).
    fn bristles(&self) -> Option<Bristles> {
        None
    }
}

/// A friction coefficient that may depend on the slip speed, regularized by √(|u|² + v_s²) for slip u and slip scale v_s.
pub trait FrictionCoefficient: Parameters {
    /// The coefficient at a regularized slip speed √(|u|² + v_s²) \[m/s\], with parameters `p`.
    fn coefficient<S: Scalar>(&self, p: Self::Params<S>, speed: S) -> S;

    /// Slip scale v_s, at which friction has 1/√2 of its bound \[m/s\], positive.
    fn slip_scale(&self) -> f64;

    /// The force of isotropic friction with this coefficient \[N\]: see [`regularized_coulomb`].
    #[inline]
    fn isotropic_force<S: Scalar>(
        &self,
        p: Self::Params<S>,
        normal_force: S,
        slip: &Vector3<S>,
    ) -> Vector3<S> {
        let coefficient = self.coefficient(p, regularized_speed(slip, self.slip_scale()));
        regularized_coulomb(coefficient, normal_force, slip, self.slip_scale())
    }
}

/// √(|slip|² + `slip_scale`²) \[m/s\]: smooth everywhere and never below |slip|.
#[inline]
pub(super) fn regularized_speed<S: Scalar>(slip: &Vector3<S>, slip_scale: f64) -> S {
    let [x, y, z] = [slip.x, slip.y, slip.z];
    (x * x + y * y + z * z + S::constant(slip_scale * slip_scale)).sqrt()
}

/// Friction force −μ f_n u/√(|u|² + v_s²) \[N\] for slip velocity u \[m/s\] and v_s = `slip_scale` > 0.
///
/// Its length is below μ f_n for every u; below v_s it acts like a viscous force (a body at rest on an
/// incline creeps at v_s tanθ/√(μ² − tan²θ)).
#[inline]
pub fn regularized_coulomb<S: Scalar>(
    coefficient: S,
    normal_force: S,
    slip: &Vector3<S>,
    slip_scale: f64,
) -> Vector3<S> {
    let scale = -(coefficient * normal_force) / regularized_speed(slip, slip_scale);
    Vector3::new(slip.x * scale, slip.y * scale, slip.z * scale)
}

#[cfg(test)]
mod tests {
    use prehend_autodiff::Fwd;

    use super::*;

    #[test]
    fn friction_stays_inside_the_cone_at_every_speed() {
        for exponent in -12..6 {
            let speed = 10f64.powi(exponent);
            let force = regularized_coulomb(0.5, 3.0, &Vector3::new(speed, 0.0, -speed), 1e-3);
            assert!(force.norm() <= 1.5 && force.x < 0.0 && force.z > 0.0);
        }
    }

    #[test]
    fn friction_at_rest_is_viscous_and_finite() {
        let [x, y, z] = Fwd::<3>::variables([0.0; 3]);
        let (mu, normal) = (Fwd::constant(0.5), Fwd::constant(2.0));
        let force = regularized_coulomb(mu, normal, &Vector3::new(x, y, z), 1e-2);
        assert_eq!(force.x.value, 0.0);
        assert!((force.x.derivative[0] + 100.0).abs() < 1e-12);
        assert_eq!(force.x.derivative[1], 0.0);
    }
}
