//! Springs and dampers that are not linear.

use prehend_autodiff::Scalar;

use super::JointLaw;
use crate::contact::error::LawError;
use crate::contact::parameters::law_part;

law_part! {
    /// A spring with force −(a x + b x² + c x³) by its deflection x beyond the ends of a range, as MuJoCo's polynomial springs are.
    pub struct PolynomialSpring: "spring with a force of the third degree" {
        linear ["N m/rad or N/m"] Finite "a";
        quadratic ["N m/rad² or N/m²"] Finite "b";
        cubic ["N m/rad³ or N/m³"] Finite "c";
        lower ["rad or m"] Finite "position below which it pulls up";
        upper ["rad or m"] Finite "position above which it pulls down";
    }
    where in_order
}

fn in_order(&[.., lower, upper]: &[f64; 5]) -> Result<(), LawError> {
    super::in_order(lower, upper)
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

law_part! {
    /// A damper with force −(a v + b v|v| + c v³) by the rate v, as MuJoCo's polynomial dampers are.
    pub struct PolynomialDamper: "damper with a force of the third degree" {
        linear ["N m s/rad or N s/m"] Finite "a";
        quadratic ["N m s²/rad² or N s²/m²"] Finite "b";
        cubic ["N m s³/rad³ or N s³/m³"] Finite "c";
    }
}

impl JointLaw for PolynomialDamper {
    fn effort<S: Scalar>(&self, [a, b, c]: [S; 3], _: S, velocity: S) -> S {
        let size = velocity.abs();
        -(velocity * ((size * c + b) * size + a))
    }
}
