//! Classics that the tests of all the methods share, after J. J. Moré, B. S. Garbow, K. E. Hillstrom,
//! "Testing unconstrained optimization software", 1981.

use crate::Scalar;

/// Residuals of Rosenbrock's curved valley; zero at (1, 1).
pub(super) fn rosenbrock<S: Scalar>(x: &[S]) -> Vec<S> {
    vec![(x[1] - x[0] * x[0]) * S::constant(10.0), S::one() - x[0]]
}

/// Residuals of Powell's singular function; zero at the origin, where their Jacobian has rank 2.
pub(super) fn powell<S: Scalar>(x: &[S]) -> Vec<S> {
    let (a, b) = (x[1] - x[2] * S::constant(2.0), x[0] - x[3]);
    vec![
        x[0] + x[1] * S::constant(10.0),
        (x[2] - x[3]) * S::constant(5.0_f64.sqrt()),
        a * a,
        b * b * S::constant(10.0_f64.sqrt()),
    ]
}

/// Residuals of Meyer's thermistor, three parameters of magnitudes 10⁻², 10⁴ and 10²; at best
/// ‖r‖² = 87.9458.
pub(super) fn meyer<S: Scalar>(x: &[S]) -> Vec<S> {
    const OHMS: [f64; 16] = [
        34780.0, 28610.0, 23650.0, 19630.0, 16370.0, 13720.0, 11540.0, 9744.0, 8261.0, 7030.0,
        6005.0, 5147.0, 4427.0, 3820.0, 3307.0, 2872.0,
    ];
    (1..)
        .zip(OHMS)
        .map(|(i, ohms)| {
            let celsius = S::constant(45.0 + 5.0 * f64::from(i));
            x[0] * (x[1] / (celsius + x[2])).exp() - S::constant(ohms)
        })
        .collect()
}

/// ½‖r‖².
pub(super) fn half_square<S: Scalar>(residuals: Vec<S>) -> S {
    residuals.into_iter().fold(S::zero(), |sum, r| sum + r * r) * S::constant(0.5)
}
