//! A run of the fused estimator: stages from coarse to fine, and the hypotheses that they take up.

use std::ops::ControlFlow;
use std::sync::Arc;

use nalgebra::Translation3;

use super::Fused;
use super::factors::depth_noise;
use super::fit::Fit;
use super::hypotheses::{
    conventions, distinct, hypotheses, lowest, restarts, settled, spread, turned, with_rotations,
};
use super::posterior::{Posterior, log_mass};
use super::scales::{ScaleEvidence, noise_scale};
use super::settings::{FusedSettings, HypothesisSettings, Stage};
use crate::error::RefineError;
use crate::factor::{ErrorGroup, GaussianPrior, Scales};
use crate::problem::{NoiseScales, Problem, Solution, Solver, State, Termination};
use crate::scene::PreparedFrame;
use crate::strategy::{Estimate, Iteration, Observer, Recorder};

/// The factor of color and silhouette.
const IMAGE: &str = "rendering";

/// A refinement under way.
pub(super) struct FusedRun<'a> {
    fused: &'a Fused,
    frame: &'a PreparedFrame<'a>,
    initial: &'a State,
    is_rotation_unknown: bool,
    /// With what was measured of depth's noise.
    settings: FusedSettings,
    scales: Scales,
    prior: Arc<GaussianPrior>,
    noise: NoiseScales,
}

impl<'a> FusedRun<'a> {
    pub(super) fn new(
        fused: &'a Fused,
        frame: &'a PreparedFrame<'a>,
        initial: &'a State,
    ) -> Result<Self, RefineError> {
        let scales = Scales::default();
        Ok(Self {
            prior: Arc::new(fused.prior(frame, initial, &scales)?),
            is_rotation_unknown: fused.is_rotation_unknown(),
            settings: fused.settings_for(frame),
            fused,
            frame,
            initial,
            scales,
            noise: NoiseScales::new(),
        })
    }

    /// All stages, unless `observe` breaks off, and the posterior about what they find.
    pub(super) fn finish(mut self, observe: &mut Observer<'_>) -> Result<Estimate, RefineError> {
        let count = self.stages().len();
        let names = std::iter::once("posterior");
        let mut recorder = Recorder::new(names, self.initial, count, None, observe);
        let mut states =
            hypotheses(self.initial, self.fused.alternatives.as_deref().unwrap_or_default());
        if !self.is_rotation_unknown && states.len() == 1 {
            states = restarts(self.initial, self.hypotheses().restart_angle);
        }
        let mut found = Vec::new();
        let mut flow = ControlFlow::Continue(());
        let mut before = None;
        for index in 0..count {
            let problem = self.problem(index, &states[0])?;
            found = self.solve(index, &problem, &states);
            if let (1, Some(geometry)) = (index, &before) {
                found.extend(self.other_conventions(geometry, &problem, &found[0]));
                found = self.distinct(found);
            }
            found = self.conclude(index, found)?;
            states = self.next_starts(index, self.initial, &found);
            flow = record(&mut recorder, &found[0]);
            if flow.is_break() {
                break;
            }
            before = Some(problem);
        }
        let radius = self.radius();
        let evidence = match &self.fused.rig {
            Some(_) => None,
            None => self.scale_evidence(&found[0]),
        };
        if let Some(evidence) = &evidence {
            self.scales = evidence.learn(&self.scales).unwrap_or(self.scales);
        }
        let mut posterior = Posterior::new(&found, radius, &self.settings.posterior);
        let moments = evidence.and_then(|evidence| evidence.pose_moments(&self.scales));
        if let Some(moments) = moments {
            posterior.mix(&moments, radius);
        }
        posterior.scales = self.scales.clone();
        if flow.is_continue() {
            let nominal = &self.fused.settings;
            let noise = depth_noise(self.frame, &found[0].at.state, nominal);
            let noise = noise.map(|noise| (noise, nominal.depth.noise.sigma));
            let (scales, settings) = (&self.scales, &nominal.fit);
            let camera = &self.frame.observation().camera;
            let fit = Fit::new(camera, &found[0].at, scales, noise, &nominal.scales, settings);
            posterior.fit = Some(fit);
        }
        Ok(recorder.estimate(Some(posterior)))
    }

    fn stages(&self) -> &'a [Stage] {
        &self.fused.settings.stages
    }

    fn hypotheses(&self) -> &'a HypothesisSettings {
        &self.fused.settings.hypotheses
    }

    fn distinct(&self, found: Vec<Solution>) -> Vec<Solution> {
        distinct(found, self.frame.object(), self.hypotheses().same)
    }

    fn radius(&self) -> f64 {
        self.frame.object().radius
    }

    /// The evidence of scales at `solution`.
    fn scale_evidence(&self, solution: &Solution) -> Option<ScaleEvidence> {
        ScaleEvidence::new(&solution.at, &self.scales, &self.settings.scales)
    }

    /// Scales of the factors' noise at `solution`.
    fn noise_at(&self, solution: &Solution) -> NoiseScales {
        let parts = solution.at.factors.iter();
        let scale = |chi, degrees| noise_scale(chi, degrees, &self.settings.scales);
        parts.map(|p| (p.name, scale(p.chi_square(), p.equations.degrees()))).collect()
    }

    /// Solutions of `problem`, each with the scales of noise that fit it best, and no two the same, that of the lowest cost first.
    fn compared(&self, problem: &Problem, found: Vec<Solution>) -> Vec<Solution> {
        let with_own = |solution: Solution| {
            let noise = self.noise_at(&solution);
            let mut at = problem.rescale(solution.at, &noise);
            let image = at.factors.iter().filter(|part| part.name == IMAGE);
            let of_image: f64 = image.map(|part| part.cost + part.noise.cost).sum();
            at.cost += (self.hypotheses().image_between_modes - 1.0) * of_image;
            Solution { at, ..solution }
        };
        self.distinct(found.into_iter().map(with_own).collect())
    }

    /// Learns scales at `solution`, and takes errors to be of these sizes from here on.
    fn learn(&mut self, solution: &Solution) -> Result<(), RefineError> {
        // A rig's errors were learnt from many frames.
        if self.fused.rig.is_some() {
            return Ok(());
        }
        let Some(learnt) =
            self.scale_evidence(solution).and_then(|evidence| evidence.learn(&self.scales))
        else {
            return Ok(());
        };
        self.scales = learnt;
        self.prior = Arc::new(self.fused.prior(self.frame, self.initial, &self.scales)?);
        let nominal = self.fused.settings_for(self.frame).patches.sigma;
        self.settings.patches.sigma = nominal * self.scales.get(ErrorGroup::Surface);
        Ok(())
    }

    /// The problem of stage `index` with noise as it is at `seen`.
    fn problem(&mut self, index: usize, seen: &State) -> Result<Problem, RefineError> {
        let (fused, frame, initial) = (self.fused, self.frame, self.initial);
        let stage = &fused.settings.stages[index];
        let problem = fused.stage_problem(frame, initial, seen, stage, &mut self.settings)?;
        Ok(problem.with_noise(self.noise.clone()).with_prior(self.prior.clone()))
    }

    /// The distinct solutions of `problem`, that of stage `index`, from `states`, the best one first.
    fn solve(&self, index: usize, problem: &Problem, states: &[State]) -> Vec<Solution> {
        let solver = &self.stages()[index].solver;
        let states = &self.taken_up(index, states, problem);
        if index > 0 {
            let states = self.shortlisted(index, states, problem);
            return self.compared(problem, problem.solve_all(&states, solver));
        }
        // Not so in the first stage, which sees no colors.
        let first = if self.is_rotation_unknown { states.len() } else { 1 };
        let mut found = problem.solve_all(&states[..first], solver);
        let nominal = &self.fused.settings;
        let noise = || depth_noise(self.frame, &found[0].at.state, nominal);
        let limits = [self.hypotheses().settled_sigma, nominal.depth.noise.sigma];
        if first < states.len() && !settled(&found[0].at, noise, self.radius(), limits) {
            found.extend(problem.solve_all(&states[first..], solver));
        }
        self.distinct(found)
    }

    /// Modes among those `found` by stage `index` that are taken further, the best one first; sizes of errors are learnt there.
    fn conclude(
        &mut self,
        index: usize,
        mut found: Vec<Solution>,
    ) -> Result<Vec<Solution>, RefineError> {
        if index > 0 {
            self.noise = self.noise_at(&found[0]);
            let limit = found[0].at.cost + self.hypotheses().prune_margin;
            // One that is still on its way down is not judged yet, and the best stays whatever its cost.
            let mut best = true;
            found.retain(|solution| {
                let unfinished = solution.termination == Termination::Iterations;
                let kept = best || unfinished || solution.at.cost <= limit;
                best = false;
                kept
            });
            self.learn(&found[0])?;
        }
        if index + 1 == self.stages().len() {
            // Modes compare by their mass rather than their height.
            let ranked = found.into_iter().map(|solution| (log_mass(&solution.at), solution));
            let mut ranked: Vec<_> = ranked.collect();
            ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
            found = ranked.into_iter().map(|(_, solution)| solution).collect();
        }
        Ok(found)
    }

    /// Modes beside `best`, a solution of `problem`, that of the second stage, with initial rotations of other conventions. After a few steps of
    /// `geometry`, that of the first stage, the best of them is found as that of a right initial rotation is, if it is better than `best`.
    fn other_conventions(
        &self,
        geometry: &Problem,
        problem: &Problem,
        best: &Solution,
    ) -> Vec<Solution> {
        if self.is_rotation_unknown {
            return Vec::new();
        }
        let &HypothesisSettings { another, alternative_steps: iterations, .. } = self.hypotheses();
        let conventions = |state: &State| conventions(&state.t_cam_object.rotation, another);
        let others = with_rotations(self.initial, &conventions(self.initial), another);
        let state = &best.at.state;
        let of_best = with_rotations(state, &conventions(state)[..3], another);
        let starts = [others.clone(), of_best].concat();
        let steps = Solver { iterations, ..self.stages()[0].solver };
        let near = geometry.solve_all(&starts, &steps).into_iter().map(|found| found.at.state);
        let near: Vec<State> = near.collect();
        let limit = self.hypotheses().hopeless * problem.cost(&best.at.state);
        let costs = problem.cost_all(&near);
        let hopeful = near.into_iter().zip(costs).filter(|(_, cost)| *cost < limit);
        let (near, costs): (Vec<State>, Vec<f64>) = hopeful.unzip();
        let near = lowest(&near, &costs, others.len());
        let mut found = self.compared(problem, problem.solve_all(&near, &self.stages()[1].solver));
        let limit = best.at.cost + 2.0 * self.hypotheses().prune_margin;
        found.retain(|other| other.at.cost < limit);
        if let Some(winner) = found.first().filter(|other| other.at.cost < best.at.cost) {
            let rotation = winner.at.state.t_cam_object.rotation;
            let angle = |state: &&State| state.t_cam_object.rotation.angle_to(&rotation);
            let start = others.iter().min_by(|a, b| angle(a).total_cmp(&angle(b)));
            if let Some(start) = start {
                let starts = restarts(start, self.hypotheses().restart_angle);
                let first = self.solve(0, geometry, &starts);
                found.extend(self.solve(1, problem, &self.next_starts(0, start, &first)));
            }
        }
        found
    }

    /// Those of `states` that stage `index`, which solves `problem`, takes up.
    fn taken_up(&self, index: usize, states: &[State], problem: &Problem) -> Vec<State> {
        let usual = self.stages()[index].hypotheses.max(1);
        if !self.is_rotation_unknown {
            return states[..states.len().min(usual)].to_vec();
        }
        // Near symmetries are many.
        let limit = 4 * usual;
        if states.len() <= limit {
            return states.to_vec();
        }
        lowest(states, &problem.cost_all(states), limit)
    }

    /// Those of `states` that stage `index`, which solves `problem`, solves to the end: while they are more than usual, half of them are given up after a few steps.
    fn shortlisted(&self, index: usize, states: &[State], problem: &Problem) -> Vec<State> {
        let Stage { hypotheses, solver, .. } = &self.stages()[index];
        let few = Solver { iterations: self.hypotheses().shortlist_steps, ..*solver };
        let (mut states, usual) = (states.to_vec(), (*hypotheses).max(1));
        while states.len() > usual {
            let found = self.compared(problem, problem.solve_all(&states, &few)).into_iter();
            states = found.take(usual.max(states.len() / 2)).map(|found| found.at.state).collect();
        }
        states
    }

    /// Where the stage after `index` starts, which found these solutions from `initial`.
    fn next_starts(&self, index: usize, initial: &State, found: &[Solution]) -> Vec<State> {
        let mut states: Vec<State> = found.iter().map(|found| found.at.state.clone()).collect();
        let Some(next) = self.stages().get(1).filter(|_| index == 0) else { return states };
        // Where it is, geometry finds well; how it is turned, colors may say better from where they were told. And
        // what little is seen of the object may have led astray.
        if self.is_rotation_unknown {
            // Which of them it is, colors say, that were not considered yet.
            states.extend(turned(&states, self.frame.object().near_symmetries()));
            return states;
        }
        let mut turned_back = states[0].clone();
        let moved = states[0].center() - initial.center();
        // Where solutions of geometry alone differ, starts spread about them say more than they do.
        states.truncate((next.hypotheses / 3).max(1));
        turned_back.t_cam_object = Translation3::from(moved) * initial.t_cam_object;
        states.extend([turned_back, initial.clone()]);
        let more = next.hypotheses.saturating_sub(states.len());
        let (best, settings) = (&found[0].at, self.hypotheses());
        states.extend(spread(best, initial, settings, self.radius(), more));
        states
    }
}

/// Records the best solution of a stage.
fn record(recorder: &mut Recorder<'_, '_>, best: &Solution) -> ControlFlow<()> {
    let (index, values) = (recorder.count(), vec![best.at.cost]);
    let iteration = Iteration { index, values, weights: vec![1.0], step: 0.0 };
    recorder.visit(&best.at.state, iteration, None)
}
