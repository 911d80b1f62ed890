//! Newton's method, to find solutions with.

use nalgebra::DVector;

use super::ImplicitError;
use crate::solve::Factored;

const MOST_ITERATIONS: usize = 60;

/// Shortest fraction of a Newton step.
const SHORTEST: f64 = 1e-6;

/// Error of an unknown, absolute and relative, that the last step may take away: convergence is quadratic, so that what is left
/// after it is rounding.
const LAST: (f64, f64) = (1e-12, 1e-9);

/// So many times that error is as near as rounding may let it come.
const ROUNDING: f64 = 1e3;

/// As many equations F(x) = 0 as unknowns, for [`newton`].
pub trait Equations {
    /// F(x).
    fn residual(&self, x: &DVector<f64>) -> DVector<f64>;

    /// F(x) and ∂F/∂x, factorized.
    ///
    /// # Errors
    /// If there are not as many equations as unknowns, or the Jacobian is singular or not finite.
    fn linearize(&self, x: &DVector<f64>) -> Result<(DVector<f64>, Factored), ImplicitError>;

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

/// Solves F(x) = 0 by Newton's method from `x`.
///
/// A step is halved until the next one, with the same Jacobian, gets shorter: see [`Equations::norm`]. Lengths are Euclidean, so
/// unknowns of very different size are better scaled by the caller.
///
/// # Errors
/// If residual or Jacobian are of another size than the unknowns, the Jacobian is singular, a number is not finite, or no step
/// makes the residual smaller.
pub fn newton(
    equations: &impl Equations,
    mut x: DVector<f64>,
) -> Result<DVector<f64>, ImplicitError> {
    let mut iterations = 0;
    loop {
        let (residual, jacobian) = equations.linearize(&x)?;
        let unknowns = x.len();
        if residual.len() != unknowns {
            return Err(ImplicitError::Equations { unknowns, found: residual.len() });
        }
        if jacobian.size() != unknowns {
            return Err(ImplicitError::Jacobian { unknowns, found: jacobian.size() });
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
    use nalgebra::{ComplexField, DMatrix};

    use super::*;
    use crate::solve::{SolveError, lu};
    use crate::{Fwd, Scalar, forward_jacobian};

    fn at(x: &[f64]) -> DVector<f64> {
        DVector::from_column_slice(x)
    }

    /// Equations of the numbers in a slice.
    struct Written<F>(F);

    impl<F: Fn(&[Fwd<2>]) -> Vec<Fwd<2>>> Equations for Written<F> {
        fn residual(&self, x: &DVector<f64>) -> DVector<f64> {
            let x: Vec<Fwd<2>> = x.iter().map(|x| Fwd::constant(*x)).collect();
            DVector::from_vec((self.0)(&x).into_iter().map(|f| f.value).collect())
        }

        fn linearize(&self, x: &DVector<f64>) -> Result<(DVector<f64>, Factored), ImplicitError> {
            let (residual, jacobian): (_, DMatrix<f64>) = forward_jacobian(&self.0, x.as_slice());
            Ok((DVector::from_vec(residual), lu(&jacobian)?))
        }
    }

    /// atan(x − ¼) = 0: full Newton steps from far away run off.
    fn arctangent(x: &[Fwd<2>]) -> Vec<Fwd<2>> {
        x.iter().map(|x| x.plus(-0.25).atan()).collect()
    }

    /// x² + 1 = 0, one equation whatever the number of unknowns.
    fn no_root(x: &[Fwd<2>]) -> Vec<Fwd<2>> {
        vec![x.iter().fold(Fwd::constant(1.0), |sum, &x| sum + x * x)]
    }

    #[test]
    fn damping_brings_far_starts_home() {
        for start in [0.5, 3.0, -40.0, 1e5] {
            let x = newton(&Written(arctangent), at(&[start, 1.0])).unwrap();
            assert!(x.iter().all(|x| (x - 0.25).abs() < 1e-15), "{start}: {x:?}");
        }
    }

    #[test]
    fn a_large_unknown_excuses_no_small_one() {
        for p in [1.0, 1e5, 1e7] {
            let apart = |x: &[Fwd<2>]| vec![x[0].plus(-p), (x[1] * x[1]).plus(-1e-8)];
            let x = newton(&Written(apart), at(&[p, 1.0])).unwrap();
            assert!((x[1] - 1e-4).abs() < 1e-12, "{x:?}");
        }
    }

    #[test]
    fn what_has_no_solution_is_an_error() {
        let refused = newton(&Written(no_root), at(&[0.7])).unwrap_err();
        assert!(matches!(refused, ImplicitError::NotConverged { .. }), "{refused}");
        let refused = newton(&Written(no_root), at(&[0.0])).unwrap_err();
        assert!(matches!(refused, ImplicitError::Solve(SolveError::Singular { .. })), "{refused}");
        assert!(newton(&Written(no_root), at(&[])).is_err());
        assert!(newton(&Written(no_root), at(&[1.0, 2.0])).is_err());
        assert!(newton(&Written(arctangent), at(&[f64::NAN])).is_err());
    }

    #[test]
    fn the_numbers_of_equations_and_unknowns_must_agree() {
        /// Answers of sizes of their own.
        struct Sized(usize, usize);
        impl Equations for Sized {
            fn residual(&self, _: &DVector<f64>) -> DVector<f64> {
                DVector::zeros(self.0)
            }
            fn linearize(
                &self,
                x: &DVector<f64>,
            ) -> Result<(DVector<f64>, Factored), ImplicitError> {
                Ok((self.residual(x), lu(&DMatrix::identity(self.1, self.1))?))
            }
        }
        let refused = newton(&Sized(1, 2), at(&[3.0, 4.0]));
        assert_eq!(refused, Err(ImplicitError::Equations { unknowns: 2, found: 1 }));
        let refused = newton(&Sized(2, 1), at(&[3.0, 4.0]));
        assert_eq!(refused, Err(ImplicitError::Jacobian { unknowns: 2, found: 1 }));
    }

    #[test]
    fn roots_are_found_or_refused_wherever_it_starts() {
        let extremes = [0.0, 5e-324, 1e-310, 1e-160, 1e-9, 1.0, 1e16, 1e155, 1e200];
        for (start, p) in
            extremes.into_iter().flat_map(|a| extremes.map(|b| [(a, b), (-a, b)])).flatten()
        {
            let cube = |x: &[Fwd<2>]| vec![(x[0] * x[0] * x[0]).plus(-p)];
            if let Ok(x) = newton(&Written(cube), at(&[start])) {
                assert!(x[0].is_finite(), "{start:e} {p:e}");
            }
        }
    }

    #[test]
    fn no_unknowns_are_solved_at_once() {
        assert!(newton(&Written(arctangent), at(&[])).unwrap().is_empty());
    }
}
