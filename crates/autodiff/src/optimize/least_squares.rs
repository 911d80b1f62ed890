//! Levenberg–Marquardt, and Gauss–Newton as its undamped case.

use std::marker::PhantomData;
use std::ops::ControlFlow;

use nalgebra::{Cholesky, DMatrix, DVector};

use super::error::check_setting;
use super::iterate::{Descent, Domain, Evaluation, Method, Trial, iterate, unobserved};
use super::problem::{LeastSquares, Linearized, QuadraticModel};
use super::{Criteria, Iteration, NormalEquations, OptimizeError, Outcome};

/// Less damping is dropped, so that the last steps are Gauss and Newton's own; where those cannot be
/// computed, this much is enough.
const LEAST_DAMPING: f64 = 1e-8;

/// Solves (JᵀJ + λD) h = −Jᵀr for the step h, with a damping λ that follows the steps' success.
///
/// D holds the largest diagonal of JᵀJ so far, which makes the path independent of the parameters'
/// units (J. J. Moré, "The Levenberg–Marquardt algorithm: implementation and theory", 1978). λ follows
/// the ratio of actual to predicted decrease by the rule of H. B. Nielsen, "Damping parameter in
/// Marquardt's method", IMM-REP-1999-05. The value only ever falls. A rank-deficient problem is solved
/// in what it determines; what it does not stays about where it was.
///
/// ```
/// use prehend_autodiff::optimize::{LevenbergMarquardt, NormalEquations};
/// use prehend_autodiff::Scalar;
///
/// // Amount and rate of a decay, from what was left at three times.
/// fn decay<S: Scalar>(x: &[S]) -> Vec<S> {
///     [(1.0, 8.0), (3.0, 2.0), (5.0, 0.5)]
///         .map(|(time, left)| x[0] * (-x[1] * S::constant(time)).exp2() - S::constant(left))
///         .to_vec()
/// }
///
/// let fit = LevenbergMarquardt::default()
///     .minimize(&[1.0, 0.0], |x| NormalEquations::forward::<2>(decay, x))?;
/// assert!((fit.parameters[0] - 16.0).abs() < 1e-9 && (fit.parameters[1] - 1.0).abs() < 1e-9);
/// # Ok::<(), prehend_autodiff::optimize::OptimizeError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevenbergMarquardt {
    /// First damping, relative to the diagonal of JᵀJ; 1e-3 by default.
    pub damping: f64,
    /// When to stop.
    pub criteria: Criteria,
}

impl Default for LevenbergMarquardt {
    fn default() -> Self {
        Self { damping: 1e-3, criteria: Criteria::default() }
    }
}

impl LevenbergMarquardt {
    /// Gauss–Newton: no damping until a step fails, because JᵀJ is singular or the value would rise.
    pub fn gauss_newton() -> Self {
        Self { damping: 0.0, ..Self::default() }
    }

    /// Minimizes ½‖r‖² from `start`, given its normal equations at any point.
    ///
    /// # Errors
    /// If a setting is out of range, `start` is empty or not finite, the normal equations are not finite
    /// there, or have the wrong shape anywhere.
    pub fn minimize(
        &self,
        start: &[f64],
        objective: impl FnMut(&[f64]) -> NormalEquations,
    ) -> Result<Outcome, OptimizeError> {
        self.minimize_observed(start, objective, unobserved)
    }

    /// As [`minimize`](Self::minimize), with an observer that sees every iteration and may end it all.
    ///
    /// # Errors
    /// As for [`minimize`](Self::minimize).
    pub fn minimize_observed(
        &self,
        start: &[f64],
        mut objective: impl FnMut(&[f64]) -> NormalEquations,
        observe: impl FnMut(&Iteration) -> ControlFlow<()>,
    ) -> Result<Outcome, OptimizeError> {
        self.check()?;
        let objective = |x: &[f64]| Linearized(objective(x));
        iterate(self.damped(start.len()), &self.criteria, start, objective, observe)
    }

    fn check(&self) -> Result<(), OptimizeError> {
        let inside = self.damping >= 0.0 && self.damping.is_finite();
        check_setting("damping", self.damping, "finite and at least 0", inside)
    }

    /// Minimizes `problem`, whose parameters lie on a manifold, from `start`, where it has been linearized.
    ///
    /// A tolerance of [`Criteria::step`] is absolute here, in the units of the tangent space. Returns the outcome and the
    /// linearization there.
    ///
    /// ```
    /// use nalgebra::{DMatrix, DVector, UnitQuaternion, Vector3};
    /// use prehend_autodiff::lie::so3_log;
    /// use prehend_autodiff::optimize::{LeastSquares, LevenbergMarquardt, NormalEquations};
    ///
    /// /// The mean of rotations.
    /// struct Mean<'a>(&'a [UnitQuaternion<f64>]);
    ///
    /// impl LeastSquares for Mean<'_> {
    ///     type Point = UnitQuaternion<f64>;
    ///     type Linearization = NormalEquations;
    ///
    ///     fn linearize(&self, at: &UnitQuaternion<f64>) -> NormalEquations {
    ///         let residuals = self.0.iter().map(|q| so3_log(&(at * q.inverse())));
    ///         let residuals: Vec<f64> = residuals.flat_map(|r| [r.x, r.y, r.z]).collect();
    ///         // To first order a rotation on the left adds to the difference.
    ///         let jacobian = DMatrix::from_fn(residuals.len(), 3, |r, c| f64::from(r % 3 == c));
    ///         NormalEquations::from_jacobian(&residuals, &jacobian)
    ///     }
    ///     fn retract(&self, at: &UnitQuaternion<f64>, step: &[f64]) -> UnitQuaternion<f64> {
    ///         UnitQuaternion::from_scaled_axis(Vector3::from_column_slice(step)) * at
    ///     }
    /// }
    ///
    /// let seen = [0.1, 0.2, 0.6].map(|angle| UnitQuaternion::from_euler_angles(angle, 0.0, 0.0));
    /// let problem = Mean(&seen);
    /// let start = problem.linearize(&seen[0]);
    /// let (found, _) = LevenbergMarquardt::default()
    ///     .minimize_on(&problem, seen[0], start, |_| std::ops::ControlFlow::Continue(()))?;
    /// assert!((found.parameters.euler_angles().0 - 0.3).abs() < 1e-9);
    /// # Ok::<(), prehend_autodiff::optimize::OptimizeError>(())
    /// ```
    ///
    /// # Errors
    /// If a setting is out of range, the linearization is not finite at the start, or has the wrong shape anywhere.
    pub fn minimize_on<P: LeastSquares>(
        &self,
        problem: &P,
        start: P::Point,
        linearized: P::Linearization,
        mut observe: impl FnMut(&Iteration<P::Point>) -> ControlFlow<()>,
    ) -> Result<Solved<P>, OptimizeError> {
        let starts = vec![(start, linearized)];
        let observe = |_: usize, iteration: &Iteration<P::Point>| observe(iteration);
        let mut found = self.minimize_all_on(problem, starts, observe)?;
        found.pop().unwrap_or(Err(OptimizeError::NoParameters))
    }

    /// As [`minimize_on`](Self::minimize_on) from each of several starts. All walks go step by step side by side, so that
    /// [`LeastSquares::linearize_all`] can answer them together; none depends on the others. The observer hears the number of the start, too;
    /// what it ends is that walk alone.
    ///
    /// # Errors
    /// If a setting is out of range or [`LeastSquares::linearize_all`] does not answer for each point; for each start, as for one alone.
    pub fn minimize_all_on<P: LeastSquares>(
        &self,
        problem: &P,
        starts: Vec<(P::Point, P::Linearization)>,
        mut observe: impl FnMut(usize, &Iteration<P::Point>) -> ControlFlow<()>,
    ) -> Result<Vec<Result<Solved<P>, OptimizeError>>, OptimizeError> {
        self.check()?;
        self.criteria.check()?;
        let (domain, criteria) = (Manifold(problem), &self.criteria);
        let begin = |(start, linearized): (P::Point, P::Linearization)| {
            let linearized = Linearized(linearized);
            let count = linearized.gradient().len();
            linearized.check_shape(count)?;
            Ok((count, Descent::new(self.damped(count), (start, linearized))?))
        };
        let mut walks: Vec<Result<(usize, Descent<_, Damped<_>>), OptimizeError>> =
            starts.into_iter().map(begin).collect();
        loop {
            let (mut asking, mut points) = (Vec::new(), Vec::new());
            for (number, walk) in walks.iter_mut().enumerate() {
                let Ok((_, descent)) = walk else { continue };
                if let Some(point) = descent.ask(&domain, criteria) {
                    asking.push(number);
                    points.push(point);
                }
            }
            if points.is_empty() {
                let end = |(_, descent): (usize, Descent<_, _>)| {
                    let (outcome, Linearized(last)) = descent.end();
                    (outcome, last)
                };
                return Ok(walks.into_iter().map(|walk| walk.map(end)).collect());
            }
            let linearized = problem.linearize_all(&points);
            if linearized.len() != points.len() {
                let (expected, found) = (points.len(), linearized.len());
                return Err(OptimizeError::Answers { expected, found });
            }
            for ((number, point), there) in asking.into_iter().zip(points).zip(linearized) {
                let Ok((count, descent)) = &mut walks[number] else { continue };
                let there = Linearized(there);
                match there.check_shape(*count) {
                    Ok(()) => {
                        let mut observe =
                            |iteration: &Iteration<P::Point>| observe(number, iteration);
                        descent.tell(&domain, criteria, point, there, &mut observe);
                    }
                    Err(error) => walks[number] = Err(error),
                }
            }
        }
    }

    fn damped<M>(&self, parameters: usize) -> Damped<M> {
        let scale = DVector::zeros(parameters);
        Damped { damping: self.damping, growth: 2.0, scale, model: PhantomData }
    }
}

/// What a solve ends with: its outcome, and the linearization there.
pub type Solved<P> = (Outcome<<P as LeastSquares>::Point>, <P as LeastSquares>::Linearization);

/// Where the parameters of a problem live.
struct Manifold<'a, P>(&'a P);

impl<P: LeastSquares> Domain<P::Point> for Manifold<'_, P> {
    fn retract(&self, x: &P::Point, step: &[f64]) -> P::Point {
        self.0.retract(x, step)
    }

    fn norm(&self, _: &P::Point) -> f64 {
        1.0
    }
}

struct Damped<M> {
    /// λ.
    damping: f64,
    /// By how much λ grows at the next failure: faster with each in a row.
    growth: f64,
    /// The diagonal of D.
    scale: DVector<f64>,
    model: PhantomData<M>,
}

impl<M: QuadraticModel> Method for Damped<M> {
    type Evaluation = Linearized<M>;

    fn propose(&mut self, Linearized(here): &Linearized<M>) -> Option<Trial> {
        let (gradient, hessian) = (here.gradient(), here.hessian());
        self.scale.zip_apply(&hessian.diagonal(), |scale, entry| *scale = scale.max(entry));
        // A parameter without any effect yet has no scale of its own, and no gradient to move it.
        let scale = self.scale.map(|entry| if entry > 0.0 { entry } else { 1.0 });
        loop {
            let damping = &scale * self.damping;
            let mut matrix = hessian.clone();
            for i in 0..matrix.nrows() {
                matrix[(i, i)] += damping[i];
            }
            if let Some(step) = solve(matrix, gradient) {
                let predicted = 0.5 * step.dot(&(damping.component_mul(&step) + gradient));
                let step = (-step).as_slice().to_vec();
                return Some(Trial { step, predicted: Some(predicted) });
            }
            if !self.damping.is_finite() {
                return None;
            }
            self.refused();
        }
    }

    fn taken(&mut self, gain: f64) {
        self.damping *= (1.0 - (2.0 * gain - 1.0).powi(3)).max(1.0 / 3.0);
        if self.damping < LEAST_DAMPING {
            self.damping = 0.0;
        }
        self.growth = 2.0;
    }

    fn refused(&mut self) {
        self.damping = (self.damping * self.growth).max(LEAST_DAMPING);
        self.growth *= 2.0;
    }
}

/// The solution of `matrix` · x = `right`, unless the matrix is singular to rounding.
fn solve(matrix: DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    let diagonal = matrix.diagonal();
    let rounding = diagonal.len() as f64 * f64::EPSILON;
    let factor = Cholesky::new(matrix)?;
    // Relative to its own diagonal, so that the parameters' units do not matter.
    let regular = diagonal
        .iter()
        .zip(factor.l_dirty().diagonal().iter())
        .all(|(whole, pivot)| pivot * pivot > rounding * whole);
    regular.then(|| factor.solve(right)).filter(|step| step.iter().all(|x| x.is_finite()))
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, UnitQuaternion, Vector3};

    use super::super::test_problems::{meyer, powell, rosenbrock};
    use super::super::{Criteria, Stop};
    use super::*;
    use crate::lie::{so3_exp, so3_log};
    use crate::{Fwd, Scalar};

    fn both() -> [LevenbergMarquardt; 2] {
        [LevenbergMarquardt::default(), LevenbergMarquardt::gauss_newton()]
    }

    #[test]
    fn rosenbrock_is_solved_to_rounding() {
        for method in both() {
            let found = method
                .minimize(&[-1.2, 1.0], |x| NormalEquations::forward::<2>(rosenbrock, x))
                .unwrap();
            assert_eq!(found.stop, Stop::Gradient);
            assert!(found.iterations < 40, "{found:?}");
            assert!(found.parameters.iter().all(|x| (x - 1.0).abs() < 1e-9), "{found:?}");
        }
    }

    #[test]
    fn powell_singular_is_reached_though_its_jacobian_loses_rank_there() {
        for method in both() {
            let found = method
                .minimize(&[3.0, -1.0, 0.0, 1.0], |x| NormalEquations::forward::<3>(powell, x))
                .unwrap();
            assert_eq!(found.stop, Stop::Gradient);
            assert!(found.iterations < 40, "{found:?}");
            assert!(found.parameters.iter().all(|x| x.abs() < 1e-3), "{found:?}");
        }
    }

    #[test]
    fn a_badly_scaled_fit_with_residuals_left_reaches_the_published_value() {
        for method in both() {
            let found = method
                .minimize(&[0.02, 4000.0, 250.0], |x| NormalEquations::forward::<3>(meyer, x))
                .unwrap();
            assert!((2.0 * found.value - 87.9458).abs() < 1e-4, "{found:?}");
            assert_ne!(found.stop, Stop::Iterations);
        }
    }

    #[test]
    fn units_of_the_parameters_do_not_change_the_path() {
        let path = |unit: f64| {
            let scaled = |x: &[Fwd<2>]| rosenbrock(&[x[0], x[1] * Fwd::constant(unit)]);
            let mut values = Vec::new();
            LevenbergMarquardt::default()
                .minimize_observed(
                    &[-1.2, 1.0 / unit],
                    |x| NormalEquations::forward(scaled, x),
                    |iteration| {
                        values.push(iteration.value);
                        ControlFlow::Continue(())
                    },
                )
                .unwrap();
            values
        };
        // A power of two, so that rounding is the same as well.
        let (meters, other) = (path(1.0), path(1.0 / 1024.0));
        assert!(meters.len() > 10);
        assert_eq!(meters[..10], other[..10]);
    }

    const POINTS: [[f64; 3]; 4] =
        [[0.3, -0.2, 0.9], [1.0, 0.1, -0.4], [-0.5, 0.8, 0.2], [0.1, 0.9, 0.7]];

    fn rotation(x: &[f64]) -> UnitQuaternion<f64> {
        so3_exp(&Vector3::from_column_slice(x))
    }

    /// The rotation that turns `POINTS` onto `seen`.
    fn fit_rotation(method: LevenbergMarquardt, seen: &[Vector3<f64>]) -> UnitQuaternion<f64> {
        let residuals = |x: &[Fwd<3>]| {
            let turn = so3_exp(&Vector3::from_column_slice(x));
            POINTS
                .iter()
                .zip(seen)
                .flat_map(|(&point, seen)| {
                    let miss =
                        turn * Vector3::from(point).map(Fwd::constant) - seen.map(Fwd::constant);
                    [miss.x, miss.y, miss.z]
                })
                .collect()
        };
        let found = method.minimize(&[0.0; 3], |x| NormalEquations::forward(residuals, x)).unwrap();
        assert_ne!(found.stop, Stop::Iterations);
        rotation(&found.parameters)
    }

    #[test]
    fn a_rotation_is_found_from_points_seen_turned() {
        for omega in [[0.0, 0.0, 0.0], [0.4, -0.9, 0.2], [-1.5, 2.0, 1.2]] {
            let truth = rotation(&omega);
            let seen = POINTS.map(|p| truth * Vector3::from(p));
            for method in both() {
                let error = so3_log(&(truth.inverse() * fit_rotation(method, &seen))).norm();
                assert!(error < 1e-10, "{omega:?}: {error:e}");
            }
        }
    }

    #[test]
    fn a_rotation_fitted_to_noisy_points_is_that_of_kabsch() {
        let truth = rotation(&[0.4, -0.9, 0.2]);
        let mut noise = [0.07, -0.07, 0.03, -0.05].iter();
        let seen = POINTS.map(|p| {
            truth * Vector3::from(p) + Vector3::new(1.0, -1.0, 0.5) * *noise.next().unwrap()
        });
        let correlation: Matrix3<f64> =
            POINTS.iter().zip(&seen).map(|(&p, seen)| seen * Vector3::from(p).transpose()).sum();
        let svd = correlation.svd(true, true);
        let best = svd.u.unwrap() * svd.v_t.unwrap();
        assert!(best.determinant() > 0.0);
        for method in both() {
            let fitted = fit_rotation(method, &seen).to_rotation_matrix();
            let difference = (fitted.matrix() - best).norm();
            assert!(difference < 1e-8, "{difference:e}");
        }
    }

    #[test]
    fn what_the_residuals_do_not_determine_stays() {
        // Only the sum of the first two counts, and the third not at all.
        fn residuals<S: Scalar>(x: &[S]) -> Vec<S> {
            let sum = x[0] + x[1];
            vec![sum - S::constant(4.0), (sum - S::constant(4.0)) * S::constant(3.0)]
        }
        for method in both() {
            let found = method
                .minimize(&[1.0, 2.0, 7.0], |x| NormalEquations::forward::<3>(residuals, x))
                .unwrap();
            assert_eq!(found.stop, Stop::Gradient);
            for (x, expected) in found.parameters.iter().zip([1.5, 2.5, 7.0]) {
                assert!((x - expected).abs() < 1e-6, "{found:?}");
            }
        }
    }

    #[test]
    fn pivots_of_mere_rounding_make_no_huge_steps() {
        // One weighted sum seen twice: JᵀJ has rank 1, but the factorization may not notice.
        for case in 1..200 {
            let weights = [1.0, 2.0, 3.0].map(|i| 2.0 + (f64::from(case) * i).sin());
            let residuals = |x: &[Fwd<3>]| {
                let sum =
                    (0..3).fold(Fwd::constant(-4.0), |s, i| s + x[i] * Fwd::constant(weights[i]));
                vec![sum, sum * Fwd::constant(0.3)]
            };
            let found = LevenbergMarquardt::gauss_newton()
                .minimize(&[0.0; 3], |x| NormalEquations::forward(residuals, x))
                .unwrap();
            // Each parameter takes its third of the sum.
            for (x, weight) in found.parameters.iter().zip(weights) {
                assert!((x * weight - 4.0 / 3.0).abs() < 1e-5, "{weights:?}: {found:?}");
            }
        }
    }

    #[test]
    fn the_value_never_rises_and_refused_steps_change_nothing() {
        for method in both() {
            let (mut last, mut refused) = ((f64::INFINITY, vec![-1.2, 1.0]), 0);
            method
                .minimize_observed(
                    &[-1.2, 1.0],
                    |x| NormalEquations::forward::<2>(rosenbrock, x),
                    |iteration| {
                        if iteration.taken {
                            assert!(iteration.value < last.0);
                        } else {
                            refused += 1;
                            assert_eq!(*iteration.parameters, last.1);
                        }
                        last = (iteration.value, iteration.parameters.to_vec());
                        ControlFlow::Continue(())
                    },
                )
                .unwrap();
            assert!(refused > 0, "no step was refused, so nothing was tested");
        }
    }

    #[test]
    fn steps_to_where_residuals_are_not_finite_are_shortened() {
        // √x has no value left of zero, which is where the first step of Gauss–Newton from 9 leads.
        fn residuals<S: Scalar>(x: &[S]) -> Vec<S> {
            vec![x[0].sqrt() - S::constant(0.1)]
        }
        for method in both() {
            let mut bad = 0;
            let found = method
                .minimize(&[9.0], |x| {
                    bad += usize::from(x[0] < 0.0);
                    NormalEquations::forward::<1>(residuals, x)
                })
                .unwrap();
            assert!(bad > 0, "every step was finite, so nothing was tested");
            assert!((found.parameters[0] - 0.01).abs() < 1e-9, "{found:?}");
            assert!(found.iterations < 20, "{found:?}");
        }
    }

    #[test]
    fn a_minimum_that_leaves_residuals_settles() {
        let criteria = Criteria { gradient: 0.0, ..Criteria::default() };
        for method in both() {
            let method = LevenbergMarquardt { criteria, ..method };
            let line = |x: &[Fwd<1>]| {
                [1.0, 2.0, 6.0].map(|y| (x[0] - Fwd::constant(y)) * Fwd::constant(0.1)).to_vec()
            };
            let found = method.minimize(&[100.0], |x| NormalEquations::forward(line, x)).unwrap();
            assert!((found.parameters[0] - 3.0).abs() < 1e-6, "{found:?}");
            assert!(found.iterations < 20 && found.stop != Stop::Iterations, "{found:?}");
        }
    }

    /// Rosenbrock's valley as a problem of plain vectors; not a number beyond x = 5. It forgets answers once it was asked often.
    struct Valley(std::cell::RefCell<Vec<usize>>);

    impl LeastSquares for Valley {
        type Point = Vec<f64>;
        type Linearization = NormalEquations;

        fn linearize(&self, at: &Vec<f64>) -> NormalEquations {
            let mut all = NormalEquations::forward::<2>(rosenbrock, at);
            all.value = if at[0] > 5.0 { f64::NAN } else { all.value };
            all
        }

        fn linearize_all(&self, points: &[Vec<f64>]) -> Vec<NormalEquations> {
            self.0.borrow_mut().push(points.len());
            let answered = if self.0.borrow().len() > 900 { 0 } else { points.len() };
            points[..answered].iter().map(|at| self.linearize(at)).collect()
        }

        fn retract(&self, at: &Vec<f64>, step: &[f64]) -> Vec<f64> {
            at.iter().zip(step).map(|(x, h)| x + h).collect()
        }
    }

    #[test]
    fn a_missing_answer_is_an_error() {
        let problem = Valley(vec![0; 900].into());
        let start = vec![-1.2, 1.0];
        let linearized = problem.linearize(&start);
        let go_on = |_: &Iteration<Vec<f64>>| ControlFlow::Continue(());
        let found = LevenbergMarquardt::default().minimize_on(&problem, start, linearized, go_on);
        let error = OptimizeError::Answers { expected: 1, found: 0 };
        assert_eq!(found.map(|found| found.0), Err(error));
    }

    #[test]
    fn walks_side_by_side_go_as_they_go_alone() {
        let starts = [[-1.2, 1.0], [2.0, -1.0], [6.0, 0.0], [1.0, 1.0], [0.3, 0.3]];
        let problem = Valley(Vec::new().into());
        for method in both() {
            let begin = |start: &[f64; 2]| (start.to_vec(), problem.linearize(&start.to_vec()));
            let go_on = |_: &Iteration<Vec<f64>>| ControlFlow::Continue(());
            let alone: Vec<_> = starts
                .iter()
                .map(|start| {
                    let (x, linearized) = begin(start);
                    method.minimize_on(&problem, x, linearized, go_on).map(|found| found.0)
                })
                .collect();
            problem.0.borrow_mut().clear();
            let mut heard = [0; 5];
            let together = method
                .minimize_all_on(&problem, starts.iter().map(begin).collect(), |number, _| {
                    heard[number] += 1;
                    ControlFlow::Continue(())
                })
                .unwrap();
            let together: Vec<_> =
                together.into_iter().map(|found| found.map(|found| found.0)).collect();
            assert_eq!(together, alone);
            assert_eq!(together[2], Err(OptimizeError::ObjectiveNotFinite));
            let iterations =
                |found: &Result<Outcome<_>, _>| found.as_ref().map_or(0, |o| o.iterations);
            assert_eq!(together.iter().map(iterations).collect::<Vec<_>>(), heard);
            // All that were not over were asked for at once.
            let asked = problem.0.borrow();
            assert_eq!(asked.len(), *heard.iter().max().unwrap());
            assert_eq!(asked[0], 3);
            assert!(asked.is_sorted_by(|a, b| a >= b));
        }
    }

    #[test]
    fn bad_damping_and_matrices_are_refused() {
        let method = LevenbergMarquardt { damping: -1.0, ..Default::default() };
        let refused = method.minimize(&[1.0], |x| NormalEquations::forward::<2>(rosenbrock, x));
        assert!(matches!(refused, Err(OptimizeError::Setting { name: "damping", .. })));
        let with_matrix = |matrix: DMatrix<f64>| {
            LevenbergMarquardt::default().minimize(&[1.0], |_| NormalEquations {
                value: 1.0,
                gradient: DVector::repeat(1, 1.0),
                matrix: matrix.clone(),
            })
        };
        assert_eq!(
            with_matrix(DMatrix::identity(2, 2)),
            Err(OptimizeError::MatrixShape { expected: 1, rows: 2, columns: 2 })
        );
        let infinite = DMatrix::repeat(1, 1, f64::INFINITY);
        assert_eq!(with_matrix(infinite), Err(OptimizeError::ObjectiveNotFinite));
    }
}
