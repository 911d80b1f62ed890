//! What the methods make of a frame.

use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use nalgebra::Isometry3;

use super::design::{Design, Frame};
use super::kind::{INITIAL, Kind, TRUTH};
use super::record::{FrameRecord, RowOutcome};
use crate::bop::ResultRow;
use crate::{AssetError, Assets, Config, PlainPose, Scorer, refine_with};

/// Takes frames one by one; several may share the assets.
pub struct Examiner<'a> {
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

impl<'a> Examiner<'a> {
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
        for (name, config) in self.methods {
            let rows = match self.design.study {
                Kind::Steps => self.design.steps.iter().map(usize::to_string).collect(),
                _ => vec![name.clone()],
            };
            match self.refine(frame, config) {
                Ok((poses, time)) => {
                    seconds.push((name.clone(), time));
                    for (row_name, (pose, iteration)) in rows.iter().zip(poses) {
                        outcomes.push(self.outcome(row_name, row, Ok((pose, Some(iteration)))));
                    }
                }
                Err(error) => {
                    let reason = error.to_string();
                    outcomes.extend(rows.iter().map(|r| self.outcome(r, row, Err(reason.clone()))));
                }
            }
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

    /// The poses that the study compares, one in all or one a number of steps, and the seconds it took.
    fn refine(&self, frame: &Frame, config: &Config) -> Result<(Vec<Pose>, f64), AssetError> {
        let row = &frame.row;
        let (object, observation, robot) = {
            let mut assets = self.assets.lock().unwrap_or_else(PoisonError::into_inner);
            let object = assets.object(row.obj_id)?;
            let image = assets.dataset().frame(row.scene_id, row.im_id)?;
            let (observation, robot) = assets.observation(&image, frame.instance, &config.terms)?;
            (object, observation, robot)
        };
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
        Ok((poses, seconds))
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
        RowOutcome { row: name.into(), pose: Some(plain), iteration, score, failed }
    }
}
