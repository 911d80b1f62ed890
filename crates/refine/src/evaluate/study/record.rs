//! Records of a study: one per frame.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::posterior::PredictedPosterior;
use crate::data::PlainPose;
use crate::evaluate::metrics::PoseScore;

/// The records of a study, by frame.
pub type Records = BTreeMap<usize, FrameRecord>;

/// One initial pose and the results of all methods.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameRecord {
    /// Level of noise of the initial pose.
    pub(super) level: String,
    /// Scene of the split.
    pub(super) scene_id: u32,
    /// Image of the scene.
    pub(super) im_id: u32,
    /// The object.
    pub(super) obj_id: u32,
    /// One a row of the study's table, in the design's order.
    pub(super) outcomes: Vec<RowOutcome>,
}

/// One row of a table, for one frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct RowOutcome {
    /// Name of the row: `truth`, `initial`, a method, a number of steps, or a method with a fault.
    pub(super) row: String,
    /// The pose, object → camera.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) pose: Option<PlainPose>,
    /// The iteration that the pose comes from.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) iteration: Option<usize>,
    /// Its metrics.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) score: Option<PoseScore>,
    /// The predicted posterior; in the confidence study.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) belief: Option<PredictedPosterior>,
    /// Whether a fault was added to the observation: a failure is then a finding.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(super) perturbed: bool,
    /// Why there is no pose or no score.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) failed: Option<String>,
}

impl RowOutcome {
    /// A row without a pose, and why.
    pub(super) fn failed(row: &str, reason: String) -> Self {
        Self { row: row.into(), failed: Some(reason), ..Self::default() }
    }
}

impl FrameRecord {
    /// How messages name the frame.
    pub fn label(&self) -> String {
        let Self { level, scene_id, im_id, obj_id, .. } = self;
        format!("{level}: scene {scene_id} image {im_id} object {obj_id}")
    }

    /// Whether any row without an added fault failed.
    pub fn failed(&self) -> bool {
        self.outcomes.iter().any(|o| o.failed.is_some() && !o.perturbed)
    }

    /// The outcome of a row.
    pub(super) fn outcome(&self, row: &str) -> Option<&RowOutcome> {
        self.outcomes.iter().find(|o| o.row == row)
    }
}

/// A metric in a row of the table, by record.
pub(super) fn column(records: &[&FrameRecord], row: &str, metric: usize) -> Vec<Option<f64>> {
    records.iter().map(|record| record.outcome(row)?.score?.values()[metric]).collect()
}
