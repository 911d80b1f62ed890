//! The fused estimator: all evidence in one robust nonlinear least-squares problem.

mod calibration_test;
mod factors;
mod fit;
mod hypotheses;
mod let_off;
mod posterior;
mod search_again;
mod settings;
mod summary;
use std::f64::consts::PI;
use std::ops::ControlFlow;
use std::sync::Arc;

use nalgebra::{DMatrix, Isometry3, Translation3};
use prehend_autodiff::optimize::LeastSquares;

use self::factors::depth_noise;
pub(crate) use self::factors::{problem_of, surface_patches};
use self::fit::Known;
pub(crate) use self::fit::Pixels;
pub use self::fit::{Fit, FitReference, FitStatistics};
use self::hypotheses::{distinct, lowest, restarts, rivals, settled, spread, turned};
pub(crate) use self::posterior::chi_square_z;
use self::posterior::log_mass;
pub use self::posterior::{
    CovarianceInflation, Hypothesis, Inconsistency, Posterior, UnobservableDirection,
};
pub use self::settings::{FusedSettings, Modality, Nuisance, Stage};
pub use self::summary::PosteriorSummary;
use super::estimate::Recorder;
use super::{Estimate, Iteration, Observer, Strategy};
use crate::error::RefineError;
use crate::factor::{GaussianPrior, Layout, NoiseEstimate};
use crate::problem::{
    Block, Factor, ImageWarp, Linearization, NormalEquations, Problem, Solution, Solver, State,
    SurfacePatches, Termination,
};
use crate::scene::Frame;

/// Gauss–Newton on all evidence at once, with the quantities that are not known exactly estimated beside the pose.
///
/// Factors are negative log-likelihoods, so their sum is that of the posterior, up to a constant. From coarse to fine: small
/// images and wide kernels first. Factors of one's own join all stages:
///
/// ```
/// # use prehend_refine::problem::{Factor, NoiseModel, Rows, State};
/// # struct Height;
/// # impl Factor for Height {
/// #     fn name(&self) -> &'static str { "height" }
/// # }
/// use prehend_refine::strategy::Fused;
///
/// let fused = Fused::default().with(Height);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Fused {
    /// Settings.
    pub settings: FusedSettings,
    /// Factors of one's own.
    pub factors: Vec<Arc<dyn Factor>>,
}

impl Fused {
    /// With these settings.
    pub fn new(settings: FusedSettings) -> Self {
        Self { settings, factors: Vec::new() }
    }

    /// What is known beforehand: about `initial`, and of calibrations what the frame's rig says, or the settings. Of the rotation that a search
    /// has found, nothing is known that is not in the frame.
    fn prior(
        &self,
        frame: &Frame<'_>,
        initial: &State,
        is_searched: bool,
    ) -> Result<GaussianPrior, RefineError> {
        let mut settings = self.settings.prior.of_hand(frame.observation().hand.as_ref());
        if is_searched {
            settings.object_rotation = [UNKNOWN_ROTATION; 3];
        }
        let Some(rig) = frame.rig() else {
            return GaussianPrior::independent(initial.clone(), &settings);
        };
        let object = settings.sigmas(Block::ObjectPose);
        let by_rig = rig.frame_covariance(initial, &frame.observation().camera, &object)?;
        let layout = Layout::of(initial);
        // A rig is of one camera; of others that is known which is said.
        let variances = settings.all_sigmas(layout).map(|sigma| sigma * sigma);
        let mut covariance = DMatrix::from_diagonal(&variances);
        covariance.view_mut((0, 0), by_rig.shape()).copy_from(&by_rig);
        GaussianPrior::correlated(initial.clone(), layout, &covariance).ok_or_else(|| {
            let problem = "the covariance is not positive definite".into();
            RefineError::Setting { name: "rig", problem }
        })
    }

    /// With a factor of one's own; its noise model is believed as it is stated.
    pub fn with(mut self, factor: impl Factor + 'static) -> Self {
        self.factors.push(Arc::new(factor));
        self
    }
}

/// The problem of a stage, without a prior, and where the object may be off from its model.
struct StageProblem {
    problem: Problem,
    patches: Option<Arc<SurfacePatches>>,
}

/// What a frame says of its state and of the object's surface, beside what is known beforehand.
pub(crate) struct Evidence {
    /// Where it was asked.
    pub(crate) state: State,
    /// Derivatives by the object's pose, by all calibrations, by displacements of the patches and by what the image is off by.
    pub(crate) equations: NormalEquations,
    /// Where the object may be off from its model.
    pub(crate) patches: Option<Arc<SurfacePatches>>,
}

impl Fused {
    /// What all factors of the last stage say at `state`, from where noise is measured. `None` if there are none.
    ///
    /// # Errors
    /// Those of a run.
    pub(crate) fn evidence(
        &self,
        frame: &Frame<'_>,
        state: &State,
        warp: &Arc<ImageWarp>,
    ) -> Result<Option<Evidence>, RefineError> {
        let Some(StageProblem { problem, patches }) = self.last_problem(frame, state)? else {
            return Ok(None);
        };
        let equations = problem.evidence(state, warp);
        Ok(Some(Evidence { state: state.clone(), equations, patches }))
    }

    /// The posterior about `state`, wherever that came from, of a refinement that began at `initial`: nothing is searched, and what the state
    /// is short of the best one widens it. `None` without stages.
    ///
    /// # Errors
    /// Those of a run.
    pub(crate) fn posterior_at(
        &self,
        frame: &Frame<'_>,
        initial: &State,
        state: &State,
    ) -> Result<Option<Posterior>, RefineError> {
        let Some(last) = self.last_problem(frame, state)? else { return Ok(None) };
        let prior = self.prior(frame, initial, frame.rivals().is_some())?;
        let at = last.problem.with_prior(Arc::new(prior)).linearize(state);
        let solution = Solution { at, termination: Termination::Iterations, iterations: 0 };
        let (radius, inflation) = (frame.object().radius, self.settings.inflation);
        Ok(Some(Posterior::new(&[solution], inflation, radius, false, None)))
    }

    /// The same, with depth's noise in the last stage as it is in `frame` about `state`, whatever a frame shows.
    pub(crate) fn with_noise_of(&self, frame: &Frame<'_>, state: &State) -> Self {
        let mut fused = self.clone();
        let settings = &mut fused.settings;
        if let Some(stage) = settings.stages.last_mut().filter(|stage| stage.measured_noise) {
            stage.measured_noise = false;
            let with_patches = stage.model_error && settings.nuisances.contains(&Nuisance::Model);
            take_noise(settings, depth_noise(frame, state, &self.settings), with_patches);
        }
        fused
    }

    /// The problem of the last stage about `state`, from where noise is measured; `None` without stages.
    fn last_problem(
        &self,
        frame: &Frame<'_>,
        state: &State,
    ) -> Result<Option<StageProblem>, RefineError> {
        let Some(stage) = self.settings.stages.last() else { return Ok(None) };
        let mut settings = self.settings.for_frame(frame);
        self.stage_problem(frame, state, state, stage, &mut settings).map(Some)
    }

    /// The problem of `stage` about `initial`, with the noise that is measured at `seen`, which `settings` take.
    fn stage_problem(
        &self,
        frame: &Frame<'_>,
        initial: &State,
        seen: &State,
        stage: &Stage,
        settings: &mut FusedSettings,
    ) -> Result<StageProblem, RefineError> {
        let patches = surface_patches(frame, initial, seen, stage, settings);
        if stage.measured_noise {
            let measured = depth_noise(frame, seen, &self.settings);
            take_noise(settings, measured, patches.is_some());
        }
        let own = &self.factors;
        let problem = problem_of(frame, initial, stage, settings, patches.clone(), own)?;
        Ok(StageProblem { problem, patches })
    }
}

/// Standard deviations of depth points that are believed when measured \[m\].
const FINEST: f64 = 2e-4;
const COARSEST: f64 = 3e-3;

/// Solutions of geometry alone that are taken up: where they differ, starts spread about them say more than they do.
const KEPT: usize = 4;

/// Standard deviation about each axis of a rotation that nothing is known of \[rad\]: half a turn costs half a nat.
const UNKNOWN_ROTATION: f64 = PI;

/// Where initial poses come from a search, the first stage, and the first that sees colors, take up so many hypotheses at most, …
const MOST_ALTERNATIVES: usize = 64;
/// … and later ones so many times as many as else.
const WITH_RIVALS: usize = 2;

/// The last stage's tolerance times this is that of a solve with exact calibrations: its steps are cheap, and its errors small.
const EXACT: f64 = 0.01;

impl Strategy for Fused {
    /// Every stage is an iteration.
    fn run(
        &self,
        frame: &Frame<'_>,
        initial: &State,
        observe: &mut Observer<'_>,
    ) -> Result<Estimate, RefineError> {
        if self.settings.stages.is_empty() {
            return Err(RefineError::Setting { name: "stages", problem: "are missing".into() });
        }
        let found = self.run_from(frame, initial, frame.rivals(), observe)?;
        let found = match self.settings.let_off {
            true => self.without_misfits(frame, initial, found, observe)?,
            false => found,
        };
        let again = self.settings.search_unfit && frame.rivals().is_none();
        if !(again && search_again::is_unfit(frame, &found)) {
            return Ok(found);
        }
        let Some((start, rivals)) = search_again::searched(frame, initial) else {
            return Ok(found);
        };
        let other = self.run_from(frame, &start, Some(&rivals), observe)?;
        let probability = |found: &Estimate| found.posterior.as_ref().map(Posterior::probability);
        Ok(if probability(&other) > probability(&found) { other } else { found })
    }

    /// Stages, and one more where calibrations turn out to be exact.
    fn iterations(&self) -> usize {
        self.settings.stages.len() + usize::from(self.settings.calibration_test)
    }
}

impl Fused {
    /// A run from `initial`; `others` are its rivals, if it comes from a search.
    fn run_from(
        &self,
        frame: &Frame<'_>,
        initial: &State,
        others: Option<&[Isometry3<f64>]>,
        observe: &mut Observer<'_>,
    ) -> Result<Estimate, RefineError> {
        let names = std::iter::once("posterior");
        let mut recorder = Recorder::new(names, initial, self.iterations(), None, observe);
        let prior = Arc::new(self.prior(frame, initial, others.is_some())?);
        let settings = self.settings.for_frame(frame);
        let searched = others.is_some();
        let mut walk = Walk { fused: self, frame, initial, searched, prior, settings };
        let mut states = match others {
            Some(others) => rivals(initial, others),
            None => restarts(initial, self.settings.restart_angle),
        };
        let mut found = Vec::new();
        let mut go_on = ControlFlow::Continue(());
        for index in 0..self.settings.stages.len() {
            found = walk.stage(index, &states)?;
            states = walk.next_starts(index, &found);
            go_on = record(&mut recorder, &found[0]);
            if go_on.is_break() {
                break;
            }
        }
        let exact = go_on.is_continue()
            && self.settings.calibration_test
            && frame.rig().is_none()
            && calibration_test::is_exact(&found[0].at);
        if exact {
            // Depth's noise is measured at the solution with free calibrations first, then at that with exact ones.
            for _ in 0..2 {
                found = walk.with_exact_calibrations(&found)?;
            }
            _ = record(&mut recorder, &found[0]);
        }
        let (radius, inflation) = (frame.object().radius, self.settings.inflation);
        let mut posterior = Posterior::new(&found, inflation, radius, exact, None);
        // What right poses are like is known of the last stage.
        if go_on.is_continue() {
            posterior.fit = Some(walk.fit(&found[0].at)?);
        }
        Ok(recorder.estimate(Some(posterior)))
    }
}

/// Takes the noise of depth as it was `measured`, if it was.
fn take_noise(settings: &mut FusedSettings, measured: Option<NoiseEstimate>, with_patches: bool) {
    let Some(noise) = measured else { return };
    settings.depth.noise.sigma = noise.independent.clamp(FINEST, COARSEST);
    // The model's part of it is what patches are off by.
    let model = if with_patches { settings.model.gp_sigma } else { 0.0 };
    let correlated = (noise.correlated.powi(2) - model.powi(2)).max(0.0).sqrt();
    settings.depth.gp_sigma = correlated.min(COARSEST);
    settings.depth.noise.effective_samples = settings.max_effective_samples;
}

/// Records the best solution of a stage.
fn record(recorder: &mut Recorder<'_, '_>, best: &Solution) -> ControlFlow<()> {
    let (index, values) = (recorder.count(), vec![best.at.cost]);
    let iteration = Iteration { index, values, weights: vec![1.0], step: 0.0 };
    recorder.visit(&best.at.state, iteration, None)
}

/// A refinement under way.
struct Walk<'a> {
    fused: &'a Fused,
    frame: &'a Frame<'a>,
    initial: &'a State,
    /// Whether that comes from a search.
    searched: bool,
    prior: Arc<GaussianPrior>,
    /// With what was measured of depth's noise.
    settings: FusedSettings,
}

impl Walk<'_> {
    fn stages(&self) -> &[Stage] {
        &self.fused.settings.stages
    }

    fn radius(&self) -> f64 {
        self.frame.object().radius
    }

    /// The distinct solutions of stage `index` from `states`, the best one first.
    fn stage(&mut self, index: usize, states: &[State]) -> Result<Vec<Solution>, RefineError> {
        let (fused, frame, initial) = (self.fused, self.frame, self.initial);
        let stage = &fused.settings.stages[index];
        let settings = &mut self.settings;
        let of_stage = fused.stage_problem(frame, initial, &states[0], stage, settings)?;
        let problem = of_stage.problem.with_prior(self.prior.clone());
        let states = &self.taken_up(index, states, &problem);
        let found = if index == 0 && !self.searched {
            let mut all = problem.solve_all(&states[..1], &stage.solver);
            let noise = || depth_noise(frame, &all[0].at.state, &fused.settings);
            if !settled(&all[0].at, noise, self.radius()) {
                all.extend(problem.solve_all(&states[1..], &stage.solver));
            }
            all
        } else {
            problem.solve_all(states, &stage.solver)
        };
        let mut found = distinct(found, self.radius());
        // Not by the first stage, which sees no colors.
        if index > 0 {
            let limit = found[0].at.cost + self.settings.prune_margin;
            // One that is still on its way down is not judged yet, and the best stays whatever its cost.
            let mut best = true;
            found.retain(|solution| {
                let unfinished = solution.termination == Termination::Iterations;
                let kept = best || unfinished || solution.at.cost <= limit;
                best = false;
                kept
            });
        }
        if index + 1 == self.stages().len() {
            self.rank(&mut found);
        }
        Ok(found)
    }

    /// Those of `states` that stage `index`, which solves `problem`, takes up.
    fn taken_up(&self, index: usize, states: &[State], problem: &Problem) -> Vec<State> {
        let usual = self.stages()[index].hypotheses.max(1);
        if !self.searched {
            return states[..states.len().min(usual)].to_vec();
        }
        let limit = if index < 2 { MOST_ALTERNATIVES } else { WITH_RIVALS * usual };
        if states.len() <= limit {
            return states.to_vec();
        }
        lowest(states, &problem.cost_all(states), limit)
    }

    /// Puts the best of the last solutions first: modes far apart, as those of a search are, compare by their mass rather than their height.
    fn rank(&self, found: &mut Vec<Solution>) {
        if self.searched {
            let ranked = found.drain(..).map(|solution| (log_mass(&solution.at), solution));
            let mut ranked: Vec<_> = ranked.collect();
            ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
            found.extend(ranked.into_iter().map(|(_, solution)| solution));
        }
    }

    /// Where the stage after `index` starts, which found these solutions.
    fn next_starts(&self, index: usize, found: &[Solution]) -> Vec<State> {
        let mut states: Vec<State> = found.iter().map(|found| found.at.state.clone()).collect();
        let Some(next) = self.stages().get(1).filter(|_| index == 0) else { return states };
        // Where it is, geometry finds well; how it is turned, colors may say better from where they were told. And
        // what little is seen of the object may have led astray.
        let initial = self.initial;
        if self.searched {
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

    /// The last stage once more, with all calibrations believed to be as stated.
    fn with_exact_calibrations(
        &mut self,
        found: &[Solution],
    ) -> Result<Vec<Solution>, RefineError> {
        let initial = self.initial;
        let nominal = |solution: &Solution| State {
            t_cam_hand: initial.t_cam_hand,
            joints: initial.joints.clone(),
            camera: initial.camera,
            views: initial.views.clone(),
            ..solution.at.state.clone()
        };
        let states: Vec<State> = found.iter().map(nominal).collect();
        // Then depth's errors are not alike over whole patches either.
        self.settings.depth.gp_sigma = 0.0;
        if let Some(noise) = depth_noise(self.frame, &states[0], &self.fused.settings) {
            self.settings.depth.noise.sigma = noise.sigma.clamp(FINEST, COARSEST);
            self.settings.depth.noise.effective_samples = noise.effective_samples;
        }
        let settings = FusedSettings { nuisances: Vec::new(), ..self.settings.clone() };
        let last = &self.stages()[self.stages().len() - 1];
        let own = &self.fused.factors;
        let problem = problem_of(self.frame, initial, last, &settings, None, own)?
            .with_prior(self.prior.clone());
        let solver = Solver { min_decrease: EXACT * last.solver.min_decrease, ..last.solver };
        let mut found = distinct(problem.solve_all(&states, &solver), self.radius());
        self.rank(&mut found);
        Ok(found)
    }

    /// How well `point` explains what the frame shows.
    fn fit(&self, point: &Linearization) -> Result<Fit, RefineError> {
        let (fused, frame, said) = (self.fused, self.frame, self.initial);
        let stated = &self.settings.prior;
        let camera = &frame.observation().camera;
        let by_rig = frame.rig().map(|rig| rig.marginal_prior(said, camera, stated)).transpose()?;
        // Where the pose was said to be has nothing to do with it.
        let calibrations = State { t_cam_object: said.t_cam_object, ..point.state.clone() };
        let known = Known {
            said,
            cost: self.prior.cost(&calibrations),
            sigmas: by_rig.as_ref().unwrap_or(stated),
            noise: depth_noise(frame, &point.state, &fused.settings),
            with_depth: fused.settings.modalities.contains(&Modality::Depth),
        };
        Ok(Fit::new(frame, point, &known))
    }
}
