//! What a study keeps of a frame.

use serde::{Deserialize, Serialize};

use super::belief::PredictedPosterior;
use crate::data::PlainPose;
use crate::evaluate::metrics::PoseScore;

/// One initial pose, and what every method made of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameRecord {
    /// Level of noise of the initial pose.
    pub level: String,
    /// Scene of the split.
    pub scene_id: u32,
    /// Image of the scene.
    pub im_id: u32,
    /// The object.
    pub obj_id: u32,
    /// One a row of the study's table, in the design's order.
    pub outcomes: Vec<RowOutcome>,
}

/// One row of a table, for one frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RowOutcome {
    /// Name of the row: `truth`, `initial`, a method, a number of steps, or a method with a fault.
    pub row: String,
    /// The pose, object → camera.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pose: Option<PlainPose>,
    /// The iteration that the pose comes from.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iteration: Option<usize>,
    /// Its metrics.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub score: Option<PoseScore>,
    /// What was believed of the pose; in the confidence study.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub belief: Option<PredictedPosterior>,
    /// Whether something was made wrong with the observation: a failure is a finding then.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub perturbed: bool,
    /// Why there is no pose or no score.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failed: Option<String>,
}

impl FrameRecord {
    /// How messages name the frame.
    pub fn label(&self) -> String {
        let Self { level, scene_id, im_id, obj_id, .. } = self;
        format!("{level}: scene {scene_id} image {im_id} object {obj_id}")
    }

    /// Whether any row failed with whose observation nothing was made wrong.
    pub fn failed(&self) -> bool {
        self.outcomes.iter().any(|o| o.failed.is_some() && !o.perturbed)
    }

    /// The outcome of a row.
    pub fn outcome(&self, row: &str) -> Option<&RowOutcome> {
        self.outcomes.iter().find(|o| o.row == row)
    }
}
