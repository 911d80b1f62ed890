//! Runs the methods of a study on a frame.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use nalgebra::Isometry3;

use super::design::{Design, Frame, Trial};
use super::kind::{INITIAL, Kind, TRUTH};
use super::posterior::PredictedPosterior;
use super::record::{FrameRecord, RowOutcome};
use super::sweep::Sweep;
use crate::data::bop::{Dataset, ResultRow};
use crate::data::{AssetError, Assets, PlainPose, Sensor, Target};
use crate::error::guard;
use crate::evaluate::scoring::Scorer;
use crate::method::Method;
use crate::problem::State;
use crate::scene::Object;
use crate::strategy::{Posterior, Strategy};

/// Runs the methods of a study frame by frame; several runners may share the assets.
pub struct Runner<'a> {
    design: &'a Design,
    methods: &'a [(String, Method)],
    assets: &'a Mutex<Assets<'a>>,
    scorer: Scorer<'a>,
}

/// A frame's record, and the seconds that each method took.
pub struct FrameResult {
    /// The record.
    pub record: FrameRecord,
    /// By method.
    pub seconds: Vec<(String, f64)>,
}

/// A pose and the iteration it comes from.
type Pose = (Isometry3<f64>, usize);

/// The result of a method on a frame.
struct Refined {
    /// The poses that the study compares: one, or one for each number of steps.
    poses: Vec<Pose>,
    seconds: f64,
    object: Arc<Object>,
    posterior: Option<Posterior>,
}

impl<'a> Runner<'a> {
    /// A runner of `methods`, those of the design, with their settings, on the dataset that `assets` are of.
    pub fn new(
        design: &'a Design,
        methods: &'a [(String, Method)],
        dataset: &'a Dataset,
        assets: &'a Mutex<Assets<'a>>,
    ) -> Self {
        Self { design, methods, assets, scorer: Scorer::new(dataset) }
    }

    /// Runs all methods on a frame. What fails is in the record.
    pub fn run(&mut self, frame: &Frame) -> FrameResult {
        let row = &frame.row;
        let mut seconds = Vec::new();
        let mut outcomes = Vec::new();
        outcomes.push(match self.scorer.true_pose(row) {
            Ok(truth) => self.outcome(TRUTH, row, truth, None),
            Err(error) => RowOutcome::failed(TRUTH, error.to_string()),
        });
        outcomes.push(self.outcome(INITIAL, row, row.t_cam_model, None));
        // Every sweep begins without a fault: that is run once for all of them.
        let mut unperturbed: BTreeMap<String, Vec<RowOutcome>> = BTreeMap::new();
        for trial in self.design.trials() {
            if trial.fault.is_none()
                && let Some(known) = unperturbed.get(&trial.method)
            {
                let renamed = known.iter().zip(trial.rows);
                outcomes.extend(renamed.map(|(same, row)| RowOutcome { row, ..same.clone() }));
                continue;
            }
            let (mut found, time) = self.run_trial(frame, &trial);
            found.iter_mut().for_each(|outcome| outcome.perturbed = trial.fault.is_some());
            if trial.fault.is_none() {
                seconds.extend(time.map(|time| (trial.method.clone(), time)));
                unperturbed.insert(trial.method, found.clone());
            }
            outcomes.extend(found);
        }
        let record = FrameRecord {
            level: self.design.levels[frame.level].name.clone(),
            scene_id: row.scene_id,
            im_id: row.im_id,
            obj_id: row.obj_id,
            outcomes,
        };
        FrameResult { record, seconds }
    }

    /// The outcomes of the rows of a trial, and the seconds that it took.
    fn run_trial(&mut self, frame: &Frame, trial: &Trial) -> (Vec<RowOutcome>, Option<f64>) {
        let refined = match self.methods.iter().find(|(name, _)| *name == trial.method) {
            Some((_, method)) => {
                let refined = guard(|| self.refine(frame, method, trial.fault));
                refined.map_err(|error| error.to_string())
            }
            None => Err(format!("there is no method {}", trial.method)),
        };
        let refined = match refined {
            Ok(refined) => refined,
            Err(reason) => {
                let failed = |row: &String| RowOutcome::failed(row, reason.clone());
                return (trial.rows.iter().map(failed).collect(), None);
            }
        };
        let posterior = refined.posterior.filter(|_| self.design.study == Kind::Posterior);
        let mut outcomes = Vec::new();
        for (name, &(pose, iteration)) in trial.rows.iter().zip(&refined.poses) {
            let mut outcome = self.outcome(name, &frame.row, pose, Some(iteration));
            let truth =
                self.scorer.true_pose(&ResultRow { t_cam_model: pose, ..frame.row.clone() });
            if let (Some(posterior), Ok(truth)) = (&posterior, truth) {
                let belief = PredictedPosterior::new(posterior, &refined.object, &truth);
                if belief.is_finite() {
                    outcome.belief = Some(belief);
                } else if outcome.failed.is_none() {
                    outcome.failed = Some("the posterior is not finite".into());
                }
            }
            outcomes.push(outcome);
        }
        (outcomes, Some(refined.seconds))
    }

    /// Refines a frame, with a fault of the observation if there is one.
    fn refine(
        &self,
        frame: &Frame,
        method: &Method,
        fault: Option<(Sweep, f64)>,
    ) -> Result<Refined, AssetError> {
        let row = &frame.row;
        let ResultRow { scene_id, im_id, obj_id, .. } = *row;
        let target = Target { scene_id, im_id, obj_id, instance: frame.instance };
        let mut input = {
            let mut assets = self.assets.lock().unwrap_or_else(PoisonError::into_inner);
            assets.load_at(&target, &frame.row.t_cam_model, &Sensor::required_by(method))?
        };
        if let Some((sweep, amount)) = fault {
            sweep.perturb(&mut input.observation, amount, sweep.seed(row));
        }
        let steps = &self.design.steps;
        let mut poses: Vec<Pose> = Vec::new();
        let start = Instant::now();
        let input = input.prepared(&row.t_cam_model, method)?.unwrap_or(input);
        let frame = input.frame()?;
        let initial = State::new(&frame, &row.t_cam_model)?;
        let refined = method.with_rig(input.rig.as_ref()).run(&frame, &initial, &mut |p| {
            // A run of fewer iterations would have come just as far: nothing in it looks ahead.
            if steps.contains(&p.iteration) {
                poses.push((p.t_cam_object, p.iteration));
            }
            ControlFlow::Continue(())
        })?;
        let seconds = start.elapsed().as_secs_f64();
        // One pose without steps; with them, a run that ended early stays where it is.
        poses.resize(steps.len().max(1), (*refined.t_cam_object(), refined.iteration));
        let posterior = refined.posterior;
        drop(frame);
        Ok(Refined { poses, seconds, object: input.object, posterior })
    }

    /// The outcome of a row whose pose is `pose`.
    fn outcome(
        &mut self,
        name: &str,
        row: &ResultRow,
        pose: Isometry3<f64>,
        iteration: Option<usize>,
    ) -> RowOutcome {
        let plain = PlainPose::from(&pose);
        if !plain.is_finite() {
            return RowOutcome::failed(name, "the pose is not finite".into());
        }
        let scored = self.scorer.score(&ResultRow { t_cam_model: pose, ..row.clone() });
        let (score, failed) = match scored {
            Ok(scored) if scored.score.values().iter().flatten().all(|v| v.is_finite()) => {
                (Some(scored.score), None)
            }
            Ok(_) => (None, Some("scoring: a metric is not finite".into())),
            Err(error) => (None, Some(format!("scoring: {error}"))),
        };
        let row = name.into();
        RowOutcome { row, pose: Some(plain), iteration, score, failed, ..RowOutcome::default() }
    }
}
