//! A contact point as a law sees it, and what the law answers.

use nalgebra::Vector3;
use prehend_autodiff::Scalar;

/// One contact point. Vectors are along the axes of the body frame of the body with the field; under symmetric contact each
/// direction has the axes of its own field's body.
#[derive(Clone, Copy, Debug)]
pub struct ContactKinematics<S: Scalar> {
    /// Effective gap after the [`GapSmoothing`](super::gap_smoothing::GapSmoothing) \[m\], at most the law's cutoff;
    /// negative in penetration.
    pub gap: S,
    /// Rate of the effective gap \[m/s\], negative while approaching. The smoothing scales it too, so that damping fades in with
    /// contact and is zero without.
    pub normal_speed: S,
    /// Velocity of the sample relative to the body with the field, across the normal \[m/s\].
    pub slip: Vector3<S>,
    /// Unit normal, out of the body with the field.
    pub normal: Vector3<S>,
    /// Surface area that the sample stands for \[m²\]; it has derivatives by the dimensions of a shape.
    pub area: S,
}

/// Force on the body with the sample at one contact point, along the axes of its [`ContactKinematics`].
#[derive(Clone, Copy, Debug)]
pub struct ContactForce<S: Scalar> {
    /// Force along the normal \[N\]; positive pushes the body out.
    pub normal: S,
    /// Force across the normal \[N\].
    pub tangential: Vector3<S>,
}

impl<S: Scalar> ContactForce<S> {
    /// No force.
    #[inline]
    pub fn zero() -> Self {
        Self { normal: S::zero(), tangential: Vector3::zeros() }
    }

    /// Force as one vector, for the unit `normal`.
    #[inline(always)]
    pub(crate) fn along(&self, normal: &Vector3<S>) -> Vector3<S> {
        normal * self.normal + self.tangential
    }

    /// A force that is not a number. Never inlined: that costs the laws here up to 5 % of their instructions.
    #[cold]
    #[inline(never)]
    pub fn nan() -> Self {
        let nan = S::constant(f64::NAN);
        Self { normal: nan, tangential: Vector3::repeat(nan) }
    }
}
