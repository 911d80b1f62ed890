//! The paper's heuristic: a candidate step along every gradient, weighted by what each one achieves.

use std::sync::Arc;

use nalgebra::{Matrix6, Vector6};
use prehend_autodiff::Quadratic;
use rayon::prelude::*;
use strum::{Display, EnumString, IntoStaticStr, VariantNames};

use super::chamfer_depth::{ChamferDepthFactor, ChamferDepthSettings};
use super::stability::{StabilityFactor, StabilitySettings};
use super::step::damped_step;
use super::{rendering_settings, tactile_settings};
use crate::error::RefineError;
use crate::factor::{RenderingFactor, RenderingSettings, TactileFactor, TactileSettings};
use crate::problem::{Block, Factor, NormalEquations, State};
use crate::scene::PreparedFrame;
use crate::strategy::{Estimate, Fused, Iteration, Observer, Recorder, Strategy};

/// Damping of candidate steps, as a part of the mean curvature.
const DAMPING: f64 = 1e-3;

/// One of the paper's four gradients.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, Hash, Display, EnumString, IntoStaticStr, VariantNames,
)]
#[strum(serialize_all = "kebab-case", parse_err_ty = String, parse_err_fn = unknown)]
pub enum GradientKind {
    /// Stability of the grasp, by simulation: [`StabilityFactor`].
    Physics,
    /// Color and silhouette: [`RenderingFactor`].
    Rendering,
    /// Depth points: [`ChamferDepthFactor`].
    Depth,
    /// Taxels: [`TactileFactor`].
    Tactile,
}

impl GradientKind {
    /// All four, in the order of the paper.
    pub const ALL: [Self; 4] = [Self::Physics, Self::Rendering, Self::Depth, Self::Tactile];

    /// The name used in reports and on the command line.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

fn unknown(text: &str) -> String {
    format!("unknown term {text:?}: one of {}", GradientKind::VARIANTS.join(", "))
}

/// The paper's heuristic.
///
/// Each iteration takes one candidate step along the gradient of every factor, measures the change ΔLᵢ of
/// that factor's own value, weighs it αᵢ ∝ max(0, −ΔLᵢ), Σαᵢ = 1, and applies the weighted sum of the steps.
/// Three things that the paper leaves open are settled so:
///
/// - *Scales of the gradients.* A step is −(Hᵢ + μ)⁻¹ gᵢ with the factor's own Gauss–Newton matrix Hᵢ, so
///   translations and rotations of any factor come out in the right proportion.
/// - *Scales of the losses.* Factors are in nats ([`Factor`]), so that ΔLᵢ of different factors compare.
/// - *Step lengths.* Steps are at most a common length that grows by a tenth while the sum of the factors
///   reaches new lows, shrinks by a tenth when it does not, and by half when nothing improves. Without it
///   the factors take turns in pulling the pose all the way to their own optimum, and the weights, which
///   always sum to one, never let it rest.
#[derive(Clone, Debug)]
pub struct Heuristic {
    /// Gradients to use.
    pub gradients: Vec<GradientKind>,
    /// Return the pose of lowest rendering cost seen, instead of the last one.
    pub checkpoint: bool,
    /// Iterations at most.
    pub iterations: usize,
    /// Length of the first candidate steps \[m\]; a rotation counts by how far it moves the object's surface.
    pub first_step: f64,
    /// The walk ends when candidate steps are shorter than this \[m\].
    pub step_tolerance: f64,
    /// Always run all the iterations, however small the steps become.
    pub exhaustive: bool,
    /// Settings of the physics gradient.
    pub stability: StabilitySettings,
    /// Settings of the rendering gradient, and of the checkpoint.
    pub rendering: RenderingSettings,
    /// Settings of the depth gradient.
    pub depth: ChamferDepthSettings,
    /// Settings of the tactile gradient.
    pub tactile: TactileSettings,
    /// Factors of one's own.
    pub factors: Vec<Arc<dyn Factor>>,
}

impl Heuristic {
    /// Over some gradients; returns the last pose.
    pub fn of(gradients: &[GradientKind]) -> Self {
        Self {
            gradients: gradients.to_vec(),
            checkpoint: false,
            iterations: 400,
            first_step: 5e-3,
            step_tolerance: 2e-6,
            exhaustive: false,
            stability: StabilitySettings::default(),
            rendering: rendering_settings(),
            depth: ChamferDepthSettings::default(),
            tactile: tactile_settings(),
            factors: Vec::new(),
        }
    }

    /// The paper's method: all four gradients; returns the pose whose rendering fits best.
    pub fn combined() -> Self {
        Self { checkpoint: true, ..Self::of(&GradientKind::ALL) }
    }

    /// With a factor of one's own.
    pub fn with(mut self, factor: impl Factor + 'static) -> Self {
        self.factors.push(Arc::new(factor));
        self
    }

    /// The factors of a frame, in the order of the gradients, then one's own.
    ///
    /// # Errors
    /// If the frame lacks what one of them needs.
    pub fn factors(
        &self,
        frame: &PreparedFrame<'_>,
        initial: &State,
    ) -> Result<Vec<Arc<dyn Factor>>, RefineError> {
        let factor = |kind: &GradientKind| -> Result<Arc<dyn Factor>, RefineError> {
            Ok(match kind {
                GradientKind::Physics => {
                    Arc::new(StabilityFactor::new(frame, initial, self.stability.clone())?)
                }
                GradientKind::Rendering => Arc::new(RenderingFactor::new(frame, &self.rendering)?),
                GradientKind::Depth => Arc::new(ChamferDepthFactor::new(frame, &self.depth)?),
                GradientKind::Tactile => Arc::new(TactileFactor::new(frame, &self.tactile)?),
            })
        };
        let mut factors: Vec<_> = self.gradients.iter().map(factor).collect::<Result<_, _>>()?;
        factors.extend(self.factors.iter().cloned());
        if factors.is_empty() { Err(RefineError::NoFactors) } else { Ok(factors) }
    }

    /// The factor whose lowest cost is the checkpoint, if it is among those that are walked down.
    fn judged(&self) -> Option<usize> {
        let rendering = |gradient: &GradientKind| *gradient == GradientKind::Rendering;
        self.gradients.iter().position(rendering).filter(|_| self.checkpoint)
    }

    /// Walks from `state`, down `factors`; `radius` is the object's \[m\].
    fn walk(
        &self,
        factors: &[Arc<dyn Factor>],
        mut state: State,
        radius: f64,
        recorder: &mut Recorder<'_, '_>,
    ) {
        let judged = self.judged();
        let mut length = self.first_step;
        let mut least = f64::INFINITY;
        for index in 0..=self.iterations {
            let candidates: Vec<CandidateStep> = factors
                .par_iter()
                .map(|factor| CandidateStep::of(factor.as_ref(), &state, radius, length))
                .collect();
            let total: f64 = candidates.iter().map(|c| c.cost).sum();
            let gain: f64 = candidates.iter().map(|c| c.gain).sum();
            let weight = |c: &CandidateStep| if gain > 0.0 { c.gain / gain } else { 0.0 };
            let weights: Vec<f64> = candidates.iter().map(weight).collect();
            let step: Vector6<f64> =
                weights.iter().zip(&candidates).map(|(&a, c)| c.step * a).sum();
            let values = candidates.iter().map(|c| c.cost).collect();
            let iteration = Iteration { index, values, weights, step: length };
            let score = judged.map(|judge| candidates[judge].cost);
            let go_on = recorder.visit(&state, iteration, score);
            let longest = candidates.iter().map(|c| c.length).fold(0.0, f64::max);
            let done = length.min(longest) < self.step_tolerance;
            if go_on.is_break() || (done && !self.exhaustive) {
                break;
            }
            length *= match gain > 0.0 {
                true if total < least => 1.1,
                true => 0.9,
                false => 0.5,
            };
            length = length.clamp(0.5 * self.step_tolerance, self.first_step);
            least = least.min(total);
            state = state.retract(&[Block::ObjectPose], step.as_slice());
        }
    }
}

impl Strategy for Heuristic {
    fn run(
        &self,
        frame: &PreparedFrame<'_>,
        initial: &State,
        observe: &mut Observer<'_>,
    ) -> Result<Estimate, RefineError> {
        let factors = self.factors(frame, initial)?;
        let judged = self.judged();
        let checkpoint = self.checkpoint && judged.is_none();
        let judge = checkpoint.then(|| RenderingFactor::new(frame, &self.rendering)).transpose()?;
        // The gradients' names rather than the factors', as options and files have them.
        let gradients = self.gradients.iter().map(|gradient| gradient.name());
        let names = gradients.chain(self.factors.iter().map(|factor| factor.name()));
        let mut recorder = Recorder::new(names, initial, self.iterations, judge, observe);
        self.walk(&factors, initial.clone(), frame.object().radius, &mut recorder);
        let mut estimate = recorder.estimate(None);
        // One gradient leaves directions open that the curvature of the others would call sure.
        if self.gradients.len() + self.factors.len() < 2 {
            return Ok(estimate);
        }
        // Of all evidence that there is. A frame that lacks what the fused estimator needs has none.
        let fused = Fused { factors: self.factors.clone(), ..Fused::default() };
        let posterior = fused.posterior_at(frame, initial, &estimate.state);
        estimate.posterior = posterior.unwrap_or_else(|error| {
            log::info!("no posterior: {error}");
            None
        });
        Ok(estimate)
    }

    fn iterations(&self) -> usize {
        self.iterations
    }
}

/// A step along one factor's gradient and what it does to that factor.
struct CandidateStep {
    cost: f64,
    /// Decrease of the factor's own cost by the step; 0 if there is none.
    gain: f64,
    step: Vector6<f64>,
    /// Length of `step`, where a rotation counts by how far it moves the object's surface \[m\].
    length: f64,
}

impl CandidateStep {
    fn of(factor: &dyn Factor, state: &State, radius: f64, length: f64) -> Self {
        // The step is judged by what it was made for.
        let conditional = factor.conditional_at(state);
        let factor = conditional.as_deref().unwrap_or(factor);
        let mut equations = NormalEquations::new(&[Block::ObjectPose]);
        let cost = factor.linearize(state, &mut equations);
        let gradient = Vector6::from_column_slice(equations.gradient().as_slice());
        let hessian = Matrix6::from_column_slice(equations.hessian().as_slice());
        let equations = Quadratic { value: cost, gradient, hessian };
        let (step, length) = damped_step(&equations, radius, DAMPING, length);
        let gain = cost - factor.cost(&state.retract(&[Block::ObjectPose], step.as_slice()));
        let gain = if gain.is_finite() { gain.max(0.0) } else { 0.0 };
        Self { cost, gain, step, length }
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use nalgebra::{Isometry3, Point3, Vector3, Vector6};

    use super::*;
    use crate::problem::{NoiseModel, Rows};
    use crate::scene::CameraCalibrationError;
    use crate::strategy::Trace;

    /// Half the squared distance of the object from a place, over a variance.
    struct Spring {
        place: Vector3<f64>,
        noise: NoiseModel,
    }

    impl Factor for Spring {
        fn name(&self) -> &'static str {
            "spring"
        }

        fn rows(&self, state: &State, rows: &mut Rows<'_>) {
            let offset = state.center() - self.place;
            for k in 0..3 {
                rows.add(offset[k], &self.noise.weighting(1), |row| {
                    row.block(Block::ObjectPose, Vector6::ith(k, 1.0).as_slice());
                });
            }
        }
    }

    fn spring(x: f64, sigma: f64) -> Arc<dyn Factor> {
        let noise = NoiseModel::gaussian(sigma);
        Arc::new(Spring { place: Vector3::new(x, 0.0, 0.5), noise })
    }

    fn run(factors: &[Arc<dyn Factor>], heuristic: &Heuristic) -> (State, Trace) {
        let start = State {
            t_cam_object: Isometry3::translation(0.03, 0.01, 0.5),
            object_center: Point3::origin(),
            t_cam_hand: Isometry3::identity(),
            joints: Vec::new(),
            camera: CameraCalibrationError::default(),
            views: Vec::new(),
        };
        let names = factors.iter().map(|factor| factor.name());
        let mut observe = |_: &_| ControlFlow::Continue(());
        let mut recorder = Recorder::new(names, &start, 0, None, &mut observe);
        heuristic.walk(factors, start.clone(), 0.1, &mut recorder);
        let estimate = recorder.estimate(None);
        (estimate.state, estimate.trace)
    }

    #[test]
    fn one_factor_is_minimized() {
        let (state, trace) = run(&[spring(0.0, 1e-3)], &Heuristic::of(&[]));
        assert!((state.center() - Vector3::new(0.0, 0.0, 0.5)).norm() < 1e-5);
        assert!(trace.iterations.len() < 60);
        assert_eq!(trace.iterations[0].weights, [1.0]);
    }

    #[test]
    fn factors_that_disagree_come_to_rest_near_the_minimum_of_their_sum() {
        // The sum is least at 0.01 · (1/3²) / (1/1² + 1/3²) = 1 mm.
        let factors = [spring(0.0, 1e-3), spring(0.01, 3e-3)];
        let (state, trace) = run(&factors, &Heuristic::of(&[]));
        assert!((state.center().x - 1e-3).abs() < 1e-4, "{}", state.center().x);
        let sum: f64 = trace.iterations.iter().map(|i| i.weights.iter().sum::<f64>()).sum();
        assert!((sum - trace.iterations.len() as f64).abs() < 1.0);
    }

    #[test]
    fn exhaustive_runs_use_every_iteration() {
        let heuristic = Heuristic { iterations: 80, exhaustive: true, ..Heuristic::of(&[]) };
        assert_eq!(run(&[spring(0.0, 1e-3)], &heuristic).1.iterations.len(), 81);
    }
}
