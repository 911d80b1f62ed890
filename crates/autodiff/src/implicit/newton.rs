//! Newton's method, to find solutions with.

use nalgebra::{DMatrix, DVector, Dyn, LU};

use super::linearization::{check_length, jacobian};
use super::{ImplicitError, Residual};
use crate::solve::SolveError;

const MOST_ITERATIONS: usize = 60;

/// Shortest fraction of a Newton step.
const SHORTEST: f64 = 1e-6;

/// How much a shortened step has to lower the size of the residual, as a share of what a linear equation would (Armijo).
const DECREASE: f64 = 1e-4;

/// A Newton step so short, absolute and relative to the largest unknown, is the last: convergence is quadratic, so that what
/// is left after it is rounding.
const LAST: (f64, f64) = (1e-10, 1e-9);

/// So many times the last step is as near as rounding may let it come.
const ROUNDING: f64 = 1e3;

/// As many equations F(x) = 0 as unknowns, for [`newton_on`].
pub trait Equations {
    /// F(x).
    fn residual(&self, x: &DVector<f64>) -> DVector<f64>;

    /// F(x) and ∂F/∂x.
    fn linearize(&self, x: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>);

    /// The size of a residual, which every step has to lower. Without a unit that all equations share it is the length of
    /// the Newton step J⁻¹F, `jacobian` being factorized where the step began: a measure that does not depend on the
    /// units of F (P. Deuflhard, "Newton methods for nonlinear problems", 2004, chapter 3).
    fn size(&self, residual: &DVector<f64>, jacobian: &LU<f64, Dyn, Dyn>) -> f64 {
        jacobian.solve(residual).map_or(f64::INFINITY, |step| step.norm())
    }
}

/// Solves F(x, p) = 0 by Newton's method from `start`.
///
/// A step is halved until what is left of the equations gets smaller ([`Equations::size`]). Lengths are Euclidean, so
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
    check_length(start, equation.residual(start, p).len())?;
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

    fn linearize(&self, x: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>) {
        (self.residual(x), jacobian(self.equation, x.as_slice(), self.p))
    }
}

/// Solves `equations` by Newton's method from `x`, as [`newton`] does, with a Jacobian and a measure of one's own.
///
/// # Errors
/// If a Jacobian is singular, a number is not finite, or no step makes the residual smaller.
pub fn newton_on(
    equations: &impl Equations,
    mut x: DVector<f64>,
) -> Result<DVector<f64>, ImplicitError> {
    let mut iterations = 0;
    if x.is_empty() {
        return Ok(x);
    }
    loop {
        let (residual, jacobian) = equations.linearize(&x);
        let factors = jacobian.lu();
        let Some(step) = factors.solve(&-&residual) else {
            return Err(SolveError::Singular { condition: f64::INFINITY }.into());
        };
        if !step.iter().all(|step| step.is_finite()) {
            return Err(SolveError::NotFinite("Newton step").into());
        }
        let last = LAST.0 + LAST.1 * x.amax();
        if step.amax() <= last {
            return Ok(x + step);
        }
        let size = equations.size(&residual, &factors);
        let shortened = |fraction: f64| {
            let next = equations.residual(&(&x + &step * fraction));
            let lower = equations.size(&next, &factors) <= (1.0 - DECREASE * fraction) * size;
            lower.then_some((fraction, next))
        };
        let mut fractions = std::iter::successors(Some(1.0), |fraction| Some(0.5 * fraction))
            .take_while(|fraction| *fraction >= SHORTEST);
        iterations += 1;
        let (fraction, next) = match fractions.find_map(shortened) {
            Some(found) if iterations < MOST_ITERATIONS => found,
            _ if step.amax() <= ROUNDING * last => return Ok(x),
            _ => {
                let (residual, step) = (residual.norm(), step.norm());
                return Err(ImplicitError::NotConverged { iterations, residual, step });
            }
        };
        x += step * fraction;
        // The old Jacobian is near enough to tell, and to take, a step shorter still.
        if let Some(step) = factors.solve(&-next)
            && step.amax() <= 1e-2 * last
        {
            return Ok(x + step);
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
