//! A spring that is slack over a range.

use prehend_autodiff::Scalar;

use super::JointLaw;
use crate::contact::error::LawError;
use crate::contact::parameters::law_part;

law_part! {
    /// A linear spring that pulls beyond the ends of a range only, as that of a tendon does: τ = −k d, d from the nearer end.
    pub struct SlackSpring: "spring that is slack over a range" {
        stiffness ["N m/rad or N/m"] NotNegative "effort per deflection";
        lower ["rad or m"] Finite "position below which it pulls up";
        upper ["rad or m"] Finite "position above which it pulls down";
    }
    where in_order
}

fn in_order(&[_, lower, upper]: &[f64; 3]) -> Result<(), LawError> {
    super::in_order(lower, upper)
}

impl JointLaw for SlackSpring {
    #[inline]
    fn effort<S: Scalar>(&self, [stiffness, lower, upper]: [S; 3], position: S, _: S) -> S {
        match position.value() {
            x if x < lower.value() => stiffness * (lower - position),
            x if x > upper.value() => stiffness * (upper - position),
            _ => S::zero(),
        }
    }

    fn is_passive(&self) -> bool {
        true
    }
}
