//! The sum of three factors, as the judge of hypotheses.

use std::sync::Arc;

use super::{Scored, SearchSettings};
use crate::error::RefineError;
use crate::factor::{
    ChamferDepthFactor, ChamferDepthSettings, RenderingFactor, RenderingSettings, TactileFactor,
    TactileSettings,
};
use crate::problem::{Block, Factor, Problem, Solver, State};
use crate::scene::Frame;

/// Depth points of the depth factor at resolution 1.
const DEPTH_POINTS: usize = 800;
/// A descent ends when a step promises less \[nat\].
const MIN_DECREASE: f64 = 1e-3;

/// Depth, color and, where there is a skin, touch.
pub(super) struct FineScorer<'a> {
    frame: &'a Frame<'a>,
    problem: Problem,
}

impl<'a> FineScorer<'a> {
    /// The factors with an image smaller by `resolution`, and fewer depth points.
    ///
    /// # Errors
    /// If the frame lacks depth, or its forces do not fit the hand.
    pub(super) fn new(
        frame: &'a Frame<'a>,
        resolution: usize,
        settings: &SearchSettings,
    ) -> Result<Self, RefineError> {
        let points = DEPTH_POINTS / resolution;
        let depth = ChamferDepthSettings { points, ..ChamferDepthSettings::default() };
        let mut rendering = RenderingSettings::default();
        rendering.downsample *= resolution;
        let mut factors: Vec<Arc<dyn Factor>> = vec![
            Arc::new(ChamferDepthFactor::new(frame, &depth)?),
            Arc::new(RenderingFactor::new(frame, &rendering)?),
        ];
        if frame.hand().is_some_and(|(_, hand)| !hand.forces.is_empty()) {
            let contact_threshold = settings.contact_threshold;
            let touch = TactileSettings { contact_threshold, ..TactileSettings::default() };
            factors.push(Arc::new(TactileFactor::new(frame, &touch)?));
        }
        let problem = Problem::new(factors, vec![Block::ObjectPose]);
        Ok(Self { frame, problem })
    }

    /// The poses that can be seen, each with the sum of the costs there \[nat\].
    pub(super) fn judge(&self, poses: &[Scored]) -> Vec<Scored> {
        let states = self.visible(poses);
        let costs = self.problem.cost_all(&states);
        states.iter().map(|state| state.t_cam_object).zip(costs).collect()
    }

    /// The poses that can be seen after at most `steps` steps down, and the sum of the costs there.
    pub(super) fn descend(&self, poses: &[Scored], steps: usize) -> Vec<Scored> {
        let solver = Solver { iterations: steps, min_decrease: MIN_DECREASE };
        let found = self.problem.solve_all(&self.visible(poses), &solver);
        found.into_iter().map(|found| (found.at.state.t_cam_object, found.at.cost)).collect()
    }

    fn visible(&self, poses: &[Scored]) -> Vec<State> {
        poses.iter().filter_map(|(pose, _)| State::new(self.frame, pose).ok()).collect()
    }
}
