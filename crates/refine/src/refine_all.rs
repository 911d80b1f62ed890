//! Many frames at once.

use std::num::NonZeroUsize;

use nalgebra::Isometry3;

use crate::check::Warning;
use crate::data::{FrameInput, Workers};
use crate::error::{RefineError, guard};
use crate::method::Method;
use crate::refine::refine;
use crate::strategy::Estimate;

/// A frame, and where to begin.
pub struct RefineJob<'a> {
    /// The frame.
    pub input: &'a FrameInput,
    /// Object → camera \[m\].
    pub initial: Isometry3<f64>,
    /// The other poses that a search ended with, if `initial` comes from one: [`Frame::with_rivals`](crate::Frame::with_rivals).
    pub rivals: Option<Vec<Isometry3<f64>>>,
}

/// What becomes of a [`RefineJob`].
pub struct Refined {
    /// The pose, and how sure it is.
    pub estimate: Estimate,
    /// What looks wrong with object, frame and initial pose.
    pub warnings: Vec<Warning>,
}

impl RefineJob<'_> {
    /// Refines the frame. Gradients of the heuristic for which the frame brings no evidence drop out.
    ///
    /// # Errors
    /// Those of [`refine`], and if the pose that is found is not finite.
    pub fn run(&self, method: &Method) -> Result<Refined, RefineError> {
        let mut method = method.with_rig(self.input.rig.as_ref());
        if let Method::Heuristic(heuristic) = &mut method {
            heuristic.gradients.retain(|&gradient| self.input.offers(gradient));
        }
        let prepared = self.input.prepared(&self.initial, &method)?;
        let input = prepared.as_ref().unwrap_or(self.input);
        let mut frame = input.frame()?;
        if let Some(rivals) = &self.rivals {
            frame = frame.with_rivals(rivals.clone());
        }
        let mut estimate = refine(&frame, &self.initial, &method)?;
        if let Some(posterior) = &mut estimate.posterior {
            posterior.model_scale = input.model_scale;
        }
        let pose = estimate.t_cam_object();
        let mut numbers = pose.rotation.coords.iter().chain(pose.translation.vector.iter());
        if !numbers.all(|v| v.is_finite()) {
            return Err(RefineError::Diverged);
        }
        Ok(Refined { estimate, warnings: self.input.warnings(&self.initial).concat() })
    }
}

/// Refines frames side by side, with so many threads in all, or as many as there are cores. What becomes of a frame depends neither on the others
/// nor on the number of threads.
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
    workers.run(&indices, || |&index: &usize| guard(|| jobs[index].run(method)), keep)?;
    // None is missing.
    Ok(done.into_iter().flatten().collect())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::problem::{Factor, Rows, State};
    use crate::scene::{Scene, default_scene};
    use crate::strategy::Fused;

    #[test]
    fn what_becomes_of_a_frame_depends_on_no_other() {
        let Scene { observation, object, hand, initial, .. } = default_scene(1).unwrap();
        let input = FrameInput::new(observation, object, Some(hand), None);
        let behind = Isometry3::translation(0.0, 0.0, -2.0) * initial;
        let job = |initial| RefineJob { input: &input, initial, rivals: None };
        let jobs = [initial, behind, initial].map(job);
        let alone = jobs[0].run(&Method::default()).unwrap().estimate;
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
        let Scene { observation, object, hand, initial, .. } = default_scene(1).unwrap();
        let input = |has_hand: bool| {
            let mut observation = observation.clone();
            observation.hand = observation.hand.filter(|_| has_hand);
            let hand = has_hand.then(|| Arc::clone(&hand));
            FrameInput::new(observation, Arc::clone(&object), hand, None)
        };
        let inputs = [input(true), input(false), input(true)];
        let job = |input| RefineJob { input, initial, rivals: None };
        let jobs: Vec<_> = inputs.iter().map(job).collect();
        let done = refine_all(&jobs, &Fused::default().with(Faulty).into(), None).unwrap();
        assert!(matches!(done[1], Err(RefineError::Panicked(_))));
        assert!(done[0].is_ok() && done[2].is_ok());
    }
}
