//! The fused estimator: all evidence in one robust nonlinear least-squares problem.

mod diagnose;
mod factors;
mod fit;
mod hypotheses;
mod model_scale;
mod nominal;
mod pixels;
mod posterior;
mod run;
mod scales;
mod settings;
mod summary;
use std::f64::consts::PI;
use std::sync::Arc;

use nalgebra::{DMatrix, Isometry3};
use prehend_autodiff::optimize::LeastSquares;

pub use self::diagnose::{Diagnosis, DiagnosisSummary};
use self::factors::depth_noise;
pub(crate) use self::factors::{problem_of, surface_patches};
pub use self::fit::{Consistency, Fit, FitSettings};
use self::hypotheses::conventions;
pub use self::model_scale::{ModelScale, ModelScaleSettings};
pub(crate) use self::pixels::FusedPixels;
pub use self::posterior::{
    Inconsistency, Posterior, PosteriorMode, PosteriorSettings, UnobservableDirection,
};
pub(crate) use self::posterior::{ScaleMixture, chi_square_z};
use self::run::FusedRun;
pub use self::settings::{FusedSettings, HypothesisSettings, Modality, Nuisance, Stage};
pub use self::summary::PosteriorSummary;
use super::{Estimate, Observer, Strategy};
use crate::error::RefineError;
use crate::factor::{GaussianPrior, NoiseEstimate, PriorSettings, Scales};
use crate::problem::{
    Block, Factor, ImageWarp, NormalEquations, Problem, Solution, State, SurfacePatches,
    Termination,
};
use crate::rig::Rig;
use crate::scene::PreparedFrame;

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
    /// Rig by which frames and the object are corrected, where it is known.
    pub rig: Option<Arc<Rig>>,
    /// Alternative initial poses, object → camera \[m\], if the initial pose comes from a search: the rotation is then unknown, and all rotations
    /// and what looks alike by shape are hypotheses.
    pub alternatives: Option<Vec<Isometry3<f64>>>,
}

impl Fused {
    /// With these settings.
    pub fn new(settings: FusedSettings) -> Self {
        Self { settings, ..Self::default() }
    }

    /// The prior about `initial` with errors of these sizes; calibrations have the covariance of the frame's rig, if it is known.
    fn prior(
        &self,
        frame: &PreparedFrame<'_>,
        initial: &State,
        scales: &Scales,
    ) -> Result<GaussianPrior, RefineError> {
        let mut settings = self.settings.prior.of_hand(frame.observation().hand.as_ref());
        let unknown = self.is_rotation_unknown();
        if unknown {
            // Half a turn costs half a nat.
            settings.object_rotation = PI;
        }
        let turned = settings.object_turned;
        let rotation = initial.t_cam_object.rotation;
        let another = self.settings.hypotheses.another;
        let with_others = |prior: GaussianPrior| match turned > 0.0 && !unknown {
            true => prior.with_others(conventions(&rotation, another), turned),
            false => prior,
        };
        let Some(rig) = &self.rig else {
            return GaussianPrior::scaled(initial.clone(), &settings, scales).map(with_others);
        };
        let object = settings.sigmas(Block::ObjectPose);
        let by_rig = rig.frame_covariance(initial, &frame.observation().camera, &object)?;
        // A rig is of one camera.
        let variances = settings.all_sigmas(initial).map(|sigma| sigma * sigma);
        let mut covariance = DMatrix::from_diagonal(&variances);
        covariance.view_mut((0, 0), by_rig.shape()).copy_from(&by_rig);
        let scale = PriorSettings::scales(initial, scales);
        let covariance = DMatrix::from_fn(scale.len(), scale.len(), |r, c| {
            scale[r] * scale[c] * covariance[(r, c)]
        });
        let prior = GaussianPrior::correlated(initial.clone(), &covariance);
        let prior = prior.ok_or_else(|| {
            let problem = "the covariance is not positive definite".into();
            RefineError::Setting { name: "rig", problem }
        })?;
        Ok(with_others(prior.with_outliers()))
    }

    /// With frames and an object that are corrected by `rig` already: calibrations are as accurate as the rig is known.
    pub fn with_rig(self, rig: Arc<Rig>) -> Self {
        Self { rig: Some(rig), ..self }
    }

    /// Settings with the accuracy of the rig, and of the model of `frame`.
    fn settings_for(&self, frame: &PreparedFrame<'_>) -> FusedSettings {
        self.settings.for_frame(frame, self.rig.is_some())
    }

    /// Whether nothing is known of the object's rotation.
    fn is_rotation_unknown(&self) -> bool {
        self.settings.rotation_unknown || self.alternatives.is_some()
    }

    /// With a factor of one's own; its noise model is believed as it is stated.
    pub fn with(mut self, factor: impl Factor + 'static) -> Self {
        self.factors.push(Arc::new(factor));
        self
    }
}

/// Normal equations of a frame by its state and by displacements of the object's surface, without the prior.
pub(crate) struct Evidence {
    /// State at which it is linearized.
    pub(crate) state: State,
    /// Derivatives by the object's pose, by all calibrations, by displacements of the patches and by what the image is off by.
    pub(crate) equations: NormalEquations,
    /// Surface patches, where the object may be off from its model.
    pub(crate) patches: Option<Arc<SurfacePatches>>,
}

impl Fused {
    /// Evidence of all factors of the last stage at `state`, with the noise measured there. `None` without stages.
    ///
    /// # Errors
    /// Those of a run.
    pub(crate) fn evidence(
        &self,
        frame: &PreparedFrame<'_>,
        state: &State,
        warp: &Arc<ImageWarp>,
    ) -> Result<Option<Evidence>, RefineError> {
        let Some(problem) = self.last_problem(frame, state)? else { return Ok(None) };
        let (equations, patches) = (problem.evidence(state, warp), problem.patches);
        Ok(Some(Evidence { state: state.clone(), equations, patches }))
    }

    /// The posterior about `state`, wherever that came from, of a refinement that began at `initial`: nothing is searched, and what the state
    /// is short of the best one widens it. `None` without stages.
    ///
    /// # Errors
    /// Those of a run.
    pub(crate) fn posterior_at(
        &self,
        frame: &PreparedFrame<'_>,
        initial: &State,
        state: &State,
    ) -> Result<Option<Posterior>, RefineError> {
        let Some(last) = self.last_problem(frame, state)? else { return Ok(None) };
        let prior = self.prior(frame, initial, &Scales::default())?;
        let at = last.with_prior(Arc::new(prior)).linearize(state);
        let solution = Solution { at, termination: Termination::Iterations, iterations: 0 };
        Ok(Some(Posterior::new(&[solution], frame.object().radius, &self.settings.posterior)))
    }

    /// The problem of the last stage about `state`, from where noise is measured; `None` without stages.
    fn last_problem(
        &self,
        frame: &PreparedFrame<'_>,
        state: &State,
    ) -> Result<Option<Problem>, RefineError> {
        let Some(stage) = self.settings.stages.last() else { return Ok(None) };
        let mut settings = self.settings_for(frame);
        self.stage_problem(frame, state, state, stage, &mut settings).map(Some)
    }

    /// The problem of `stage` about `initial`, with the noise that is measured at `seen`, which `settings` take.
    fn stage_problem(
        &self,
        frame: &PreparedFrame<'_>,
        initial: &State,
        seen: &State,
        stage: &Stage,
        settings: &mut FusedSettings,
    ) -> Result<Problem, RefineError> {
        let patches = surface_patches(frame, initial, seen, stage, settings);
        let measured = stage.measured_noise.then(|| depth_noise(frame, seen, &self.settings));
        if let Some(noise) = measured.flatten() {
            take_noise(settings, &noise, patches.is_some());
        }
        problem_of(frame, initial, stage, settings, patches, &self.factors)
    }
}

/// Takes the noise of depth as it was measured. The model's part of what neighbors have in common is that of the patches, where there are any.
fn take_noise(settings: &mut FusedSettings, measured: &NoiseEstimate, with_patches: bool) {
    settings.depth.noise.sigma = measured.independent.max(settings.min_depth_sigma);
    let model = if with_patches { settings.patches.sigma } else { 0.0 };
    let correlated = (measured.correlated.powi(2) - model.powi(2)).max(0.0).sqrt();
    settings.depth.gp_sigma = correlated;
    settings.depth.noise.effective_samples =
        measured.effective_samples.min(settings.max_effective_samples);
}

impl Strategy for Fused {
    /// Every stage is an iteration.
    fn run(
        &self,
        frame: &PreparedFrame<'_>,
        initial: &State,
        observe: &mut Observer<'_>,
    ) -> Result<Estimate, RefineError> {
        let FusedSettings { stages, rendering, .. } = &self.settings;
        if stages.is_empty() {
            return Err(RefineError::Setting { name: "stages", problem: "are missing".into() });
        }
        if rendering.downsample == 0 || stages.iter().any(|stage| stage.downsample == 0) {
            return Err(RefineError::Setting { name: "downsample", problem: "is zero".into() });
        }
        FusedRun::new(self, frame, initial)?.finish(observe)
    }

    fn iterations(&self) -> usize {
        self.settings.stages.len()
    }
}
