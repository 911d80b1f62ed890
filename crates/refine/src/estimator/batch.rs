//! Many frames at once.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;

use super::{Estimator, Refined};
use crate::error::{RefineError, guard};
use crate::pose_finder::Hypotheses;
use crate::scene::Frame;
use crate::workers::Workers;

/// Refinement of a frame.
pub struct RefineJob<'a> {
    /// Estimator of the frame's object.
    pub estimator: Estimator,
    /// Frame.
    pub frame: &'a Frame,
    /// Initial poses.
    pub hypotheses: Hypotheses,
}

/// Refines frames side by side, with `threads` threads in all, or as many as there are cores. Results depend neither on the other frames nor on the
/// number of threads.
///
/// # Errors
/// If the system gives no threads; what is wrong with a frame is in its place, panics too.
pub fn refine_all<'a>(
    jobs: &[RefineJob<'a>],
    threads: Option<NonZeroUsize>,
) -> Result<Vec<Result<Refined<'a>, RefineError>>, RefineError> {
    let threads = threads.map_or_else(rayon::current_num_threads, NonZeroUsize::get);
    let workers = Workers::new(jobs.len(), threads)?;
    let indices: Vec<usize> = (0..jobs.len()).collect();
    let run = |index: usize| {
        let RefineJob { estimator, frame, hypotheses } = &jobs[index];
        guard(|| estimator.run(frame, hypotheses, &mut |_| ControlFlow::Continue(())))
    };
    let mut done = Vec::new();
    workers.run_in_order(&indices, run, |_, outcome| done.push(outcome));
    Ok(done)
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::problem::{Factor, Rows, State};
    use crate::scene::{Scene, default_scene};

    #[test]
    fn what_becomes_of_a_frame_depends_on_no_other() {
        let Scene { frame, object, initial, .. } = default_scene(1).unwrap();
        let behind = Isometry3::translation(0.0, 0.0, -2.0) * initial;
        let estimator = Estimator::new(object);
        let job = |initial: Isometry3<f64>| {
            let (estimator, hypotheses) = (estimator.clone(), initial.into());
            RefineJob { estimator, frame: &frame, hypotheses }
        };
        let jobs = [initial, behind, initial].map(job);
        let alone = estimator.refine(&frame, &initial.into()).unwrap();
        for threads in [None, NonZeroUsize::new(1), NonZeroUsize::new(2)] {
            let done = refine_all(&jobs, threads).unwrap();
            assert!(matches!(done[1], Err(RefineError::BehindCamera { .. })));
            for outcome in [&done[0], &done[2]] {
                let estimate = &outcome.as_ref().ok().unwrap().estimate;
                assert_eq!(estimate.t_cam_object(), alone.t_cam_object());
                assert_eq!(estimate.posterior, alone.posterior);
            }
        }
        assert!(refine_all(&[], None).unwrap().is_empty());
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
        let Scene { frame, object, initial, .. } = default_scene(1).unwrap();
        let bare = Frame { hand: None, ..frame.clone() };
        let estimator = Estimator::new(object).factor(Faulty);
        let job = |frame| {
            let (estimator, hypotheses) = (estimator.clone(), initial.into());
            RefineJob { estimator, frame, hypotheses }
        };
        let done = refine_all(&[&frame, &bare, &frame].map(job), None).unwrap();
        assert!(matches!(done[1], Err(RefineError::Panicked(_))));
        assert!(done[0].is_ok() && done[2].is_ok());
    }
}
