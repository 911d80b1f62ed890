//! The estimator of an object's pose: search, refinement and tracking by one set of settings.

mod batch;
mod input;

use std::ops::ControlFlow;
use std::sync::{Arc, OnceLock};
use std::time::Instant;

use nalgebra::Isometry3;
use prehend_render::Backend;

pub use self::batch::{RefineJob, refine_all};
pub use self::input::EstimatorInput;
use crate::baselines::GradientKind;
use crate::error::RefineError;
use crate::method::Method;
use crate::pose_finder::{Hypotheses, PoseCandidate, PoseFinder};
use crate::problem::{Factor, State};
use crate::rig::Rig;
use crate::scene::{Frame, Object};
use crate::search::PoseSearch;
use crate::settings::Settings;
use crate::strategy::{Diagnosis, Estimate, Fused, Observer, Strategy};
use crate::tracker::Tracker;

/// Estimator of the pose of one object in frames.
#[derive(Clone)]
pub struct Estimator {
    object: Arc<Object>,
    settings: Settings,
    method: Method,
    factors: Vec<Arc<dyn Factor>>,
    rig: Option<Arc<Rig>>,
    finder: Option<Arc<dyn PoseFinder>>,
    /// Made when it is first needed.
    search: OnceLock<Arc<PoseSearch>>,
    backend: Option<Arc<dyn Backend>>,
}

/// Outcome of [`Estimator::run`].
pub struct Refined<'a> {
    /// Pose, with its posterior.
    pub estimate: Estimate,
    /// Frame and object as they were used.
    pub input: EstimatorInput<'a>,
    /// Wall time \[s\].
    pub seconds: f64,
}

impl Estimator {
    /// The fused estimator of default settings.
    pub fn new(object: impl Into<Arc<Object>>) -> Self {
        let (settings, method) = (Settings::default(), Method::default());
        let (object, factors) = (object.into(), Vec::new());
        let (rig, finder, search, backend) = (None, None, OnceLock::new(), None);
        Self { object, settings, method, factors, rig, finder, search, backend }
    }

    /// With these settings.
    pub fn settings(mut self, settings: Settings) -> Self {
        self.method.configure(&settings.estimator);
        Self { settings, search: OnceLock::new(), ..self }
    }

    /// With another method than the fused estimator, or with its ablations.
    pub fn method(self, method: Method) -> Self {
        Self { method, ..self }
    }

    /// With a user-defined factor in every frame, beside those of the fused estimator; other methods refuse it.
    pub fn factor(mut self, factor: impl Factor + 'static) -> Self {
        self.factors.push(Arc::new(factor));
        self
    }

    /// For frames and an object that are [corrected](Rig::corrected) by `rig`: calibrations are as accurate as the rig is known.
    pub fn rig(self, rig: Option<Arc<Rig>>) -> Self {
        Self { rig, ..self }
    }

    /// With a finder of the object, such as a [network](crate::network::PoseNetwork): it finds poses in place of the search, and before it in trackers.
    pub fn finder(self, finder: Option<Arc<dyn PoseFinder>>) -> Self {
        Self { finder, ..self }
    }

    /// Rendering by `backend` in place of the processor.
    pub fn backend(self, backend: Arc<dyn Backend>) -> Self {
        Self { backend: Some(backend), ..self }
    }

    /// Poses by sensors alone, the most likely one first: those of the finder, or else of a search. [`Hypotheses::found`] converts them for [`refine`](Self::refine).
    ///
    /// # Errors
    /// Those of [`PoseFinder::find`]; [`RefineError::Setting`] for a setting of the search out of range.
    pub fn find(&self, frame: &Frame) -> Result<Vec<PoseCandidate>, RefineError> {
        let input = EstimatorInput::new(frame, &self.object);
        let frame = input.prepared(self.backend.as_ref())?;
        if let Some(finder) = &self.finder {
            return finder.find(&frame);
        }
        let search = match self.search.get() {
            Some(search) => search,
            None => {
                let search = PoseSearch::new(Arc::clone(&self.object), self.settings.search())?;
                self.search.get_or_init(|| Arc::new(search))
            }
        };
        search.find(&frame)
    }

    /// Refines `hypotheses` in `frame`.
    ///
    /// # Errors
    /// If a hypothesis cannot be seen, the frame lacks what the method needs, or the pose that is found is not finite.
    pub fn refine(&self, frame: &Frame, hypotheses: &Hypotheses) -> Result<Estimate, RefineError> {
        let observe = &mut |_: &_| ControlFlow::Continue(());
        Ok(self.run(frame, hypotheses, observe)?.estimate)
    }

    /// As [`refine`](Self::refine), with the frame as it was used, and the time; `observe` hears of every iteration.
    ///
    /// # Errors
    /// See there.
    pub fn run<'a>(
        &self,
        frame: &'a Frame,
        hypotheses: &Hypotheses,
        observe: &mut Observer<'_>,
    ) -> Result<Refined<'a>, RefineError> {
        let start = Instant::now();
        let input = self.input(frame, &hypotheses.best)?;
        let prepared = input.prepared(self.backend.as_ref())?;
        let initial = State::new(&prepared, &hypotheses.best)?;
        let mut estimate = self.method_of(hypotheses)?.run(&prepared, &initial, observe)?;
        if let Some(posterior) = &mut estimate.posterior {
            posterior.model_scale = input.model_scale;
        }
        let pose = estimate.t_cam_object();
        let mut numbers = pose.rotation.coords.iter().chain(pose.translation.vector.iter());
        if !numbers.all(|v| v.is_finite()) {
            return Err(RefineError::Diverged);
        }
        drop(prepared);
        Ok(Refined { estimate, input, seconds: start.elapsed().as_secs_f64() })
    }

    /// Refinements without each sensor beside the estimate of `refined`, a [`run`](Self::run) from `hypotheses`; none of other methods than the fused
    /// one.
    ///
    /// # Errors
    /// See there.
    pub fn diagnose(
        &self,
        refined: &Refined<'_>,
        hypotheses: &Hypotheses,
    ) -> Result<Vec<Diagnosis>, RefineError> {
        let Method::Fused(fused) = self.method_of(hypotheses)? else { return Ok(Vec::new()) };
        let prepared = refined.input.prepared(self.backend.as_ref())?;
        let initial = State::new(&prepared, &hypotheses.best)?;
        fused.diagnose(&prepared, &initial, refined.estimate.clone())
    }

    /// A tracker; it searches in its first frame, unless [`start_from`](Tracker::start_from) gives a pose.
    ///
    /// # Errors
    /// [`RefineError::Setting`] for a setting out of range.
    pub fn tracker(&self) -> Result<Tracker, RefineError> {
        let mut tracker = Tracker::new(Arc::clone(&self.object), self.settings.tracker())?;
        if let Some(rig) = &self.rig {
            tracker = tracker.with_rig(Arc::clone(rig));
        }
        if let Some(finder) = &self.finder {
            tracker = tracker.with_finder(Arc::clone(finder));
        }
        tracker.factors.clone_from(&self.factors);
        Ok(match &self.backend {
            Some(backend) => tracker.with_backend(Arc::clone(backend)),
            None => tracker,
        })
    }

    /// The frame as the method needs it, of an object about at `t_cam_object` \[m\].
    ///
    /// # Errors
    /// If nothing of the object is seen there.
    pub fn input<'a>(
        &self,
        frame: &'a Frame,
        t_cam_object: &Isometry3<f64>,
    ) -> Result<EstimatorInput<'a>, RefineError> {
        let fused = match &self.method {
            Method::Fused(fused) => Fused::clone(fused),
            _ => Fused::default(),
        };
        let fused = Fused { rig: self.rig.clone().or(fused.rig), ..fused };
        EstimatorInput::new(frame, &self.object).completed(&fused, t_cam_object)
    }

    /// Without the gradients of the heuristic for which `frame` has no evidence.
    pub fn supported_by(mut self, frame: &Frame) -> Self {
        if let Method::Heuristic(heuristic) = &mut self.method {
            heuristic.gradients.retain(|gradient| match gradient {
                GradientKind::Rendering | GradientKind::Depth => true,
                GradientKind::Physics => frame.hand.is_some() && frame.gravity.is_some(),
                GradientKind::Tactile => {
                    frame.hand.as_ref().is_some_and(|hand| !hand.forces.is_empty())
                }
            });
        }
        self
    }

    /// The method as it is set.
    pub fn configured_method(&self) -> &Method {
        &self.method
    }

    /// The method with the rig, and with alternatives of the initial pose.
    fn method_of(&self, hypotheses: &Hypotheses) -> Result<Method, RefineError> {
        let mut method = self.method.clone();
        match &mut method {
            Method::Fused(fused) => {
                fused.rig = self.rig.clone().or(fused.rig.take());
                fused.alternatives.clone_from(&hypotheses.alternatives);
                fused.factors.extend(self.factors.iter().cloned());
            }
            _ if self.factors.is_empty() => {}
            _ => {
                let problem = "is of the fused method".to_owned();
                return Err(RefineError::Setting { name: "factor", problem });
            }
        }
        Ok(method)
    }
}
