//! What the methods make of a frame.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use nalgebra::Isometry3;

use super::belief::PredictedPosterior;
use super::design::{Design, Frame, Trial};
use super::kind::{INITIAL, Kind, TRUTH};
use super::record::{FrameRecord, RowOutcome};
use super::sweep::Sweep;
use crate::config::Config;
use crate::data::bop::ResultRow;
use crate::data::{AssetError, Assets, PlainPose};
use crate::evaluate::Scorer;
use crate::refine::refine_with;
use crate::scene::Object;
use crate::strategy::Posterior;

/// Takes frames one by one; several may share the assets.
pub struct Runner<'a> {
    design: &'a Design,
    methods: &'a [(String, Config)],
    assets: &'a Mutex<Assets<'a>>,
    scorer: Scorer<'a>,
}

/// A frame's record, and the seconds that each method took.
pub struct Examined {
    /// The record.
    pub record: FrameRecord,
    /// By method.
    pub seconds: Vec<(String, f64)>,
}

/// A pose and the iteration it comes from.
type Pose = (Isometry3<f64>, usize);

/// What a method made of a frame.
struct Refined {
    /// The poses that the study compares, one in all or one a number of steps.
    poses: Vec<Pose>,
    seconds: f64,
    object: Arc<Object>,
    confidence: Option<Posterior>,
}

impl<'a> Runner<'a> {
    /// One that runs `methods`, those of the design, with their settings.
    pub fn new(
        design: &'a Design,
        methods: &'a [(String, Config)],
        assets: &'a Mutex<Assets<'a>>,
    ) -> Self {
        let dataset = assets.lock().unwrap_or_else(PoisonError::into_inner).dataset();
        Self { design, methods, assets, scorer: Scorer::new(dataset) }
    }

    /// Runs all methods on a frame. What fails is in the record.
    pub fn examine(&mut self, frame: &Frame) -> Examined {
        let row = &frame.row;
        let mut seconds = Vec::new();
        let mut outcomes = Vec::new();
        let truth = self.scorer.true_pose(row).map(|pose| (pose, None));
        outcomes.push(self.outcome(TRUTH, row, truth.map_err(|e| e.to_string())));
        outcomes.push(self.outcome(INITIAL, row, Ok((row.t_cam_model, None))));
        // Sweeps begin where nothing is wrong: that is done once for all of them.
        let mut undisturbed: BTreeMap<String, Vec<RowOutcome>> = BTreeMap::new();
        for trial in self.design.trials() {
            if trial.fault.is_none()
                && let Some(known) = undisturbed.get(&trial.method)
            {
                let renamed = known.iter().zip(trial.rows);
                outcomes.extend(renamed.map(|(same, row)| RowOutcome { row, ..same.clone() }));
                continue;
            }
            let (mut found, time) = self.run(frame, &trial);
            found.iter_mut().for_each(|outcome| outcome.perturbed = trial.fault.is_some());
            if trial.fault.is_none() {
                seconds.extend(time.map(|time| (trial.method.clone(), time)));
                undisturbed.insert(trial.method, found.clone());
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
        Examined { record, seconds }
    }

    /// The outcomes of the rows of a trial, and the seconds that it took.
    fn run(&mut self, frame: &Frame, trial: &Trial) -> (Vec<RowOutcome>, Option<f64>) {
        let refined = self
            .methods
            .iter()
            .find(|(name, _)| *name == trial.method)
            .ok_or_else(|| format!("there is no method {}", trial.method))
            .and_then(|(_, config)| {
                self.refine(frame, config, trial.fault).map_err(|e| e.to_string())
            });
        let row = &frame.row;
        let refined = match refined {
            Ok(refined) => refined,
            Err(reason) => {
                let failed = |r: &String| self.outcome(r, row, Err(reason.clone()));
                return (trial.rows.iter().map(failed).collect(), None);
            }
        };
        let poses = trial.rows.iter().zip(&refined.poses);
        let mut outcomes: Vec<RowOutcome> = poses
            .map(|(name, (pose, at))| self.outcome(name, row, Ok((*pose, Some(*at)))))
            .collect();
        if let Some(confidence) = refined.confidence.filter(|_| self.believes()) {
            for (outcome, (pose, _)) in outcomes.iter_mut().zip(&refined.poses) {
                let Ok(truth) =
                    self.scorer.true_pose(&ResultRow { t_cam_model: *pose, ..row.clone() })
                else {
                    continue;
                };
                let belief = PredictedPosterior::new(&confidence, &refined.object, &truth);
                if belief.is_finite() {
                    outcome.belief = Some(belief);
                } else if outcome.failed.is_none() {
                    outcome.failed = Some("the posterior is not finite".into());
                }
            }
        }
        (outcomes, Some(refined.seconds))
    }

    /// Whether the study is of what methods believe.
    fn believes(&self) -> bool {
        self.design.study == Kind::Posterior
    }

    /// What a method makes of a frame with which something may be wrong.
    fn refine(
        &self,
        frame: &Frame,
        config: &Config,
        fault: Option<(Sweep, f64)>,
    ) -> Result<Refined, AssetError> {
        let row = &frame.row;
        let (object, mut observation, robot) = {
            let mut assets = self.assets.lock().unwrap_or_else(PoisonError::into_inner);
            let object = assets.object(row.obj_id)?;
            let image = assets.dataset().frame(row.scene_id, row.im_id)?;
            let (observation, robot) = assets.observation_for(&image, frame.instance, config)?;
            (object, observation, robot)
        };
        if let Some((sweep, amount)) = fault {
            sweep.perturb(&mut observation, amount, sweep.seed(row));
        }
        let steps = &self.design.steps;
        let mut poses: Vec<Pose> = Vec::new();
        let start = Instant::now();
        let refined =
            refine_with(&observation, &object, robot.as_ref(), &row.t_cam_model, config, |p| {
                // A run of fewer iterations would have come just as far: nothing in it looks ahead.
                if steps.contains(&p.iteration) {
                    poses.push((p.t_cam_object, p.iteration));
                }
                true
            })?;
        let seconds = start.elapsed().as_secs_f64();
        // One pose without steps; with them, a run that ended early stays where it is.
        poses.resize(steps.len().max(1), (refined.t_cam_object, refined.iteration));
        Ok(Refined { poses, seconds, object, confidence: refined.confidence })
    }

    fn outcome(
        &mut self,
        name: &str,
        row: &ResultRow,
        pose: Result<(Isometry3<f64>, Option<usize>), String>,
    ) -> RowOutcome {
        let failure = |reason: String| RowOutcome {
            row: name.into(),
            failed: Some(reason),
            ..RowOutcome::default()
        };
        let (pose, iteration) = match pose {
            Ok(found) => found,
            Err(reason) => return failure(reason),
        };
        let plain = PlainPose::from(&pose);
        if !plain.is_finite() {
            return failure("the pose is not finite".into());
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
