//! A sum of factors, and the way to its least value.

use std::ops::ControlFlow;
use std::slice;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use prehend_autodiff::optimize::{
    Criteria, LeastSquares, LevenbergMarquardt, OptimizeError, QuadraticModel, Solved, Stop,
};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use strum::IntoStaticStr;

use super::{
    Block, Factor, ImageWarp, NoiseScale, NoiseScales, NormalEquations, RIDGE, ScaledCholesky,
    SchurComplement, State, SurfacePatches,
};

/// Factors, and the blocks of the state that are solved for.
#[derive(Clone)]
pub struct Problem {
    /// Prior of the state, if there is one.
    prior: Option<Arc<dyn Factor>>,
    factors: Vec<Arc<dyn Factor>>,
    blocks: Vec<Block>,
    /// Where the object may be off from its model: displacements that states do not hold, and that are eliminated.
    pub(crate) patches: Option<Arc<SurfacePatches>>,
    noise: NoiseScales,
}

/// A state, the cost there, and its derivatives.
///
/// Where surface patches are eliminated, cost and derivatives are those at their best displacements, as far as the factors are
/// linear in them: the derivatives leave out how that changes with the state.
#[derive(Clone)]
pub struct Linearization {
    /// Where it is.
    pub state: State,
    /// Sum of the costs \[nat\].
    pub cost: f64,
    /// Gradient and Gauss–Newton Hessian of the sum.
    pub equations: NormalEquations,
    /// Cost and derivatives of the prior, if there is one.
    pub prior: Option<Contribution>,
    /// Cost and derivatives of each of the other factors, in order.
    pub factors: Vec<Contribution>,
    /// Eliminated displacements, if there are surface patches.
    pub(crate) marginal: Option<Marginal>,
}

/// Cost and derivatives of one factor.
#[derive(Clone)]
pub struct Contribution {
    /// The factor's name.
    pub name: &'static str,
    /// Its cost \[nat\].
    pub cost: f64,
    /// The scale of its noise.
    pub(crate) noise: NoiseScale,
    /// Its derivatives.
    pub(crate) equations: NormalEquations,
}

/// Displacements of surface patches, eliminated.
#[derive(Clone)]
pub(crate) struct Marginal {
    pub(crate) patches: Arc<SurfacePatches>,
    /// Logarithm of the determinant of the Hessian by the displacements.
    pub(crate) log_determinant: f64,
}

impl Contribution {
    /// χ² of its residuals at a noise scale of one.
    pub(crate) fn chi_square(&self) -> f64 {
        2.0 * self.cost / self.noise.weight()
    }
}

impl Linearization {
    /// The undamped step to the minimum of the quadratic model, by all blocks; `None` if it is not determined.
    pub fn gauss_newton_step(&self) -> Option<DVector<f64>> {
        let factor = ScaledCholesky::new(self.equations.hessian(), RIDGE)?;
        Some(-factor.inverse() * self.equations.gradient())
    }

    /// Cost of all factors but the prior, of the model as it is \[nat\].
    pub(crate) fn cost_of_factors(&self) -> f64 {
        self.factors.iter().map(|part| part.cost).sum()
    }
}

impl QuadraticModel for Linearization {
    fn value(&self) -> f64 {
        self.cost
    }

    fn gradient(&self) -> &DVector<f64> {
        self.equations.gradient()
    }

    fn hessian(&self) -> &DMatrix<f64> {
        self.equations.hessian()
    }
}

/// Levenberg–Marquardt over the blocks of a problem.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Solver {
    /// Number of steps tried at most.
    pub iterations: usize,
    /// Decrease of the cost promised by the next step below which a solve ends \[nat\].
    pub min_decrease: f64,
}

/// Why a solve ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
pub enum Termination {
    /// The next step promises less than [`Solver::min_decrease`].
    Converged,
    /// Steps downhill did not lower the cost. Where surface patches are eliminated, derivatives are not quite those of the cost,
    /// and most solves end so, near the minimum.
    Stalled,
    /// All iterations were used.
    Iterations,
    /// The observer ended it.
    Aborted,
}

impl Termination {
    /// The name used in reports.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// Where a solve ended.
#[derive(Clone)]
pub struct Solution {
    /// The state of the lowest cost.
    pub at: Linearization,
    /// Why there were no more steps.
    pub termination: Termination,
    /// Steps that lowered the cost.
    pub iterations: usize,
}

impl Problem {
    /// The sum of `factors` over `blocks`.
    pub fn new(factors: Vec<Arc<dyn Factor>>, blocks: Vec<Block>) -> Self {
        Self { prior: None, factors, blocks, patches: None, noise: NoiseScales::new() }
    }

    /// With what is known beforehand.
    pub fn with_prior(self, prior: Arc<dyn Factor>) -> Self {
        Self { prior: Some(prior), ..self }
    }

    /// Problem with displacements of the surface in `patches`.
    pub(crate) fn with_patches(self, patches: Option<Arc<SurfacePatches>>) -> Self {
        Self { patches, ..self }
    }

    /// With standard deviations of the factors' noise larger by these scales.
    pub(crate) fn with_noise(self, noise: NoiseScales) -> Self {
        Self { noise, ..self }
    }

    fn noise(&self, name: &str) -> NoiseScale {
        self.noise.get(name).copied().unwrap_or(NoiseScale::ONE)
    }

    /// A `factor`'s cost where it is `cost` at a noise scale of one.
    fn scaled(&self, factor: &dyn Factor, cost: f64) -> f64 {
        let noise = self.noise(factor.name());
        noise.weight() * cost + noise.cost
    }

    /// The cost at `state` of the model as it is \[nat\]. No derivative is computed.
    pub fn cost(&self, state: &State) -> f64 {
        self.cost_all(slice::from_ref(state))[0]
    }

    /// The [`cost`](Self::cost) at each of several states.
    pub(crate) fn cost_all(&self, states: &[State]) -> Vec<f64> {
        let factors: Vec<_> = self.prior.iter().chain(&self.factors).collect();
        let costs: Vec<(_, Vec<f64>)> =
            factors.into_par_iter().map(|factor| (factor, factor.cost_all(states))).collect();
        let sum =
            |i: usize| costs.iter().map(|(factor, of)| self.scaled(factor.as_ref(), of[i])).sum();
        (0..states.len()).map(sum).collect()
    }

    /// Lowers the cost from `start` until `solver` is content, or `observe`, which hears after each step whether it lowered the
    /// cost, breaks off.
    pub fn solve(
        &self,
        start: Linearization,
        solver: &Solver,
        mut observe: impl FnMut(bool) -> ControlFlow<()>,
    ) -> Solution {
        let mut iterations = 0;
        let state = start.state.clone();
        let found = solver.method().minimize_on(self, state.clone(), start, |iteration| {
            iterations += usize::from(iteration.taken);
            observe(iteration.taken)
        });
        self.solution(&state, iterations, found)
    }

    /// As [`solve`](Self::solve) from each of several states, all side by side.
    pub(crate) fn solve_all(&self, states: &[State], solver: &Solver) -> Vec<Solution> {
        let starts = states.iter().cloned().zip(self.linearize_all(states)).collect();
        let mut iterations = vec![0; states.len()];
        let found = solver.method().minimize_all_on(self, starts, |number, iteration| {
            iterations[number] += usize::from(iteration.taken);
            ControlFlow::Continue(())
        });
        let found = found.unwrap_or_else(|error| vec![Err(error); states.len()]);
        let each = states.iter().zip(iterations).zip(found);
        each.map(|((state, iterations), found)| self.solution(state, iterations, found)).collect()
    }

    /// Where a walk from `start` ended.
    fn solution(
        &self,
        start: &State,
        iterations: usize,
        found: Result<Solved<Self>, OptimizeError>,
    ) -> Solution {
        // A start that cannot be linearized is where it ends.
        let Ok((outcome, at)) = found else {
            let at = self.linearize(start);
            return Solution { at, termination: Termination::Stalled, iterations: 0 };
        };
        let termination = match outcome.stop {
            Stop::Gradient | Stop::Decrease => Termination::Converged,
            Stop::Step => Termination::Stalled,
            Stop::Iterations => Termination::Iterations,
            Stop::Observer => Termination::Aborted,
        };
        Solution { at, termination, iterations }
    }

    /// Derivatives of all factors but the prior at `state`, those by displacements of patches and by what the image is off by included.
    pub(crate) fn evidence(&self, state: &State, warp: &Arc<ImageWarp>) -> NormalEquations {
        let nothing = || self.no_equations().with_image_warp(Arc::clone(warp));
        let of_factor = |factor: &Arc<dyn Factor>| {
            let mut equations = nothing();
            factor.linearize(state, &mut equations);
            equations
        };
        let parts: Vec<NormalEquations> = self.factors.par_iter().map(of_factor).collect();
        let mut sum = nothing();
        parts.iter().for_each(|part| sum += part);
        sum
    }

    /// Contribution of `factor`, given its cost and equations at a noise scale of one.
    fn contribution(
        &self,
        factor: &dyn Factor,
        cost: f64,
        mut equations: NormalEquations,
    ) -> Contribution {
        let (name, noise) = (factor.name(), self.noise(factor.name()));
        if noise.scale != 1.0 {
            equations *= noise.weight();
        }
        Contribution { name, cost: noise.weight() * cost, noise, equations }
    }

    /// `at`, with other scales of the factors' noise.
    pub(crate) fn rescale(&self, at: Linearization, noise: &NoiseScales) -> Linearization {
        let rescale = |mut part: Contribution| {
            let noise = noise.get(part.name).copied().unwrap_or(part.noise);
            let ratio = noise.weight() / part.noise.weight();
            part.cost *= ratio;
            part.equations *= ratio;
            Contribution { noise, ..part }
        };
        let factors = at.factors.into_iter().map(rescale).collect();
        self.sum(&at.state, at.prior, factors)
    }

    /// Nothing yet of the derivatives of a sum.
    fn no_equations(&self) -> NormalEquations {
        let patches = self.patches.as_ref().map_or(0, |patches| patches.count());
        NormalEquations::with_patches(&self.blocks, patches)
    }

    /// The sum of what the factors contribute at `state`.
    fn sum(
        &self,
        state: &State,
        prior: Option<Contribution>,
        factors: Vec<Contribution>,
    ) -> Linearization {
        let mut equations = self.no_equations();
        let mut cost = 0.0;
        for part in prior.iter().chain(&factors) {
            equations += &part.equations;
            cost += part.cost + part.noise.cost;
        }
        let mut marginal = None;
        if let Some(patches) = &self.patches {
            if let Some(complement) = equations.marginalize(patches.precision()) {
                let SchurComplement { rest, gain, log_determinant } = complement;
                cost -= gain;
                equations = rest;
                let patches = Arc::clone(patches);
                marginal = Some(Marginal { patches, log_determinant });
            } else {
                equations = equations.without_auxiliary();
            }
        }
        Linearization { state: state.clone(), cost, equations, prior, factors, marginal }
    }
}

impl Solver {
    fn method(&self) -> LevenbergMarquardt {
        let criteria = Criteria {
            iterations: self.iterations,
            gradient: 0.0,
            step: 0.0,
            decrease: 0.0,
            predicted_decrease: self.min_decrease,
        };
        LevenbergMarquardt { criteria, ..LevenbergMarquardt::default() }
    }
}

impl LeastSquares for Problem {
    type Point = State;
    type Linearization = Linearization;

    /// The cost about `state`.
    fn linearize(&self, state: &State) -> Linearization {
        self.linearize_all(slice::from_ref(state)).remove(0)
    }

    /// The costs about several states: factors side by side, each with all states.
    fn linearize_all(&self, states: &[State]) -> Vec<Linearization> {
        let contributions = |factor: &dyn Factor| {
            let mut equations = vec![self.no_equations(); states.len()];
            let costs = factor.linearize_all(states, &mut equations);
            let each = costs.into_iter().zip(equations);
            let of = |(cost, equations)| self.contribution(factor, cost, equations);
            each.map(of).collect::<Vec<_>>()
        };
        let of_factors = self.factors.par_iter().map(|factor| contributions(factor.as_ref()));
        let of_factors: Vec<Vec<Contribution>> = of_factors.collect();
        let mut by_state: Vec<_> = states.iter().map(|state| (state, None, Vec::new())).collect();
        for of_factor in of_factors {
            by_state.iter_mut().zip(of_factor).for_each(|(at, part)| at.2.push(part));
        }
        if let Some(prior) = &self.prior {
            let of_prior = contributions(prior.as_ref());
            by_state.iter_mut().zip(of_prior).for_each(|(at, part)| at.1 = Some(part));
        }
        by_state
            .into_par_iter()
            .map(|(state, prior, parts)| self.sum(state, prior, parts))
            .collect()
    }

    fn retract(&self, state: &State, step: &[f64]) -> State {
        state.retract(&self.blocks, step)
    }
}

#[cfg(test)]
mod tests {
    use prehend_geometry::SplitMix64;

    use super::*;
    use crate::scene::{Frame, ModelErrorSettings};
    use crate::scene::{PreparedFrame, default_scene};

    /// Measurements that are linear in the object's twist and the displacements of patches.
    struct LinearProblem {
        residuals: DVector<f64>,
        by_twist: DMatrix<f64>,
        by_patches: DMatrix<f64>,
        weight: f64,
    }

    impl Factor for LinearProblem {
        fn name(&self) -> &'static str {
            "linear"
        }

        fn cost(&self, _state: &State) -> f64 {
            0.5 * self.weight * self.residuals.norm_squared()
        }

        fn linearize(&self, state: &State, equations: &mut NormalEquations) -> f64 {
            let columns = self.by_twist.column_iter().chain(self.by_patches.column_iter());
            let columns: Vec<_> = columns.map(|c| c.into_owned()).collect();
            let j = DMatrix::from_columns(&columns);
            let (gradient, hessian) = (j.tr_mul(&self.residuals), j.tr_mul(&j));
            let (gradient, hessian) = (gradient * self.weight, hessian * self.weight);
            if equations.displacements() > 0 {
                equations.add_with_auxiliary(&[Block::ObjectPose], &gradient, &hessian);
            } else {
                equations.add(&[Block::ObjectPose], &gradient, &hessian);
            }
            self.cost(state)
        }
    }

    /// Promises a way down where there is none.
    struct FlatProblem;

    impl Factor for FlatProblem {
        fn name(&self) -> &'static str {
            "flat"
        }

        fn cost(&self, _state: &State) -> f64 {
            1.0
        }

        fn linearize(&self, state: &State, equations: &mut NormalEquations) -> f64 {
            let (gradient, hessian) = (DVector::repeat(6, 1.0), DMatrix::identity(6, 6));
            equations.add(&[Block::ObjectPose], &gradient, &hessian);
            self.cost(state)
        }
    }

    #[test]
    fn a_solve_can_be_aborted_between_steps_that_lead_nowhere() {
        let scene = default_scene(1).unwrap();
        let bare = Frame { hand: None, ..scene.frame.clone() };
        let frame = PreparedFrame::new(&bare, &scene.object).unwrap();
        let state = State::new(&frame, &scene.truth).unwrap();
        let problem = Problem::new(vec![Arc::new(FlatProblem)], vec![Block::ObjectPose]);
        let mut steps = Vec::new();
        let solver = Solver { iterations: 10, min_decrease: 1e-9 };
        let solution = problem.solve(problem.linearize(&state), &solver, |down| {
            steps.push(down);
            if steps.len() < 3 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        assert_eq!((solution.termination, steps), (Termination::Aborted, vec![false; 3]));
        assert_eq!(solution.at.state.t_cam_object, state.t_cam_object);
        assert_eq!(solution.iterations, 0);
    }

    #[test]
    fn eliminating_patches_is_integrating_them_out() {
        let scene = default_scene(1).unwrap();
        let bare = Frame { hand: None, ..scene.frame.clone() };
        let frame = PreparedFrame::new(&bare, &scene.object).unwrap();
        let state = State::new(&frame, &scene.truth).unwrap();
        let settings = ModelErrorSettings::default();
        let patches = SurfacePatches::new(&scene.frame, state.center().z, &settings, 2).unwrap();
        let mut random = SplitMix64::new(5);
        let (rows, size) = (40, 3 * patches.count());
        let mut matrix =
            |columns, scale: f64| DMatrix::from_fn(rows, columns, |_, _| scale * random.normal());
        let (by_twist, by_patches) = (matrix(6, 1.0), matrix(size, 1.0));
        let residuals = matrix(1, 1e-3).column(0).into_owned();
        let weight = 0.5e-3f64.powi(-2);
        let prior = patches.precision().clone().cholesky().unwrap().inverse();
        let covariance =
            &by_patches * prior.kronecker(&DMatrix::identity(3, 3)) * by_patches.transpose()
                + DMatrix::identity(rows, rows) / weight;
        let information = covariance.cholesky().unwrap().inverse();
        let expected = (
            0.5 * residuals.dot(&(&information * &residuals)),
            by_twist.tr_mul(&(&information * &residuals)),
            by_twist.tr_mul(&(&information * &by_twist)),
        );
        let linear = LinearProblem { residuals, by_twist, by_patches, weight };
        let rigid = Problem::new(vec![Arc::new(linear)], vec![Block::ObjectPose]);
        let problem = rigid.clone().with_patches(Some(Arc::new(patches)));
        let at = problem.linearize(&state);
        assert_eq!(at.equations.blocks(), [Block::ObjectPose]);
        assert!((at.cost / expected.0 - 1.0).abs() < 1e-8);
        let close = |a: &DMatrix<f64>, b: &DMatrix<f64>| (a - b).amax() < 1e-8 * b.amax();
        let gradient = |g: &DVector<f64>| DMatrix::from_column_slice(6, 1, g.as_slice());
        assert!(close(&gradient(at.equations.gradient()), &gradient(&expected.1)));
        assert!(close(at.equations.hessian(), &expected.2));
        // At fixed patches there is more information, and more to pay.
        let rigid = rigid.linearize(&state);
        assert!(rigid.cost > at.cost);
        assert!(rigid.equations.hessian()[(0, 0)] > at.equations.hessian()[(0, 0)]);
        let alone = &at.factors[0].equations;
        assert_eq!(alone.hessian(), rigid.equations.hessian());
    }
}
