//! A solver to find solutions with.

use super::linearization::{Linearization, newton_step};
use super::{ImplicitError, Residual};

const MOST_ITERATIONS: usize = 100;

/// Shortest fraction of a Newton step.
const SHORTEST: f64 = 1e-6;

/// What is left of the tolerance of [`solution`](super::solution) before the last step, which then is
/// exact to rounding where convergence is quadratic.
const BEFORE_LAST: f64 = 1e-3;

/// Solves F(x, p) = 0 by Newton's method from `start`.
///
/// A step is halved until the next one, with the same Jacobian, gets shorter: a test that does not depend
/// on the units of F (P. Deuflhard, "Newton methods for nonlinear problems", 2004, chapter 3). Lengths are
/// Euclidean, so unknowns of very different size are better scaled by the caller.
///
/// # Errors
/// If F does not have as many components as there are unknowns, cannot be linearized where the iteration
/// takes it, or no solution was found to the tolerance of [`solution`](super::solution).
///
/// # Examples
/// ```
/// use prehend_autodiff::Scalar;
/// use prehend_autodiff::implicit::{ImplicitError, Residual, newton};
///
/// struct SquareRoot;
/// impl Residual for SquareRoot {
///     fn residual<S: Scalar>(&self, x: &[S], p: &[S]) -> Vec<S> {
///         vec![x[0] * x[0] - p[0]]
///     }
/// }
///
/// assert_eq!(newton(&SquareRoot, &[1.0], &[9.0])?, [3.0]);
/// # Ok::<(), ImplicitError>(())
/// ```
pub fn newton(
    equation: &impl Residual,
    start: &[f64],
    p: &[f64],
) -> Result<Vec<f64>, ImplicitError> {
    let mut x = start.to_vec();
    let mut iterations = 0;
    loop {
        let at = Linearization::new(equation, &x, p)?;
        let excess = at.worst(&x).map_or(0.0, |(_, excess)| excess);
        let moved = |fraction: f64| -> Vec<f64> {
            x.iter().zip(&at.step).map(|(x, step)| x + fraction * step).collect()
        };
        if excess <= BEFORE_LAST {
            return Ok(moved(1.0));
        }
        let length = at.step.norm();
        let shortens = |fraction: &f64| {
            newton_step(equation, &at.jacobian, &moved(*fraction), p)
                .is_ok_and(|next| next.norm() <= (1.0 - 0.5 * fraction) * length)
        };
        let mut fractions = std::iter::successors(Some(1.0), |fraction| Some(0.5 * fraction))
            .take_while(|fraction| *fraction >= SHORTEST);
        iterations += 1;
        match fractions.find(shortens) {
            Some(fraction) if iterations < MOST_ITERATIONS => x = moved(fraction),
            // As near as rounding lets it come.
            _ if excess <= 1.0 => return Ok(x),
            _ => return Err(ImplicitError::NotConverged { iterations, step: length }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scalar;
    use crate::solve::SolveError;

    /// atan(x − p) = 0: full Newton steps from far away run off.
    struct Arctangent;

    impl Residual for Arctangent {
        fn residual<S: Scalar>(&self, x: &[S], p: &[S]) -> Vec<S> {
            x.iter().map(|&x| (x - p[0]).atan()).collect()
        }
    }

    /// x² + 1 = 0, one equation whatever the number of unknowns.
    struct NoRoot;

    impl Residual for NoRoot {
        fn residual<S: Scalar>(&self, x: &[S], _: &[S]) -> Vec<S> {
            vec![x.iter().fold(S::one(), |sum, &x| sum + x * x)]
        }
    }

    #[test]
    fn damping_brings_far_starts_home() {
        for start in [0.5, 3.0, -40.0, 1e5] {
            let x = newton(&Arctangent, &[start, 1.0], &[0.25]).unwrap();
            assert!(x.iter().all(|x| (x - 0.25).abs() < 1e-15), "{start}: {x:?}");
        }
    }

    #[test]
    fn what_has_no_solution_is_an_error() {
        let refused = newton(&NoRoot, &[0.7], &[]).unwrap_err();
        assert!(matches!(refused, ImplicitError::NotConverged { .. }), "{refused}");
        let refused = newton(&NoRoot, &[0.0], &[]).unwrap_err();
        assert!(matches!(refused, ImplicitError::Solve(SolveError::Singular { .. })), "{refused}");
        assert!(newton(&NoRoot, &[], &[]).is_err());
        assert!(newton(&NoRoot, &[1.0, 2.0], &[]).is_err());
        assert!(newton(&Arctangent, &[f64::NAN], &[0.0]).is_err());
    }

    #[test]
    fn no_unknowns_are_solved_at_once() {
        assert!(newton(&Arctangent, &[], &[0.0]).unwrap().is_empty());
    }
}
