//! The ends of a joint's range.

use prehend_autodiff::Scalar;

use super::JointLaw;
use crate::contact::error::LawError;
use crate::contact::parameters::law_part;

law_part! {
    /// Stops at both ends of a range: a spring that pushes back by the depth d beyond, damped in proportion to its load as
    /// [`HuntCrossley`](crate::HuntCrossley) is, so that it begins without a jump: τ = ±k d max(0, 1 + c ḋ). No joint has limits
    /// without it.
    pub struct JointLimits: "stops at the ends of a range" {
        lower ["rad or m"] Finite "least position";
        upper ["rad or m"] Finite "largest position";
        stiffness ["N m/rad or N/m"] NotNegative "effort per depth beyond";
        damping ["s/rad or s/m"] NotNegative "share of effort per speed";
    }
    where in_order
}

fn in_order(&[lower, upper, ..]: &[f64; 4]) -> Result<(), LawError> {
    super::in_order(lower, upper)
}

impl JointLaw for JointLimits {
    #[inline]
    fn effort<S: Scalar>(&self, p: [S; 4], position: S, velocity: S) -> S {
        let [lower, upper, stiffness, damping] = p;
        let pushed = |depth: S, speed: S| {
            let load = S::one() + damping * speed;
            if depth.value() > 0.0 && load.value() > 0.0 {
                stiffness * depth * load
            } else {
                S::zero()
            }
        };
        pushed(lower - position, -velocity) - pushed(position - upper, velocity)
    }

    fn is_passive(&self) -> bool {
        true
    }
}
