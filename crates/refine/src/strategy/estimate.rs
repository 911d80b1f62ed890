//! Strategies of refinement and their estimates.

use std::ops::ControlFlow;

use nalgebra::{Isometry3, Matrix6};

use super::{Iteration, Posterior, PosteriorMode, Trace};
use crate::error::RefineError;
use crate::factor::RenderingFactor;
use crate::problem::{Factor, State};
use crate::scene::PreparedFrame;

/// A way from an initial pose to a refined one.
pub trait Strategy: Send + Sync {
    /// Refines `initial`, calling `observe` at every iteration, which may break off.
    ///
    /// # Errors
    /// If the frame lacks what the strategy or a factor needs, or a setting is out of range.
    fn run(
        &self,
        frame: &PreparedFrame<'_>,
        initial: &State,
        observe: &mut Observer<'_>,
    ) -> Result<Estimate, RefineError>;

    /// Iterations at most.
    fn iterations(&self) -> usize;
}

/// Refines `initial` (object → camera \[m\]) by `strategy`, such as a [`Method`](crate::Method).
///
/// # Errors
/// If the initial pose cannot be seen, or the frame lacks what the strategy needs.
pub fn refine(
    frame: &PreparedFrame<'_>,
    initial: &Isometry3<f64>,
    strategy: &dyn Strategy,
) -> Result<Estimate, RefineError> {
    let state = State::new(frame, initial)?;
    strategy.run(frame, &state, &mut |_| ControlFlow::Continue(()))
}

/// Hears of every iteration; a break ends the refinement with what has been found.
pub type Observer<'a> = dyn FnMut(&Progress) -> ControlFlow<()> + 'a;

/// Progress of a refinement under way.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Iterations done.
    pub iteration: usize,
    /// Iterations at most.
    pub iterations: usize,
    /// The pose that would be returned if the refinement ended here (object → camera \[m\]).
    pub t_cam_object: Isometry3<f64>,
}

/// The outcome of a refinement.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// The pose, and whatever else was estimated.
    pub state: State,
    /// The iteration that it comes from.
    pub iteration: usize,
    /// How uncertain it is: some from the fused estimator, none from the other strategies.
    pub posterior: Option<Posterior>,
    /// History of the refinement.
    pub trace: Trace,
}

impl Estimate {
    /// The pose: object coordinates → camera coordinates \[m\].
    pub fn t_cam_object(&self) -> &Isometry3<f64> {
        &self.state.t_cam_object
    }

    /// Probability that model, data and pose are right ([`Posterior::probability`]); of the fused estimator.
    pub fn probability(&self) -> Option<f64> {
        Some(self.posterior.as_ref()?.probability())
    }

    /// Covariance of the pose ([`Posterior::covariance`]); of the fused estimator.
    pub fn covariance(&self) -> Option<Matrix6<f64>> {
        Some(self.posterior.as_ref()?.covariance())
    }

    /// Modes of the posterior, the most likely one first; of the fused estimator.
    pub fn modes(&self) -> &[PosteriorMode] {
        self.posterior.as_ref().map_or(&[], |posterior| &posterior.modes)
    }
}

/// Records a walk: its trace, and the state that it is to return.
pub(crate) struct Recorder<'a, 'b> {
    observe: &'a mut Observer<'b>,
    iterations: usize,
    /// Factor of which the best state has the lowest cost; without one, the last state is the best.
    judge: Option<RenderingFactor>,
    lowest: f64,
    best: State,
    at: usize,
    trace: Trace,
}

impl<'a, 'b> Recorder<'a, 'b> {
    /// Recorder of a walk from `initial` of at most `iterations`, whose values are called `names`. The best state is that of the lowest cost
    /// by `judge`, or the last one without it.
    pub(crate) fn new<'n>(
        names: impl Iterator<Item = &'n str>,
        initial: &State,
        iterations: usize,
        judge: Option<RenderingFactor>,
        observe: &'a mut Observer<'b>,
    ) -> Self {
        let (best, trace) = (initial.clone(), Trace::new(names));
        Self { observe, iterations, judge, lowest: f64::INFINITY, best, at: 0, trace }
    }

    /// Records that the walk is at `state`, with the judge's cost there if it is known already.
    pub(crate) fn visit(
        &mut self,
        state: &State,
        iteration: Iteration,
        score: Option<f64>,
    ) -> ControlFlow<()> {
        let score = score.or_else(|| Some(self.judge.as_ref()?.cost(state)));
        if score.is_none_or(|score| score < self.lowest) {
            self.lowest = score.unwrap_or(f64::INFINITY);
            (self.best, self.at) = (state.clone(), iteration.index);
        }
        let progress = Progress {
            iteration: iteration.index,
            iterations: self.iterations,
            t_cam_object: self.best.t_cam_object,
        };
        self.trace.iterations.push(iteration);
        (self.observe)(&progress)
    }

    /// Iterations recorded.
    pub(crate) fn count(&self) -> usize {
        self.trace.iterations.len()
    }

    /// The outcome.
    pub(crate) fn estimate(self, posterior: Option<Posterior>) -> Estimate {
        Estimate { state: self.best, iteration: self.at, posterior, trace: self.trace }
    }
}
