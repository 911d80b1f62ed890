//! Runs the methods of a study on a frame.

use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::Isometry3;

use super::design::Design;
use super::initial_pose::InitialPose;
use super::prediction::StudyPrediction;
use super::record::{INITIAL, Record, TRUTH};
use super::sweep::Sweep;
use crate::data::bop::{Dataset, ResultRow};
use crate::data::{AssetError, Assets, PlainPose, Target};
use crate::error::{RefineError, guard};
use crate::evaluate::scoring::Scorer;
use crate::method::Method;
use crate::scene::Object;
use crate::strategy::Posterior;

/// Runs the methods of a study frame by frame; several runners may share the assets.
pub struct Runner<'a> {
    design: &'a Design,
    assets: &'a Mutex<Assets>,
    scorer: Scorer<'a>,
}

/// A fault of the observation, and its amount.
type Fault = Option<(Sweep, u32)>;

/// The result of a method on a frame.
struct StudyFrame {
    /// Poses after the numbers of iterations that the study compares.
    poses: Vec<(usize, Isometry3<f64>)>,
    /// Pose in the end, and the iteration that it comes from.
    last: (Option<usize>, Isometry3<f64>),
    seconds: Option<f64>,
    /// The posterior, with the object it is of.
    posterior: Option<(Posterior, Arc<Object>)>,
}

impl StudyFrame {
    /// A pose that no method has found.
    fn given(pose: Isometry3<f64>) -> Self {
        Self { poses: Vec::new(), last: (None, pose), seconds: None, posterior: None }
    }

    /// The pose after so many steps, and its iteration; a run that ended early stays where it is.
    fn pose(&self, steps: Option<usize>) -> (Option<usize>, Isometry3<f64>) {
        let found = self.poses.iter().find(|(iteration, _)| Some(*iteration) == steps);
        found.map_or(self.last, |(iteration, pose)| (Some(*iteration), *pose))
    }
}

impl<'a> Runner<'a> {
    /// A runner of the methods of `design` on the dataset that `assets` are of.
    pub fn new(design: &'a Design, dataset: &'a Dataset, assets: &'a Mutex<Assets>) -> Self {
        Self { design, assets, scorer: Scorer::new(dataset) }
    }

    /// Fills in `rows`, which are of this initial pose. What fails is in their status.
    pub fn run(&mut self, initial: &InitialPose, mut rows: Vec<Record>) -> Vec<Record> {
        // Rows of one run: several numbers of steps, or sweeps that all begin without a fault.
        let mut runs: Vec<(String, Fault, Result<StudyFrame, String>)> = Vec::new();
        for row in &mut rows {
            let (method, fault) = (row.key.method.clone(), row.key.fault());
            let known = runs.iter().position(|run| run.0 == method && run.1 == fault);
            let index = known.unwrap_or_else(|| {
                let refined = guard(|| self.pose_of(initial, &method, fault));
                runs.push((method, fault, refined.map_err(|error| error.to_string())));
                runs.len() - 1
            });
            match &runs[index].2 {
                Ok(refined) => self.fill(row, &initial.row, refined),
                Err(reason) => row.fail(reason),
            }
        }
        rows
    }

    /// Result of `method`, or the pose that is given under that name.
    fn pose_of(
        &self,
        initial: &InitialPose,
        method: &str,
        fault: Fault,
    ) -> Result<StudyFrame, AssetError> {
        match method {
            TRUTH => self.scorer.true_pose(&initial.row).map(StudyFrame::given),
            INITIAL => Ok(StudyFrame::given(initial.row.t_cam_model)),
            _ => match self.design.methods.iter().find(|(name, _)| name == method) {
                Some((_, method)) => self.refine(initial, method, fault),
                None => {
                    let problem = format!("there is no {method}");
                    Err(RefineError::Setting { name: "method", problem }.into())
                }
            },
        }
    }

    /// Refines a frame, with a fault of the observation if there is one.
    fn refine(
        &self,
        initial: &InitialPose,
        method: &Method,
        fault: Fault,
    ) -> Result<StudyFrame, AssetError> {
        let row = &initial.row;
        let ResultRow { scene_id, im_id, obj_id, .. } = *row;
        let target = Target { scene_id, im_id, obj_id, instance: initial.instance };
        let mut input = {
            let mut assets = self.assets.lock().unwrap_or_else(PoisonError::into_inner);
            assets.load(&target, Some(&row.t_cam_model), method.gradients())?
        };
        if let Some((sweep, amount)) = fault {
            sweep.perturb(&mut input.frame, amount, sweep.seed(row));
        }
        let steps = &self.design.steps;
        let mut poses = Vec::new();
        let hypotheses = row.t_cam_model.into();
        let refined = input.estimator(method).run(&input.frame, &hypotheses, &mut |p| {
            // A run of fewer iterations would have come just as far: nothing in it looks ahead.
            if steps.contains(&p.iteration) {
                poses.push((p.iteration, p.t_cam_object));
            }
            ControlFlow::Continue(())
        })?;
        let estimate = refined.estimate;
        let last = (Some(estimate.iteration), *estimate.t_cam_object());
        let posterior = estimate.posterior.map(|posterior| (posterior, refined.input.object));
        Ok(StudyFrame { poses, last, seconds: Some(refined.seconds), posterior })
    }

    /// Fills in a row of the frame whose initial pose is `initial`.
    fn fill(&mut self, row: &mut Record, initial: &ResultRow, refined: &StudyFrame) {
        let (iteration, pose) = refined.pose(row.key.steps);
        (row.iteration, row.seconds) = (iteration, refined.seconds);
        let plain = PlainPose::from(&pose);
        if !plain.is_finite() {
            return row.fail("the pose is not finite");
        }
        row.set_pose(&plain);
        let found = ResultRow { t_cam_model: pose, ..initial.clone() };
        let metrics = self.scorer.score(&found).map(|scored| scored.score.values());
        match metrics {
            Ok(metrics) if metrics.iter().flatten().all(|value| value.is_finite()) => {
                row.metrics = metrics;
            }
            Ok(_) => return row.fail("scoring: a metric is not finite"),
            Err(error) => return row.fail(&format!("scoring: {error}")),
        }
        if let (Some((posterior, object)), Ok(truth)) =
            (&refined.posterior, self.scorer.true_pose(&found))
        {
            match StudyPrediction::new(posterior, object, &truth) {
                Some(prediction) => row.prediction = prediction,
                None => row.fail("the posterior is not finite"),
            }
        }
    }
}
