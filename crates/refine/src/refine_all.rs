//! Many frames at once.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use nalgebra::Isometry3;
use prehend_render::Backend;

use crate::check::Warning;
use crate::data::{FrameInput, Workers};
use crate::error::{RefineError, guard};
use crate::method::Method;
use crate::problem::State;
use crate::strategy::{DiagnosisSummary, Estimate, Observer, Strategy};

/// Refinement of a frame from an initial pose.
pub struct RefineJob<'a> {
    /// Frame.
    pub input: &'a FrameInput,
    /// Initial pose, object → camera \[m\].
    pub initial: Isometry3<f64>,
    /// Alternative initial poses, if `initial` comes from a search: [`Fused::alternatives`](crate::strategy::Fused::alternatives).
    pub alternatives: Option<Vec<Isometry3<f64>>>,
    /// Renderer; `None` is the processor.
    pub backend: Option<Arc<dyn Backend>>,
    /// True if the fused estimator also refines without each sensor: [`Fused::diagnose`](crate::strategy::Fused::diagnose).
    pub diagnose: bool,
}

/// Outcome of a [`RefineJob`].
pub struct Refined {
    /// Pose, with its posterior.
    pub estimate: Estimate,
    /// Poses without each sensor, where that was asked for.
    pub diagnosis: Vec<DiagnosisSummary>,
    /// Faults seen in the object's model.
    pub object_warnings: Vec<Warning>,
    /// Faults seen in frame and initial pose.
    pub warnings: Vec<Warning>,
    /// Wall time of the refinement, the diagnosis left out \[s\].
    pub seconds: f64,
}

impl<'a> RefineJob<'a> {
    /// Refinement of `input` from `initial` (object → camera \[m\]) on the processor.
    pub fn new(input: &'a FrameInput, initial: Isometry3<f64>) -> Self {
        Self { input, initial, alternatives: None, backend: None, diagnose: false }
    }

    /// Refines the frame; `observe` hears of every iteration.
    ///
    /// # Errors
    /// Those of [`refine`](crate::refine), and if the pose that is found is not finite.
    pub fn run(&self, method: &Method, observe: &mut Observer<'_>) -> Result<Refined, RefineError> {
        let start = Instant::now();
        let prepared = self.input.prepared(&self.initial, method)?;
        let input = prepared.as_ref().unwrap_or(self.input);
        let mut frame = input.frame()?;
        if let Some(backend) = &self.backend {
            frame = frame.with_backend(Arc::clone(backend));
        }
        let mut method = method.with_rig(input.rig.as_ref());
        if let Method::Fused(fused) = &mut method {
            fused.alternatives.clone_from(&self.alternatives);
        }
        let initial = State::new(&frame, &self.initial)?;
        let mut estimate = method.run(&frame, &initial, observe)?;
        if let Some(posterior) = &mut estimate.posterior {
            posterior.model_scale = input.model_scale;
        }
        let pose = estimate.t_cam_object();
        let mut numbers = pose.rotation.coords.iter().chain(pose.translation.vector.iter());
        if !numbers.all(|v| v.is_finite()) {
            return Err(RefineError::Diverged);
        }
        let seconds = start.elapsed().as_secs_f64();
        let diagnosis = match &method {
            Method::Fused(fused) if self.diagnose => DiagnosisSummary::of(
                &fused.diagnose_estimate(&frame, &initial, estimate.clone())?,
            ),
            _ => Vec::new(),
        };
        let [object_warnings, warnings] = input.warnings(&self.initial);
        Ok(Refined { estimate, diagnosis, object_warnings, warnings, seconds })
    }
}

/// Refines frames side by side, with `threads` threads in all, or as many as there are cores. Results depend neither on the other frames nor on the
/// number of threads. Gradients of the heuristic for which a frame brings no evidence drop out.
///
/// # Errors
/// If the system gives no threads; what is wrong with a frame is in its place, panics too.
pub fn refine_all(
    jobs: &[RefineJob<'_>],
    method: &Method,
    threads: Option<NonZeroUsize>,
) -> Result<Vec<Result<Refined, RefineError>>, RefineError> {
    let threads = threads.map_or_else(rayon::current_num_threads, NonZeroUsize::get);
    let workers = Workers::new(jobs.len(), threads)?;
    let indices: Vec<usize> = (0..jobs.len()).collect();
    let mut done: Vec<Option<Result<Refined, RefineError>>> = Vec::new();
    done.resize_with(jobs.len(), || None);
    let keep = |&index: &usize, outcome| -> Result<(), RefineError> {
        done[index] = Some(outcome);
        Ok(())
    };
    let run = |&index: &usize| {
        let method = jobs[index].input.supported(method);
        guard(|| jobs[index].run(&method, &mut |_| ControlFlow::Continue(())))
    };
    workers.run(&indices, || run, keep)?;
    // None is missing.
    Ok(done.into_iter().flatten().collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::{Factor, Rows};
    use crate::scene::{Scene, default_scene};
    use crate::strategy::Fused;

    #[test]
    fn what_becomes_of_a_frame_depends_on_no_other() {
        let Scene { observation, object, initial, .. } = default_scene(1).unwrap();
        let input = FrameInput::new(observation, object, None);
        let behind = Isometry3::translation(0.0, 0.0, -2.0) * initial;
        let job = |initial| RefineJob::new(&input, initial);
        let jobs = [initial, behind, initial].map(job);
        let alone = jobs[0].run(&Method::default(), &mut |_| ControlFlow::Continue(()));
        let alone = alone.unwrap().estimate;
        for threads in [None, NonZeroUsize::new(1), NonZeroUsize::new(2)] {
            let done = refine_all(&jobs, &Method::default(), threads).unwrap();
            assert!(matches!(done[1], Err(RefineError::BehindCamera { .. })));
            for outcome in [&done[0], &done[2]] {
                let estimate = &outcome.as_ref().ok().unwrap().estimate;
                assert_eq!(estimate.t_cam_object(), alone.t_cam_object());
                assert_eq!(estimate.posterior, alone.posterior);
            }
        }
        assert!(refine_all(&[], &Method::default(), None).unwrap().is_empty());
    }

    /// A factor that cannot do without a hand.
    struct Faulty;

    impl Factor for Faulty {
        fn name(&self) -> &'static str {
            "faulty"
        }

        fn rows(&self, state: &State, _: &mut Rows<'_>) {
            assert!(!state.joints.is_empty(), "no hand");
        }
    }

    #[test]
    fn a_panic_costs_one_frame() {
        let Scene { observation, object, initial, .. } = default_scene(1).unwrap();
        let input = |has_hand: bool| {
            let mut observation = observation.clone();
            observation.hand = observation.hand.filter(|_| has_hand);
            FrameInput::new(observation, Arc::clone(&object), None)
        };
        let inputs = [input(true), input(false), input(true)];
        let job = |input| RefineJob::new(input, initial);
        let jobs: Vec<_> = inputs.iter().map(job).collect();
        let done = refine_all(&jobs, &Fused::default().with(Faulty).into(), None).unwrap();
        assert!(matches!(done[1], Err(RefineError::Panicked(_))));
        assert!(done[0].is_ok() && done[2].is_ok());
    }
}
