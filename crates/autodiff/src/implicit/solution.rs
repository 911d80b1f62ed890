//! The derivative of a solution.

use nalgebra::DMatrix;

use super::linearization::Linearization;
use super::{ImplicitError, Residual};
use crate::solve::Factored;
use crate::{CustomJvp, CustomVjp, Fwd, Operand, Recording, Scalar, Var};

/// Makes the solution `x` of F(x, p) = 0, found by any solver, a differentiable function of `p`.
///
/// The result has the values `x`. With [`Var`], F is recorded only when the gradient is asked for, in a
/// recording of its own. `equation` is kept until then: one with much data goes in an
/// [`Arc`](std::sync::Arc).
///
/// The Jacobian by the unknowns is dense and costs one evaluation of F for every eight of them. For many
/// unknowns, [`solution_with`] takes a sparse one.
///
/// # Errors
/// If F does not have as many components as there are unknowns, if its Jacobian by them is singular to
/// working precision, or if `x` is not a solution: whether it is, is judged by the Newton step from there,
/// which is the error of `x` to first order whatever the units of F. It may be 10⁻⁶ of each unknown plus
/// 10⁻⁹ (in the unit of the unknown).
///
/// # Panics
/// If `S` is [`Var`] and a parameter belongs to another recording.
pub fn solution<S: Operand>(
    equation: impl Residual + 'static,
    x: &[f64],
    p: &[S],
) -> Result<Vec<S>, ImplicitError> {
    let at = Linearization::new(&equation, x, &values(p))?;
    match at.worst(x) {
        Some((unknown, excess)) if excess > 1.0 => {
            Err(ImplicitError::NotASolution { unknown, value: x[unknown], step: at.step[unknown] })
        }
        _ => solution_with(equation, at.jacobian, x, p),
    }
}

/// As [`solution`], with the Jacobian ∂F/∂x that a solver has already factorized, dense or sparse.
///
/// The caller answers for `x` being a solution and `jacobian` being F's there: F is not evaluated.
///
/// # Errors
/// If the Jacobian's size is not the number of unknowns.
///
/// # Panics
/// If `S` is [`Var`] and a parameter belongs to another recording.
pub fn solution_with<S: Operand>(
    equation: impl Residual + 'static,
    jacobian: Factored<f64>,
    x: &[f64],
    p: &[S],
) -> Result<Vec<S>, ImplicitError> {
    if jacobian.size() != x.len() {
        return Err(ImplicitError::Jacobian { unknowns: x.len(), found: jacobian.size() });
    }
    let operation = Implicit { equation, jacobian, x: x.to_vec(), p: values(p) };
    Ok(S::operation(p, x, operation))
}

fn values<S: Scalar>(p: &[S]) -> Vec<f64> {
    p.iter().map(|p| p.value()).collect()
}

/// x(p) near a solution of F(x, p) = 0.
struct Implicit<R> {
    equation: R,
    jacobian: Factored<f64>,
    x: Vec<f64>,
    p: Vec<f64>,
}

impl<R> Implicit<R> {
    fn unknowns<S: Scalar>(&self) -> Vec<S> {
        self.x.iter().map(|&x| S::constant(x)).collect()
    }
}

impl<R: Residual> CustomJvp for Implicit<R> {
    fn jvp(&self, input_tangents: &[f64], output_tangents: &mut [f64]) {
        let p: Vec<Fwd<1>> = (self.p.iter().zip(input_tangents))
            .map(|(&value, &tangent)| Fwd { value, derivative: [tangent] })
            .collect();
        let moved = self.equation.residual(&self.unknowns(), &p);
        let mut step = DMatrix::from_iterator(
            self.x.len(),
            1,
            moved.iter().map(|component| component.derivative[0]),
        );
        self.jacobian.solve_in_place(&mut step);
        output_tangents.iter_mut().zip(&step).for_each(|(sum, step)| *sum -= step);
    }
}

impl<R: Residual + 'static> CustomVjp for Implicit<R> {
    fn vjp(&self, output_adjoints: &[f64], input_adjoints: &mut [f64]) {
        if output_adjoints.iter().all(|adjoint| *adjoint == 0.0) {
            return;
        }
        let mut lambda = DMatrix::from_column_slice(self.x.len(), 1, output_adjoints);
        self.jacobian.solve_transpose_in_place(&mut lambda);
        let recording = Recording::start();
        let p = recording.variables_of(&self.p);
        let residual = self.equation.residual(&self.unknowns(), &p);
        let seeds: Vec<(Var, f64)> = residual
            .into_iter()
            .zip(&lambda)
            .map(|(component, &weight)| (component, -weight))
            .collect();
        let adjoints = recording.vjp(&seeds);
        input_adjoints.iter_mut().zip(&p).for_each(|(sum, &p)| *sum += adjoints.wrt(p));
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::check::{compare_gradients, finite_difference_gradient};
    use crate::gradient;
    use crate::implicit::newton;
    use crate::solve::SolveError;

    /// A chain of masses on hardening springs after a step of implicit Euler: unknown are the speeds,
    /// parameters stiffness, drag, and the speeds before.
    struct Chain {
        masses: usize,
    }

    const H: f64 = 0.05;

    impl Residual for Chain {
        fn residual<S: Scalar>(&self, x: &[S], p: &[S]) -> Vec<S> {
            let [stiffness, drag] = [p[0], p[1]];
            let stretch = |i: usize| {
                let left = if i == 0 { S::zero() } else { x[i - 1] };
                let right = if i == self.masses { S::zero() } else { x[i] };
                (right - left) * S::constant(H) + S::constant(0.1)
            };
            let force = |i: usize| {
                let q = stretch(i);
                stiffness * (q + q * q * q * S::constant(20.0))
            };
            (0..self.masses)
                .map(|i| {
                    let acceleration = (x[i] - p[2 + i]) * S::constant(1.0 / H);
                    acceleration + drag * x[i] * x[i].abs() + force(i) - force(i + 1)
                })
                .collect()
        }
    }

    /// A function of the speeds after two steps.
    fn two_steps<S: Operand>(chain: &Arc<Chain>, p: &[S]) -> S {
        let mut p = p.to_vec();
        for _ in 0..2 {
            let x = newton(chain, &vec![0.0; chain.masses], &values(&p)).unwrap();
            let x = solution(chain.clone(), &x, &p).unwrap();
            p.truncate(2);
            p.extend(x);
        }
        p[2..]
            .iter()
            .enumerate()
            .fold(S::zero(), |sum, (i, &x)| sum + x * x * S::constant(i as f64 + 1.0) + x)
    }

    #[test]
    fn gradients_of_steps_agree_with_forward_mode_and_differences() {
        // More unknowns than fit in one chunk of the Jacobian, and fewer.
        for masses in [1, 3, 10] {
            let chain = Arc::new(Chain { masses });
            let mut p = vec![1e4, 0.7];
            p.extend((0..masses).map(|i| (i as f64 - 0.4).cos()));
            let (value, reverse) = gradient(|p| two_steps(&chain, p), &p);
            assert!((value - two_steps(&chain, &p)).abs() < 1e-12);
            let forward: Vec<f64> = (0..p.len())
                .map(|k| {
                    let mut at: Vec<Fwd<1>> = p.iter().map(|&p| Fwd::constant(p)).collect();
                    at[k] = Fwd::variable(p[k], 0);
                    two_steps(&chain, &at).derivative[0]
                })
                .collect();
            assert!(compare_gradients(&reverse, &forward).relative < 1e-12);
            let differences = finite_difference_gradient(|p| two_steps(&chain, p), &p, 1e-4);
            assert!(compare_gradients(&reverse, &differences).relative < 1e-7);
        }
    }

    #[test]
    fn forward_mode_through_the_solver_agrees() {
        let (chain, p) = (Chain { masses: 1 }, [1e3, 0.7, 2.0]);
        let moving = Fwd::<3>::variables(p);
        let x = newton(&chain, &[0.0], &p).unwrap();
        // Newton's iteration with the same slope everywhere, differentiated step by step.
        let mut through = Fwd::constant(0.0);
        for _ in 0..2000 {
            through -= chain.residual(&[through], &moving)[0] * Fwd::constant(2e-3);
        }
        let ours = solution(chain, &x, &moving).unwrap()[0];
        assert!((ours.value - through.value).abs() < 1e-12);
        assert!(compare_gradients(&ours.derivative, &through.derivative).relative < 1e-9);
    }

    #[test]
    fn constant_parameters_are_allowed() {
        let chain = Arc::new(Chain { masses: 2 });
        let recording = Recording::start();
        let stiffness = recording.variable(50.0);
        let p =
            [stiffness * stiffness, Var::constant(0.3), Var::constant(1.0), Var::constant(-0.5)];
        let x = newton(&chain, &[0.0; 2], &values(&p)).unwrap();
        let solved = solution(chain.clone(), &x, &p).unwrap();
        let exact = recording.gradient(solved[0]).wrt(stiffness);
        let differences = finite_difference_gradient(
            |k| newton(&chain, &[0.0; 2], &[k[0] * k[0], 0.3, 1.0, -0.5]).unwrap()[0],
            &[50.0],
            1e-2,
        );
        assert!((exact / differences[0] - 1.0).abs() < 1e-7);
        let constant = p.map(|p| Var::constant(p.value()));
        let solved = solution(chain, &x, &constant).unwrap();
        assert!(solved.iter().all(|x| Scalar::is_constant(*x)));
    }

    /// x² = p.
    #[derive(Clone, Copy)]
    struct Square;

    impl Residual for Square {
        fn residual<S: Scalar>(&self, x: &[S], p: &[S]) -> Vec<S> {
            x.iter().zip(p).map(|(&x, &p)| x * x - p).collect()
        }
    }

    #[test]
    fn what_is_no_solution_is_refused() {
        assert!(solution(Square, &[3.0], &[9.0]).is_ok());
        assert!(solution(Square, &[3.0 + 1e-6], &[9.0]).is_ok());
        let Err(ImplicitError::NotASolution { unknown: 1, value, step }) =
            solution(Square, &[3.0, 3.1], &[9.0, 9.0])
        else {
            panic!("3.1 is taken for the square root of 9");
        };
        assert_eq!(value, 3.1);
        assert!((step + 0.098).abs() < 1e-3);
    }

    #[test]
    fn a_solution_of_zero_may_carry_rounding_errors() {
        struct Damped;
        impl Residual for Damped {
            fn residual<S: Scalar>(&self, x: &[S], p: &[S]) -> Vec<S> {
                vec![p[0] * x[0]]
            }
        }
        let solved = solution(Damped, &[1e-17], &[Fwd::<1>::variable(1e6, 0)]).unwrap();
        assert_eq!(solved[0].value, 1e-17);
        assert!((solved[0].derivative[0] / -1e-23 - 1.0).abs() < 1e-15);
    }

    #[test]
    fn singular_and_undefined_equations_are_refused() {
        assert!(matches!(
            solution(Square, &[0.0], &[0.0]),
            Err(ImplicitError::Solve(SolveError::Singular { .. }))
        ));
        for (x, p) in [(f64::NAN, 1.0), (1.0, f64::NAN), (f64::INFINITY, 1.0)] {
            let refused = solution(Square, &[x], &[p]);
            assert!(matches!(refused, Err(ImplicitError::Solve(SolveError::NotFinite(_)))));
        }
    }

    #[test]
    fn the_numbers_of_equations_and_unknowns_must_agree() {
        assert!(matches!(
            solution(Square, &[3.0, 4.0], &[9.0]),
            Err(ImplicitError::Equations { unknowns: 2, found: 1 })
        ));
        let one = crate::solve::lu(&nalgebra::Matrix1::new(6.0)).unwrap();
        assert!(matches!(
            solution_with(Square, one, &[3.0, 4.0], &[9.0, 16.0]),
            Err(ImplicitError::Jacobian { unknowns: 2, found: 1 })
        ));
        assert!(solution(Square, &[], &[9.0]).unwrap().is_empty());
    }

    #[cfg(feature = "faer")]
    #[test]
    fn a_sparse_jacobian_gives_the_same_gradient() {
        use crate::solve::SparseSolver;
        let p = [9.0, 16.0, 25.0];
        let solver = SparseSolver::lu(3, &[(0, 0), (1, 1), (2, 2)]).unwrap();
        let (_, slopes) = gradient(
            |p| {
                let x = [3.0, 4.0, 5.0];
                let jacobian = solver.factor(&x.map(|x| 2.0 * x)).unwrap();
                let x = solution_with(Square, jacobian, &x, p).unwrap();
                x[0] + x[1] * x[2]
            },
            &p,
        );
        let expected = [1.0 / 6.0, 5.0 / 8.0, 4.0 / 10.0];
        assert!(compare_gradients(&slopes, &expected).relative < 1e-15);
    }
}
