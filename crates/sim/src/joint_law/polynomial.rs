//! Springs and dampers that are not linear.

use prehend_autodiff::Scalar;

use super::JointLaw;
use crate::contact::parameters::Parameters;

/// A spring with force −(a x + b x² + c x³) by its deflection x beyond the ends of a range, as MuJoCo's polynomial springs are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PolynomialSpring {
    /// a, b and c.
    pub coefficients: [f64; 3],
    /// The positions between which it is slack.
    pub slack: [f64; 2],
}

impl Parameters for PolynomialSpring {
    type Params<T: Copy> = [T; 0];

    fn values(&self) -> [f64; 0] {
        []
    }

    fn names(&self) -> Vec<&'static str> {
        Vec::new()
    }
}

impl JointLaw for PolynomialSpring {
    fn effort<S: Scalar>(&self, _: [S; 0], position: S, _: S) -> S {
        let [low, high] = self.slack;
        let x = match position.value() {
            value if value < low => position.plus(-low),
            value if value > high => position.plus(-high),
            _ => return S::zero(),
        };
        let [a, b, c] = self.coefficients;
        -(x * ((x.times(c).plus(b)) * x).plus(a))
    }

    fn is_passive(&self) -> bool {
        true
    }
}

/// A damper with force −(a v + b v|v| + c v³) by the rate v, as MuJoCo's polynomial dampers are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PolynomialDamper {
    /// a, b and c.
    pub coefficients: [f64; 3],
}

impl Parameters for PolynomialDamper {
    type Params<T: Copy> = [T; 0];

    fn values(&self) -> [f64; 0] {
        []
    }

    fn names(&self) -> Vec<&'static str> {
        Vec::new()
    }
}

impl JointLaw for PolynomialDamper {
    fn effort<S: Scalar>(&self, _: [S; 0], _: S, velocity: S) -> S {
        let [a, b, c] = self.coefficients;
        let size = velocity.abs();
        -(velocity * ((size.times(c).plus(b)) * size).plus(a))
    }
}
