//! A factorized matrix, and the derivatives of solving with it.

use std::fmt;
use std::sync::Arc;

use nalgebra::allocator::Allocator;
use nalgebra::{DMatrix, DefaultAllocator, Dim, Matrix, OMatrix, RawStorage};

use super::SolveError;
use super::condition;
use super::factors::Factors;
use super::pattern::Pattern;
use crate::operand::{CustomJvp, Operand};
use crate::vjp::CustomVjp;

/// A factorized square matrix, to be solved with as often as needed. Cheap to clone if it is constant.
///
/// Made by [`lu`](super::lu) and, with the cargo feature `faer`, `SparseSolver::factor`.
#[derive(Clone)]
pub struct Factored<S> {
    pattern: Pattern,
    factors: Arc<dyn Factors>,
    condition: f64,
    /// The matrix's entries; none if it is constant.
    entries: Vec<S>,
}

impl<S: Operand> Factored<S> {
    pub(super) fn new(
        pattern: Pattern,
        mut entries: Vec<S>,
        factorize: impl FnOnce(&[f64]) -> Result<Arc<dyn Factors>, SolveError>,
    ) -> Result<Self, SolveError> {
        let values: Vec<f64> = entries.iter().map(|entry| entry.value()).collect();
        if !values.iter().all(|value| value.is_finite()) {
            return Err(SolveError::NotFinite("matrix"));
        }
        let factors = factorize(&values)?;
        let condition = condition::estimate(&pattern, &values, factors.as_ref());
        if condition > condition::LARGEST {
            return Err(SolveError::Singular { condition });
        }
        if entries.iter().all(|entry| entry.is_constant()) {
            entries = Vec::new();
        }
        Ok(Self { pattern, factors, condition, entries })
    }

    /// Rows, and columns, of the matrix.
    pub fn size(&self) -> usize {
        self.pattern.size()
    }

    /// Estimated condition number, at least 1: how much larger than that of the matrix's entries the
    /// relative error of a solution can be. The units of unknowns and equations hardly matter to it.
    pub fn condition(&self) -> f64 {
        self.condition
    }

    /// Solves A x = b for one or more right-hand sides, the columns of `b`.
    ///
    /// # Errors
    /// If `b` does not have as many rows as the matrix, or `b` or x is not finite.
    ///
    /// # Panics
    /// If `S` is [`Var`](crate::Var) and a number belongs to another recording.
    pub fn solve<R: Dim, C: Dim>(
        &self,
        b: &Matrix<S, R, C, impl RawStorage<S, R, C>>,
    ) -> Result<OMatrix<S, R, C>, SolveError>
    where
        DefaultAllocator: Allocator<R, C>,
    {
        let (rows, columns) = b.shape_generic();
        if rows.value() != self.size() {
            return Err(SolveError::Length {
                what: "rows of the right-hand side",
                expected: self.size(),
                found: rows.value(),
            });
        }
        let values = b.iter().map(|b| b.value());
        let mut x = DMatrix::from_iterator(rows.value(), columns.value(), values);
        if !x.iter().all(|b| b.is_finite()) {
            return Err(SolveError::NotFinite("right-hand side"));
        }
        self.factors.solve(&mut x);
        if !x.iter().all(|x| x.is_finite()) {
            return Err(SolveError::NotFinite("solution"));
        }

        let inputs: Vec<S> = self.entries.iter().chain(b.iter()).copied().collect();
        let outputs = x.as_slice().to_vec();
        let operation = Solve {
            pattern: self.pattern.clone(),
            factors: self.factors.clone(),
            entries: self.entries.len(),
            x,
        };
        let results = S::operation(&inputs, &outputs, operation);
        Ok(OMatrix::from_iterator_generic(rows, columns, results))
    }
}

impl Factored<f64> {
    /// A⁻¹ `rhs`, finite or not.
    pub(crate) fn solve_in_place(&self, rhs: &mut DMatrix<f64>) {
        self.factors.solve(rhs);
    }

    /// A⁻ᵀ `rhs`, finite or not.
    pub(crate) fn solve_transpose_in_place(&self, rhs: &mut DMatrix<f64>) {
        self.factors.solve_transpose(rhs);
    }
}

impl<S> fmt::Debug for Factored<S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Factored")
            .field("size", &self.pattern.size())
            .field("condition", &self.condition)
            .finish_non_exhaustive()
    }
}

/// x = A⁻¹ b. Its inputs are the entries of A, unless that is constant, and those of b, column by column.
struct Solve {
    pattern: Pattern,
    factors: Arc<dyn Factors>,
    /// Inputs that are entries of A.
    entries: usize,
    x: DMatrix<f64>,
}

impl CustomJvp for Solve {
    fn jvp(&self, input_tangents: &[f64], output_tangents: &mut [f64]) {
        let (da, db) = input_tangents.split_at(self.entries);
        let mut dx = DMatrix::from_column_slice(self.x.nrows(), self.x.ncols(), db);
        if !da.is_empty() {
            self.pattern.visit(|at| {
                for column in 0..dx.ncols() {
                    dx[(at.row, column)] -= da[at.entry] * self.x[(at.column, column)];
                }
            });
        }
        self.factors.solve(&mut dx);
        output_tangents.iter_mut().zip(&dx).for_each(|(sum, dx)| *sum += dx);
    }
}

impl CustomVjp for Solve {
    fn vjp(&self, output_adjoints: &[f64], input_adjoints: &mut [f64]) {
        let mut lambda =
            DMatrix::from_column_slice(self.x.nrows(), self.x.ncols(), output_adjoints);
        self.factors.solve_transpose(&mut lambda);
        let (of_a, of_b) = input_adjoints.split_at_mut(self.entries);
        of_b.iter_mut().zip(&lambda).for_each(|(sum, lambda)| *sum += lambda);
        if !of_a.is_empty() {
            self.pattern.visit(|at| {
                for column in 0..lambda.ncols() {
                    of_a[at.entry] -= lambda[(at.row, column)] * self.x[(at.column, column)];
                }
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector, Matrix3, Matrix3x2, SMatrix, Vector3};

    use super::*;
    use crate::check::{compare_gradients, finite_difference_gradient};
    use crate::fwd::Fwd;
    use crate::recording::{Recording, gradient};
    use crate::scalar::Scalar;
    use crate::solve::lu;
    use crate::var::Var;

    /// Three entries of A and one of b vary, two of A together; the first pivot is zero.
    fn system<S: Operand>(p: &[S]) -> (Matrix3<S>, Matrix3x2<S>) {
        let c = S::constant;
        let a = Matrix3::new(
            c(0.0),
            p[0],
            p[1] * p[1], //
            p[1] + c(2.0),
            c(-0.5),
            c(1.0), //
            c(3.0),
            p[2],
            p[0] * p[2],
        );
        (a, Matrix3x2::new(c(1.0), p[3], p[3] * p[0], c(-2.0), c(0.25), c(0.0)))
    }

    /// A number that depends on all of the solution, and is not linear in it.
    fn mix<S: Scalar>(x: &Matrix3x2<S>) -> S {
        x.iter()
            .enumerate()
            .fold(S::zero(), |sum, (k, &x)| sum + (x * S::constant(0.3 * (k as f64 + 1.0))).sin())
    }

    fn mixed<S: Operand>(p: &[S]) -> S {
        let (a, b) = system(p);
        mix(&lu(&a).unwrap().solve(&b).unwrap())
    }

    #[test]
    fn all_modes_agree_with_differences_and_with_the_plain_solver() {
        for p in [[0.7, -1.1, 0.4, 2.0], [-2.0, 0.3, 1.7, 0.0], [1.0, 0.0, -3.0, -0.6]] {
            let (value, reverse) = gradient(mixed, &p);
            assert_eq!(value, mixed(&p));
            let forward = mixed(&Fwd::<4>::variables(p));
            assert!(compare_gradients(&forward.derivative, &reverse).relative < 1e-13);
            let (a, b) = system(&Fwd::<4>::variables(p));
            let plain = mix(&a.lu().solve(&b).unwrap());
            assert!(compare_gradients(&plain.derivative, &reverse).relative < 1e-13);
            let differences = finite_difference_gradient(mixed, &p, 1e-4);
            assert!(compare_gradients(&differences, &reverse).relative < 1e-9);
        }
    }

    #[test]
    fn every_entry_of_a_large_matrix_has_its_adjoint() {
        const N: usize = 12;
        let a = DMatrix::from_fn(N, N, |i, j| ((3 * i + 7 * j + 1).pow(2) as f64).sin());
        let b = DVector::from_fn(N, |i, _| (i as f64).cos());
        let recording = Recording::start();
        let vars = (a.map(|a| recording.variable(a)), b.map(|b| recording.variable(b)));
        let x = lu(&vars.0).unwrap().solve(&vars.1).unwrap();
        let adjoints = recording.gradient(x[3]);
        // Row 3 of the inverse, and the derivative of the inverse.
        let inverse = a.try_inverse().unwrap();
        let x = x.map(Var::value);
        for i in 0..N {
            let by_b = adjoints.wrt(vars.1[i]);
            assert!((by_b - inverse[(3, i)]).abs() < 1e-12 * inverse.amax());
            for j in 0..N {
                let by_a = adjoints.wrt(vars.0[(i, j)]);
                assert!((by_a + inverse[(3, i)] * x[j]).abs() < 1e-11 * inverse.amax() * x.amax());
            }
        }
    }

    #[test]
    fn one_factorization_serves_many_solves() {
        let run = |p: &[Var]| {
            let (a, b) = system(p);
            let factored = lu(&a).unwrap();
            let once = factored.solve(&b).unwrap();
            let twice = factored.clone().solve(&once).unwrap();
            mix(&twice) + mix(&once)
        };
        let plain = |p: &[f64]| {
            let (a, b) = system(p);
            let inverse = a.try_inverse().unwrap();
            mix(&(inverse * inverse * b)) + mix(&(inverse * b))
        };
        let p = [0.7, -1.1, 0.4, 2.0];
        let (value, exact) = gradient(run, &p);
        assert!((value - plain(&p)).abs() < 1e-12);
        let differences = finite_difference_gradient(plain, &p, 1e-4);
        assert!(compare_gradients(&exact, &differences).relative < 1e-9);
    }

    #[test]
    fn a_constant_matrix_or_right_hand_side_costs_nothing() {
        let recording = Recording::start();
        let [s, t] = recording.variables([2.0, 5.0]);
        let a = SMatrix::<f64, 2, 2>::new(0.0, 4.0, -2.0, 1.0).map(Var::constant);
        let b = nalgebra::Vector2::new(s, t);
        let x = lu(&a).unwrap().solve(&b).unwrap();
        // The outputs, and no inputs for the matrix.
        assert_eq!(recording.statistics().nodes, 4);
        assert_eq!((x[0].value(), x[1].value()), (-2.25, 0.5));
        let adjoints = recording.gradient(x[0]);
        assert_eq!((adjoints.wrt(s), adjoints.wrt(t)), (0.125, -0.5));

        let constant = b.map(|b| Var::constant(b.value()));
        assert!(lu(&a).unwrap().solve(&constant).unwrap().iter().all(|x| x.is_constant()));
        let y = lu(&nalgebra::Matrix1::new(s))
            .unwrap()
            .solve(&nalgebra::Vector1::new(Var::constant(3.0)));
        assert_eq!(recording.gradient(y.unwrap()[0]).wrt(s), -0.75);
    }

    #[test]
    fn an_empty_system_has_an_empty_solution() {
        let a = DMatrix::<Var>::zeros(0, 0);
        let factored = lu(&a).unwrap();
        assert_eq!(factored.solve(&DVector::zeros(0)).unwrap().len(), 0);
        let none = lu(&Matrix3::<Var>::identity()).unwrap().solve(&DMatrix::zeros(3, 0)).unwrap();
        assert_eq!(none.shape(), (3, 0));
    }

    #[test]
    fn bad_right_hand_sides_are_refused() {
        let factored = lu(&Matrix3::<f64>::identity()).unwrap();
        assert!(matches!(
            factored.solve(&DVector::zeros(2)),
            Err(SolveError::Length { expected: 3, found: 2, .. })
        ));
        for bad in [f64::NAN, f64::INFINITY] {
            let refused = factored.solve(&Vector3::new(0.0, bad, 0.0));
            assert_eq!(refused, Err(SolveError::NotFinite("right-hand side")));
        }
        let tiny = lu(&(Matrix3::identity() * 1e-200)).unwrap();
        assert_eq!(tiny.solve(&Vector3::repeat(1e200)), Err(SolveError::NotFinite("solution")));
    }
}
