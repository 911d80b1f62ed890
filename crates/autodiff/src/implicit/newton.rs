//! Newton's method, to find solutions with.

use nalgebra::DVector;

use super::linearization::{check_length, linearize};
use super::{ImplicitError, Residual};
use crate::solve::{Factored, lu};

const MOST_ITERATIONS: usize = 60;

/// Shortest fraction of a Newton step.
const SHORTEST: f64 = 1e-6;

/// Error of an unknown, absolute and relative, that the last step may take away: convergence is quadratic, so that what is left
/// after it is rounding.
const LAST: (f64, f64) = (1e-12, 1e-9);

/// So many times that error is as near as rounding may let it come: what [`solution`](super::solution) tolerates.
const ROUNDING: f64 = 1e3;

/// As many equations F(x) = 0 as unknowns, for [`newton_on`].
pub trait Equations {
    /// F(x).
    fn residual(&self, x: &DVector<f64>) -> DVector<f64>;

    /// F(x) and ∂F/∂x, factorized.
    ///
    /// # Errors
    /// If there are not as many equations as unknowns, or the Jacobian is singular or not finite.
    fn linearize(&self, x: &DVector<f64>) -> Result<(DVector<f64>, Factored<f64>), ImplicitError>;

    /// The norm of a residual in a unit that all equations share, if there is one. A step then has to lower it (Armijo's
    /// condition); without one, the length of the next Newton step with the same Jacobian, which does not depend on the
    /// units of F (P. Deuflhard, "Newton methods for nonlinear problems", 2004, chapter 3).
    fn norm(&self, _residual: &DVector<f64>) -> Option<f64> {
        None
    }

    /// The error `step` of `x` in multiples of what the last step may take away: by default 10⁻⁹ of each unknown plus 10⁻¹²
    /// (in its unit).
    fn error(&self, x: &DVector<f64>, step: &DVector<f64>) -> f64 {
        let excess = |(x, step): (&f64, &f64)| step.abs() / (LAST.0 + LAST.1 * x.abs());
        x.iter().zip(step).map(excess).fold(0.0, f64::max)
    }
}

/// Solves F(x, p) = 0 by Newton's method from `start`.
///
/// A step is halved until the next one, with the same Jacobian, gets shorter: see [`Equations::norm`]. Lengths are Euclidean, so
/// unknowns of very different size are better scaled by the caller.
///
/// # Errors
/// If F does not have as many components as there are unknowns, cannot be linearized where the iteration
/// takes it, or no solution was found.
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
    let x = newton_on(&At { equation, p }, DVector::from_column_slice(start))?;
    Ok(x.as_slice().to_vec())
}

/// An equation at fixed parameters.
struct At<'a, R> {
    equation: &'a R,
    p: &'a [f64],
}

impl<R: Residual> Equations for At<'_, R> {
    fn residual(&self, x: &DVector<f64>) -> DVector<f64> {
        DVector::from_vec(self.equation.residual(x.as_slice(), self.p))
    }

    fn linearize(&self, x: &DVector<f64>) -> Result<(DVector<f64>, Factored<f64>), ImplicitError> {
        let (residual, jacobian) = linearize(self.equation, x.as_slice(), self.p);
        check_length(x.as_slice(), residual.len())?;
        Ok((DVector::from_vec(residual), lu(&jacobian)?))
    }
}

/// Solves `equations` by Newton's method from `x`, as [`newton`] does, with a Jacobian and a measure of one's own.
///
/// # Errors
/// If residual or Jacobian are of another size than the unknowns, the Jacobian is singular, a number is not finite, or no step
/// makes the residual smaller.
pub fn newton_on(
    equations: &impl Equations,
    mut x: DVector<f64>,
) -> Result<DVector<f64>, ImplicitError> {
    let mut iterations = 0;
    loop {
        let (residual, jacobian) = equations.linearize(&x)?;
        check_length(x.as_slice(), residual.len())?;
        if jacobian.size() != x.len() {
            let (unknowns, found) = (x.len(), jacobian.size());
            return Err(ImplicitError::Jacobian { unknowns, found });
        }
        if x.is_empty() {
            return Ok(x);
        }
        let step = -jacobian.solve(&residual)?;
        let error = equations.error(&x, &step);
        if error <= 1.0 {
            return Ok(x + step);
        }
        let norm = equations.norm(&residual);
        let shortened = |fraction: f64| {
            let next = equations.residual(&(&x + &step * fraction));
            let lower = match norm {
                Some(norm) => equations.norm(&next)? <= (1.0 - 1e-4 * fraction) * norm,
                None => jacobian.solve(&next).ok()?.norm() <= (1.0 - 0.5 * fraction) * step.norm(),
            };
            lower.then_some((fraction, next))
        };
        let mut fractions = std::iter::successors(Some(1.0), |fraction| Some(0.5 * fraction))
            .take_while(|fraction| *fraction >= SHORTEST);
        iterations += 1;
        let (fraction, next) = match fractions.find_map(shortened) {
            Some(found) if iterations < MOST_ITERATIONS => found,
            _ if error <= ROUNDING => return Ok(x),
            _ => {
                let (residual, step) = (residual.norm(), step.norm());
                return Err(ImplicitError::NotConverged { iterations, residual, step });
            }
        };
        x += step * fraction;
        // The old Jacobian is near enough to tell, and to take, a step shorter still.
        if let Ok(step) = jacobian.solve(&next)
            && equations.error(&x, &step) <= 1e-2
        {
            return Ok(x - step);
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

    /// x₀ = p, x₁² = 10⁻⁸: unknowns of very different size.
    struct Apart;

    impl Residual for Apart {
        fn residual<S: Scalar>(&self, x: &[S], p: &[S]) -> Vec<S> {
            vec![x[0] - p[0], x[1] * x[1] - S::constant(1e-8)]
        }
    }

    #[test]
    fn a_large_unknown_excuses_no_small_one() {
        for p in [1.0, 1e5, 1e7] {
            let x = newton(&Apart, &[p, 1.0], &[p]).unwrap();
            assert!((x[1] - 1e-4).abs() < 1e-12, "{x:?}");
            assert!(crate::implicit::solution(Apart, &x, &[p]).is_ok());
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
