//! A run of the fused estimator: stages from coarse to fine, and the hypotheses that they take up.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::Arc;

use nalgebra::Translation3;

use super::Fused;
use super::factors::depth_noise;
use super::fit::Fit;
use super::hypotheses::{
    distinct, half_turns, hypotheses, lowest, restarts, settled, spread, transposed, turned,
};
use super::posterior::{Posterior, log_mass};
use super::scales::{ErrorGroup, ScaleEvidence, Scales, log_noise_scale};
use super::settings::{FusedSettings, Stage};
use crate::error::RefineError;
use crate::factor::GaussianPrior;
use crate::problem::{Problem, Solution, Solver, State, Termination};
use crate::scene::Frame;
use crate::strategy::estimate::Recorder;
use crate::strategy::{Estimate, Iteration, Observer};

/// Solutions of geometry alone that are taken up: where they differ, starts spread about them say more than they do.
const KEPT: usize = 4;

/// Where no rotation is known, the first stage, and the first that sees colors, take up so many hypotheses at most, …
const MOST_ALTERNATIVES: usize = 64;
/// … and later ones so many times as many as else.
const WITH_ALTERNATIVES: usize = 2;

/// Steps of geometry alone that an alternative pose is given before it is compared.
const ALTERNATIVE_STEPS: usize = 4;

/// A refinement under way.
pub(super) struct Run<'a> {
    fused: &'a Fused,
    frame: &'a Frame<'a>,
    initial: &'a State,
    is_rotation_unknown: bool,
    /// With what was measured of depth's noise.
    settings: FusedSettings,
    scales: Scales,
    prior: Arc<GaussianPrior>,
    /// Scales of the factors' noise.
    noise: BTreeMap<&'static str, f64>,
}

impl<'a> Run<'a> {
    pub(super) fn new(
        fused: &'a Fused,
        frame: &'a Frame<'a>,
        initial: &'a State,
    ) -> Result<Self, RefineError> {
        let scales = Scales::default();
        Ok(Self {
            prior: Arc::new(fused.prior(frame, initial, &scales)?),
            is_rotation_unknown: fused.is_rotation_unknown(frame),
            settings: fused.settings.for_frame(frame),
            fused,
            frame,
            initial,
            scales,
            noise: BTreeMap::new(),
        })
    }

    /// All stages, unless `observe` breaks off, and the posterior about what they find.
    pub(super) fn finish(mut self, observe: &mut Observer<'_>) -> Result<Estimate, RefineError> {
        let count = self.stages().len();
        let names = std::iter::once("posterior");
        let mut recorder = Recorder::new(names, self.initial, count, None, observe);
        let mut states = hypotheses(self.initial, self.frame.rivals().unwrap_or_default());
        if !self.is_rotation_unknown && states.len() == 1 {
            states = restarts(self.initial, self.settings.restart_angle);
        }
        let mut found = Vec::new();
        let mut flow = ControlFlow::Continue(());
        for index in 0..count {
            found = self.stage(index, &states)?;
            states = self.next_starts(index, &found);
            flow = record(&mut recorder, &found[0]);
            if flow.is_break() {
                break;
            }
        }
        let radius = self.radius();
        let evidence = match self.frame.rig() {
            Some(_) => None,
            None => self.scale_evidence(&found[0]),
        };
        if let Some(evidence) = &evidence {
            self.scales = evidence.learn(&self.scales).unwrap_or(self.scales);
        }
        let mut posterior = Posterior::new(&found, radius);
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
            let fit = Fit::new(&found[0].at, scales, noise, &nominal.scales, settings);
            posterior.fit = Some(fit);
        }
        Ok(recorder.estimate(Some(posterior)))
    }

    fn stages(&self) -> &'a [Stage] {
        &self.fused.settings.stages
    }

    fn radius(&self) -> f64 {
        self.frame.object().radius
    }

    /// The evidence of scales at `solution`.
    fn scale_evidence(&self, solution: &Solution) -> Option<ScaleEvidence> {
        ScaleEvidence::new(&solution.at, &self.scales, &self.settings.scales)
    }

    /// Learns the scales of the factors' noise at `solution`.
    fn learn_noise(&mut self, solution: &Solution) {
        for part in &solution.at.factors {
            let (chi_square, degrees) = (part.chi_square(), part.equations.degrees());
            let log = log_noise_scale(chi_square, degrees, &self.settings.scales);
            self.noise.insert(part.name, log.exp());
        }
    }

    /// Learns scales at `solution`, and takes errors to be of these sizes from here on.
    fn learn(&mut self, solution: &Solution) -> Result<(), RefineError> {
        // A rig's errors were learnt from many frames.
        if self.frame.rig().is_some() {
            return Ok(());
        }
        let Some(learnt) =
            self.scale_evidence(solution).and_then(|evidence| evidence.learn(&self.scales))
        else {
            return Ok(());
        };
        self.scales = learnt;
        self.prior = Arc::new(self.fused.prior(self.frame, self.initial, &self.scales)?);
        let nominal = self.fused.settings.for_frame(self.frame).model.gp_sigma;
        self.settings.model.gp_sigma = nominal * self.scales.get(ErrorGroup::Surface);
        Ok(())
    }

    /// The problem of stage `index` with noise as it is at `seen`.
    fn problem(&mut self, index: usize, seen: &State) -> Result<Problem, RefineError> {
        let (fused, frame, initial) = (self.fused, self.frame, self.initial);
        let stage = &fused.settings.stages[index];
        let of_stage = fused.stage_problem(frame, initial, seen, stage, &mut self.settings)?;
        let problem = of_stage.problem.with_noise(self.noise.clone());
        Ok(problem.with_prior(self.prior.clone()))
    }

    /// The distinct solutions of stage `index` from `states`, the best one first.
    fn stage(&mut self, index: usize, states: &[State]) -> Result<Vec<Solution>, RefineError> {
        let problem = self.problem(index, &states[0])?;
        let solver = &self.stages()[index].solver;
        let states = &self.taken_up(index, states, &problem);
        let found = if index == 0 && !self.is_rotation_unknown {
            let mut all = problem.solve_all(&states[..1], solver);
            let noise = || depth_noise(self.frame, &all[0].at.state, &self.fused.settings);
            if !settled(&all[0].at, noise, self.radius()) {
                all.extend(problem.solve_all(&states[1..], solver));
            }
            all
        } else {
            problem.solve_all(states, solver)
        };
        let mut found = distinct(found, self.radius());
        // Not by the first stage, which sees no colors.
        if index > 0 {
            self.learn_noise(&found[0]);
            for solution in &mut found {
                solution.at.reweigh(&self.noise);
            }
            if index == 1 {
                let problem = problem.with_noise(self.noise.clone());
                let others = self.alternatives(&problem, &found[0], solver)?;
                found.extend(others);
            }
            found = distinct(found, self.radius());
            let limit = found[0].at.cost + self.settings.prune_margin;
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

    /// Other modes than `best`, a solution of `problem`: half turns about the model's axes, and the transpose of the initial rotation, which some
    /// files have in its place. Those are given up that are not within reach of it after a few steps of geometry alone.
    fn alternatives(
        &mut self,
        problem: &Problem,
        best: &Solution,
        solver: &Solver,
    ) -> Result<Vec<Solution>, RefineError> {
        if self.is_rotation_unknown {
            return Ok(Vec::new());
        }
        let state = &best.at.state;
        let mut others = turned(std::slice::from_ref(state), &half_turns(self.frame.object()));
        others.extend(transposed(self.initial, state));
        let settings = self.settings.clone();
        let coarse = self.problem(0, state)?;
        self.settings = settings;
        let steps = Solver { iterations: ALTERNATIVE_STEPS, ..self.stages()[0].solver };
        let near: Vec<State> =
            coarse.solve_all(&others, &steps).into_iter().map(|s| s.at.state).collect();
        let costs = problem.cost_all(&near);
        let limit = best.at.cost + self.settings.prune_margin;
        let all = near.into_iter().zip(costs);
        let kept: Vec<State> =
            all.filter(|(_, cost)| *cost < limit).map(|(state, _)| state).collect();
        Ok(problem.solve_all(&kept, solver))
    }

    /// Those of `states` that stage `index`, which solves `problem`, takes up.
    fn taken_up(&self, index: usize, states: &[State], problem: &Problem) -> Vec<State> {
        let usual = self.stages()[index].hypotheses.max(1);
        if !self.is_rotation_unknown {
            return states[..states.len().min(usual)].to_vec();
        }
        let limit = if index < 2 { MOST_ALTERNATIVES } else { WITH_ALTERNATIVES * usual };
        if states.len() <= limit {
            return states.to_vec();
        }
        lowest(states, &problem.cost_all(states), limit)
    }

    /// Where the stage after `index` starts, which found these solutions.
    fn next_starts(&self, index: usize, found: &[Solution]) -> Vec<State> {
        let mut states: Vec<State> = found.iter().map(|found| found.at.state.clone()).collect();
        let Some(next) = self.stages().get(1).filter(|_| index == 0) else { return states };
        // Where it is, geometry finds well; how it is turned, colors may say better from where they were told. And
        // what little is seen of the object may have led astray.
        let initial = self.initial;
        if self.is_rotation_unknown {
            // Which of them it is, colors say, that were not considered yet.
            states.extend(turned(&states, self.frame.object().near_symmetries()));
            return states;
        }
        let mut turned_back = states[0].clone();
        let moved = states[0].center() - initial.center();
        states.truncate(KEPT.min(next.hypotheses.saturating_sub(2).max(1)));
        turned_back.t_cam_object = Translation3::from(moved) * initial.t_cam_object;
        states.extend([turned_back, initial.clone()]);
        let more = next.hypotheses.saturating_sub(states.len());
        let (best, spacing) = (&found[0].at, self.settings.restart_spacing);
        states.extend(spread(best, initial, spacing, self.radius(), more));
        states
    }
}

/// Records the best solution of a stage.
fn record(recorder: &mut Recorder<'_, '_>, best: &Solution) -> ControlFlow<()> {
    let (index, values) = (recorder.count(), vec![best.at.cost]);
    let iteration = Iteration { index, values, weights: vec![1.0], step: 0.0 };
    recorder.visit(&best.at.state, iteration, None)
}
