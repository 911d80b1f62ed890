//! Normal laws: the force along the normal.

pub(crate) mod approach_damped;
pub(crate) mod hertz;
pub(crate) mod hunt_crossley;
pub(crate) mod kelvin_voigt;

use prehend_autodiff::Scalar;

use super::parameters::Parameters;
use super::point::ContactKinematics;

/// Force along the normal: one factor of a [`Law`](super::composite::Law).
///
/// A law whose pressure is that of an exponential spring, with stick–slip friction:
///
/// ```
/// use prehend_autodiff::Scalar;
/// use prehend_sim::contact::{NormalLaw, Parameters, Stribeck};
/// use prehend_sim::{ContactKinematics, Law};
///
/// struct Exponential {
///     pressure: f64,
/// }
///
/// impl Parameters for Exponential {
///     type Params<T: Copy> = [T; 1];
///     fn values(&self) -> [f64; 1] {
///         [self.pressure]
///     }
/// }
///
/// impl NormalLaw for Exponential {
///     fn force<S: Scalar>(&self, [pressure]: [S; 1], contact: &ContactKinematics<S>) -> S {
///         pressure * (-contact.gap.times(1e3)).exp_m1() * contact.area
///     }
/// }
///
/// let friction =
///     Stribeck { friction: 0.5, kinetic_friction: 0.3, stribeck_speed: 1e-2, slip_scale: 1e-3 };
/// let law = Law::new(Exponential { pressure: 1e4 }, friction)?;
/// # Ok::<(), prehend_sim::contact::LawError>(())
/// ```
pub trait NormalLaw: Parameters {
    /// Force along the normal \[N\], never negative, with parameters `p`.
    fn force<S: Scalar>(&self, p: Self::Params<S>, contact: &ContactKinematics<S>) -> S;

    /// Beyond this gap value and derivative are zero \[m\].
    fn cutoff(&self) -> f64 {
        0.0
    }
}
