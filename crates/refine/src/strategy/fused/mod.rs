//! The fused estimator: all evidence in one robust nonlinear least-squares problem.

mod confidence;
mod evidence;
mod exactness;
mod factor;
mod settings;
mod solve;
mod summary;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use nalgebra::Translation3;
use prehend_autodiff::lie::so3_log;
use rayon::prelude::*;

pub use self::confidence::{
    CovarianceInflation, Hypothesis, Inconsistency, Posterior, UnobservableDirection,
};
pub(crate) use self::confidence::{RIDGE, chi_square_z};
pub(crate) use self::evidence::FrameContext;
pub(crate) use self::factor::Factor;
pub use self::settings::{Evidence, FusedSettings, Nuisance, Stage};
pub use self::solve::Termination;
pub(crate) use self::solve::{Point, Problem};
pub use self::summary::PosteriorSummary;
use crate::error::RefineError;
use crate::factor::NoiseEstimate;
use crate::problem::{Block, State};
use crate::scene::{Hand, Object, Observation};
use crate::strategy::{Iteration, Trace};

/// Gauss–Newton on all evidence at once, with the quantities that are not known exactly estimated beside the pose.
///
/// Terms are negative log-likelihoods, so their sum is that of the posterior, up to a constant. From coarse to fine: small
/// images and tolerant losses first.
pub struct Fused {
    /// Settings.
    pub settings: FusedSettings,
}

impl Fused {
    /// Walks from `initial`, calling `visit` with the best pose after every stage; ends when that returns false.
    ///
    /// # Errors
    /// If the observation or the settings are at fault.
    pub fn run(
        &self,
        observation: &Observation,
        object: &Arc<Object>,
        robot: Option<&Arc<Hand>>,
        initial: State,
        mut visit: impl FnMut(&State, &Iteration) -> bool,
    ) -> Result<(Trace, Posterior), RefineError> {
        let mut settings = self.settings.clone();
        if settings.stages.is_empty() {
            return Err(RefineError::Setting { name: "stages", problem: "are missing".into() });
        }
        let known = FrameContext::new(observation, object, robot)?;
        let mut states = self.starts(&initial);
        let mut trace = Trace::new(["posterior"].into_iter());
        let mut found = Vec::new();
        let mut go_on = true;
        let mut step = |point: &Point, trace: &mut Trace| {
            let index = trace.iterations.len();
            let values = vec![point.value];
            let iteration = Iteration { index, values, weights: vec![1.0], step: 0.0 };
            let go_on = visit(&point.state, &iteration);
            trace.iterations.push(iteration);
            go_on
        };
        for (index, stage) in self.settings.stages.iter().enumerate() {
            let patches = known.patches(&initial, stage, &settings);
            if stage.measured_scatter
                && let Some(scatter) = known.scatter(&states[0], &self.settings)
            {
                settings.depth.sigma = scatter.own.clamp(FINEST, COARSEST);
                // The model's part of it is what patches are off by.
                let model = patches.as_ref().map_or(0.0, |_| settings.model.deviation);
                let shared = (scatter.shared.powi(2) - model.powi(2)).max(0.0).sqrt();
                settings.depth.deviation = shared.min(COARSEST);
                settings.depth.effective_points = settings.max_effective_samples;
            }
            let problem = known.problem(&initial, stage, &settings, patches)?;
            let solve_from = |state: &State| {
                let start = problem.at(state.clone());
                problem.solve(start, stage.iterations, stage.min_decrease, |_| true)
            };
            states.truncate(stage.hypotheses.max(1));
            let solve_all =
                |states: &[State]| states.par_iter().map(solve_from).collect::<Vec<_>>();
            found = if index == 0 {
                let first = solve_from(&states[0]);
                let scatter = || known.scatter(&first.0.state, &self.settings);
                let others =
                    if settled(&first.0, scatter, object.radius) { 1 } else { states.len() };
                let mut all = solve_all(&states[1..others]);
                all.insert(0, first);
                all
            } else {
                solve_all(&states)
            };
            found = distinct(found, object.radius);
            // Not by the first stage, which sees no colors.
            if index > 0 {
                let limit = found[0].0.value + settings.prune_margin;
                // One that is still on its way down is not judged yet, and the best stays whatever its value.
                let mut best = true;
                found.retain(|(point, ending)| {
                    let kept = best || *ending == Termination::Iterations || point.value <= limit;
                    best = false;
                    kept
                });
            }
            states = found.iter().map(|(point, _)| point.state.clone()).collect();
            if index == 0
                && let Some(next) = settings.stages.get(1)
            {
                // Where it is, geometry finds well; how it is turned, colors may say better from where they were told. And
                // what little is seen of the object may have led astray.
                let mut turned_back = states[0].clone();
                let moved = states[0].center() - initial.center();
                states.truncate(KEPT.min(next.hypotheses.saturating_sub(2).max(1)));
                turned_back.t_cam_object = Translation3::from(moved) * initial.t_cam_object;
                states.extend([turned_back, initial.clone()]);
                let more = next.hypotheses.saturating_sub(states.len());
                let point = &found[0].0;
                states.extend(spread(point, &initial, settings.spread, object.radius, more));
            }
            go_on = step(&found[0].0, &mut trace);
            if !go_on {
                break;
            }
        }
        let odds = || exactness::log_odds_of_exact(&found[0].0);
        let exact =
            go_on && settings.exactness && odds().is_some_and(|odds| odds > exactness::EXACT);
        if exact {
            let last = &self.settings.stages[self.settings.stages.len() - 1];
            let as_said = |(point, _): &(Point, Termination)| State {
                t_cam_hand: initial.t_cam_hand,
                joints: initial.joints.clone(),
                camera: initial.camera,
                ..point.state.clone()
            };
            states = found.iter().map(as_said).collect();
            // Then depth's errors are not alike over whole patches either.
            settings.depth.deviation = 0.0;
            if let Some(scatter) = known.scatter(&states[0], &self.settings) {
                settings.depth.sigma = scatter.sigma.clamp(FINEST, COARSEST);
                settings.depth.effective_points = scatter.effective_points;
            }
            let problem = Problem {
                blocks: vec![Block::ObjectPose],
                ..known.problem(&initial, last, &settings, None)?
            };
            let solve_from = |state: &State| {
                let start = problem.at(state.clone());
                problem.solve(start, last.iterations, last.min_decrease, |_| true)
            };
            found = distinct(states.par_iter().map(solve_from).collect(), object.radius);
            step(&found[0].0, &mut trace);
        }
        Ok((trace, Posterior::new(&found, settings.width, object.radius, exact, None)))
    }

    /// The initial state and those it is turned to.
    fn starts(&self, initial: &State) -> Vec<State> {
        let mut starts = vec![initial.clone()];
        let angle = self.settings.turns;
        if angle > 0.0 {
            for axis in 0..3 {
                for turn in [angle, -angle] {
                    let mut twist = [0.0; 6];
                    twist[3 + axis] = turn;
                    starts.push(initial.moved(Block::ObjectPose, &twist));
                }
            }
        }
        starts
    }
}

/// Standard deviations of depth points that are believed when measured \[m\].
const FINEST: f64 = 2e-4;
const COARSEST: f64 = 3e-3;

/// Solutions of geometry alone that are taken up: where they differ, starts spread about them say more than they do.
const KEPT: usize = 4;

/// How wide the posterior may be in any direction \[m of surface motion\], and how far depth points may be from the surface \[m\],
/// for a first solution that needs no others beside it.
const SETTLED_WIDTH: f64 = 6e-3;
const SETTLED_SCATTER: f64 = 1.5e-3;

/// Surface motion between poses that are the same solution \[m\].
const SAME: f64 = 2e-3;

/// Whether `point` leaves no direction open and the surface lies where depth was measured.
fn settled(point: &Point, scatter: impl FnOnce() -> Option<NoiseEstimate>, radius: f64) -> bool {
    let widest = confidence::principal_directions(point, radius)[0].1;
    widest < SETTLED_WIDTH && scatter().is_some_and(|scatter| scatter.sigma < SETTLED_SCATTER)
}

/// Solutions of which no two are the same pose, the one of the lowest value first.
fn distinct(mut found: Vec<(Point, Termination)>, radius: f64) -> Vec<(Point, Termination)> {
    found.sort_by(|a, b| a.0.value.total_cmp(&b.0.value));
    let mut kept: Vec<(Point, Termination)> = Vec::new();
    for solution in found {
        let state = &solution.0.state;
        let same = |(other, _): &(Point, Termination)| {
            let turn = state.t_cam_object.rotation.angle_to(&other.state.t_cam_object.rotation);
            (state.center() - other.state.center()).norm() + radius * turn < SAME
        };
        if !kept.iter().any(same) {
            kept.push(solution);
        }
    }
    kept
}

/// At most `count` states along the directions in which the posterior about `point` is open so far, the widest first: at multiples of
/// `distance` of surface motion from where such a direction comes nearest to `initial`.
///
/// Geometry that leaves a turn open drifts along it, tens of degrees from where the initial pose was, so that is where to look first. And four
/// deviations wide, since first solutions of hardly any difference in value lie farther apart than the curvature about the best of them has it.
fn spread(point: &Point, initial: &State, distance: f64, radius: f64, count: usize) -> Vec<State> {
    let state = &point.state;
    let moved = initial.center() - state.center();
    let turned = so3_log(&(initial.t_cam_object.rotation * state.t_cam_object.rotation.inverse()));
    let mut states = Vec::new();
    for (twist, deviation) in confidence::principal_directions(point, radius) {
        let (place, turn) = (twist.fixed_rows::<3>(0), twist.fixed_rows::<3>(3));
        // The direction is a unit vector where turns count as what they move the surface by.
        let nearest = place.dot(&moved) + radius * radius * turn.dot(&turned);
        let reach = ((4.0 * deviation / distance) as i32).min(4);
        if reach == 0 {
            break;
        }
        let steps = std::iter::once(0).chain((1..=reach).flat_map(|step| [step, -step]));
        for step in steps {
            let along = nearest + distance * f64::from(step);
            if along.abs() > 0.5 * distance {
                states.push(state.moved(Block::ObjectPose, (twist * along).as_slice()));
            }
        }
    }
    states.truncate(count);
    states
}
