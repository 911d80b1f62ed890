//! The sum of the refinement's terms, as the judge of hypotheses.

use std::sync::Arc;

use nalgebra::{Isometry3, Vector6};
use prehend_render::DepthImage;

use super::{Scored, SearchSettings};
use crate::error::RefineError;
use crate::factor::{
    DepthSettings, DepthTerm, RenderingSettings, RenderingTerm, TactileSettings, TactileTerm, Term,
};
use crate::problem::{Block, Normal, State};
use crate::scene::{Hand, Object, Observation};
use crate::strategy::preconditioned_step;

/// Depth points of the depth term at resolution 1.
const DEPTH_POINTS: usize = 800;
/// Longest step \[m\].
const LONGEST: f64 = 10e-3;
/// Steps shorter than this end a descent \[m\].
const SHORTEST: f64 = 50e-6;

/// Depth, color and, where there is a skin, touch.
pub(super) struct FineScorer<'a> {
    observation: &'a Observation,
    object: &'a Object,
    terms: Vec<Box<dyn Term>>,
}

impl<'a> FineScorer<'a> {
    /// The terms with an image smaller by `resolution`, and fewer depth points.
    ///
    /// # Errors
    /// If the observation lacks depth, or its hand does not fit the robot.
    pub(super) fn new(
        observation: &'a Observation,
        object: &'a Arc<Object>,
        robot: Option<&Arc<Hand>>,
        hand: &Arc<DepthImage>,
        resolution: usize,
        settings: &SearchSettings,
    ) -> Result<Self, RefineError> {
        let depth = DepthSettings { points: DEPTH_POINTS / resolution, ..DepthSettings::default() };
        let mut rendering = RenderingSettings::default();
        rendering.downsample *= resolution;
        let mut terms: Vec<Box<dyn Term>> = vec![
            Box::new(DepthTerm::new(observation, Arc::clone(object), Arc::clone(hand), depth)?),
            Box::new(RenderingTerm::new(observation, Arc::clone(object), hand, rendering)?),
        ];
        let feels = observation.hand.as_ref().is_some_and(|hand| !hand.forces.is_empty());
        if let (Some(robot), true) = (robot, feels) {
            let contact_threshold = settings.contact_threshold;
            let touch = TactileSettings { contact_threshold, ..TactileSettings::default() };
            terms.push(Box::new(TactileTerm::new(
                observation,
                Arc::clone(object),
                Arc::clone(robot),
                &touch,
            )?));
        }
        Ok(Self { observation, object, terms })
    }

    /// The sum of the terms at `pose` \[nats\]; infinite where the pose cannot be seen.
    pub(super) fn value(&self, pose: &Isometry3<f64>) -> f64 {
        match self.state(pose) {
            Some(state) => self.sum(&state),
            None => f64::INFINITY,
        }
    }

    /// `pose` after at most `steps` damped Gauss–Newton steps of the sum, none of which raises it, and the sum there.
    pub(super) fn descend(&self, pose: &Isometry3<f64>, steps: usize) -> Scored {
        let Some(mut state) = self.state(pose) else { return (*pose, f64::INFINITY) };
        let mut value = self.sum(&state);
        let mut limit = LONGEST;
        let mut planned: Option<Normal> = None;
        for _ in 0..steps {
            let normal = planned.get_or_insert_with(|| {
                let mut normal = Normal::new(&[Block::ObjectPose]);
                self.terms.iter().for_each(|t| _ = t.linearize(&state, &mut normal));
                normal
            });
            let (step, length): (Vector6<f64>, f64) =
                preconditioned_step(normal, self.object.radius, limit);
            if length < SHORTEST {
                break;
            }
            let mut next = state.moved(Block::ObjectPose, step.as_slice());
            self.terms.iter().for_each(|t| next.relight(t.as_ref()));
            let reached = self.sum(&next);
            if reached < value {
                (state, value) = (next, reached);
                limit = (2.0 * length).min(LONGEST);
                planned = None;
            } else {
                limit = 0.3 * length;
            }
        }
        (state.t_cam_object, value)
    }

    fn state(&self, pose: &Isometry3<f64>) -> Option<State> {
        let mut state = State::new(self.observation, self.object, pose).ok()?;
        self.terms.iter().for_each(|t| state.relight(t.as_ref()));
        Some(state)
    }

    fn sum(&self, state: &State) -> f64 {
        self.terms.iter().map(|t| t.value(state)).sum()
    }
}
