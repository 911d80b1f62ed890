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
    /// First damping, relative to the diagonal of JᵀJ; 1e-3 by default. With 0 the steps are Gauss and Newton's until one fails,
    /// because JᵀJ is singular or the value would rise.
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

/// Outcome of a solve, and the linearization at its last parameters.
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
mod tests;
