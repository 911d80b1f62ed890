//! Laws that act beyond the ends of a range: limits, and springs that are slack within it.

use prehend_autodiff::Scalar;

use super::JointLaw;
use crate::contact::error::LawError;
use crate::contact::parameters::law_part;

/// Checks that the ends of a range are in order.
fn in_order(lower: f64, upper: f64) -> Result<(), LawError> {
    let (name, range) = ("upper", "no less than lower");
    if lower <= upper { Ok(()) } else { Err(LawError::Range { name, range, value: upper }) }
}

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
    where in_order(lower, upper)
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

law_part! {
    /// A linear spring that pulls beyond the ends of a range only, as that of a tendon does: τ = −k d, d from the nearer end.
    pub struct SlackSpring: "spring that is slack over a range" {
        stiffness ["N m/rad or N/m"] NotNegative "effort per deflection";
        lower ["rad or m"] Finite "position below which it pulls up";
        upper ["rad or m"] Finite "position above which it pulls down";
    }
    where in_order(lower, upper)
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

law_part! {
    /// A spring with force −(a x + b x² + c x³) by its deflection x beyond the ends of a range, as MuJoCo's polynomial springs are.
    pub struct PolynomialSpring: "spring with a force of the third degree" {
        linear ["N m/rad or N/m"] Finite "a";
        quadratic ["N m/rad² or N/m²"] Finite "b";
        cubic ["N m/rad³ or N/m³"] Finite "c";
        lower ["rad or m"] Finite "position below which it pulls up";
        upper ["rad or m"] Finite "position above which it pulls down";
    }
    where in_order(lower, upper)
}

impl JointLaw for PolynomialSpring {
    fn effort<S: Scalar>(&self, [a, b, c, low, high]: [S; 5], position: S, _: S) -> S {
        let x = match position.value() {
            x if x < low.value() => position - low,
            x if x > high.value() => position - high,
            _ => return S::zero(),
        };
        -(x * ((x * c + b) * x + a))
    }

    fn is_passive(&self) -> bool {
        true
    }
}
