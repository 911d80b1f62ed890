//! The processor at hand.

use rayon::prelude::*;

use super::{Backend, BackendError, Hypothesis, PoseProblem, Session};
use crate::pose_loss::{Linearized, Loss, Tile};

/// All cores of this processor. Never fails.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cpu;

impl Backend for Cpu {
    fn name(&self) -> &str {
        "CPU"
    }

    fn prepare(&self, problem: &PoseProblem) -> Result<Box<dyn Session>, BackendError> {
        problem.loss.check()?;
        Ok(Box::new(problem.clone()))
    }
}

impl PoseProblem {
    /// The loss of each hypothesis, on all cores of this processor.
    pub fn losses(&self, hypotheses: &[Hypothesis]) -> Vec<Loss> {
        let one = |h: &Hypothesis| {
            self.loss.evaluate(&self.model, &h.t_cam_object, &h.light, &self.target)
        };
        hypotheses.par_iter().map(one).collect()
    }

    /// The loss of each hypothesis by tiles of `side` pixels with its derivatives by the twist about the model's center, on all cores of
    /// this processor: [`PoseLoss::linearize_tiles`](crate::PoseLoss::linearize_tiles).
    pub fn tiles(&self, hypotheses: &[Hypothesis], side: usize) -> Vec<Vec<Tile>> {
        let one = |h: &Hypothesis| {
            let center = h.t_cam_object * self.model.center();
            let (pose, light) = (&h.t_cam_object, &h.light);
            self.loss.linearize_tiles(&self.model, pose, &center, light, &self.target, side)
        };
        hypotheses.par_iter().map(one).collect()
    }
}

impl Session for PoseProblem {
    fn evaluate(&mut self, hypotheses: &[Hypothesis]) -> Result<Vec<Loss>, BackendError> {
        Ok(self.losses(hypotheses))
    }

    fn linearize(&mut self, hypotheses: &[Hypothesis]) -> Result<Vec<Linearized>, BackendError> {
        let one = |h: &Hypothesis| {
            let center = h.t_cam_object * self.model.center();
            self.loss.linearize(&self.model, &h.t_cam_object, &center, &h.light, &self.target)
        };
        Ok(hypotheses.par_iter().map(one).collect())
    }

    fn linearize_tiles(
        &mut self,
        hypotheses: &[Hypothesis],
        side: usize,
    ) -> Result<Vec<Vec<Tile>>, BackendError> {
        Ok(self.tiles(hypotheses, side))
    }
}
