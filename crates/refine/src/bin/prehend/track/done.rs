//! Frames that are done, and what is told of them.

use std::time::Duration;

use prehend_refine::data::bop::ResultRow;
use prehend_refine::data::details::{FrameDetails, TrackDetails};
use prehend_refine::data::{PlainPose, Target};
use prehend_refine::evaluate::report::DrawnFrame;
use prehend_refine::strategy::PosteriorSummary;
use prehend_refine::tracker::{Timing, TrackStatus};
use serde_json::json;

/// A frame that is done, without what nobody asks for afterwards: there may be many.
pub(super) struct Done {
    pub(super) target: Target,
    pub(super) row: ResultRow,
    /// Time since the first frame.
    pub(super) time: Duration,
    pub(super) track: TrackDetails,
    pub(super) iterations: usize,
    pub(super) timing: Timing,
    /// Posterior, if it is asked for afterwards and there is one.
    pub(super) posterior: Option<PosteriorSummary>,
    pub(super) drawing: Option<DrawnFrame>,
}

impl Done {
    /// Row of the table of frames, with its time if that is `timed`.
    pub(super) fn details(&self, timed: bool) -> FrameDetails {
        FrameDetails {
            target: self.target,
            t_cam_model: self.row.t_cam_model,
            initial: None,
            posterior: self.posterior.clone(),
            iterations: self.iterations,
            seconds: timed.then(|| self.timing.total().as_secs_f64()),
            warnings: Vec::new(),
            track: Some(self.track),
        }
    }

    /// Its JSON value.
    pub(super) fn summary(&self) -> serde_json::Value {
        let Self { row, track, timing, .. } = self;
        let pose = PlainPose::from(&row.t_cam_model);
        let milliseconds = |d: Duration| 1e3 * d.as_secs_f64();
        json!({
            "scene_id": row.scene_id,
            "im_id": row.im_id,
            "stamp_ns": track.stamp,
            "obj_id": row.obj_id,
            "status": track.status.name(),
            "rejection": track.rejection.map(|d| d.to_string()),
            "iterations": self.iterations,
            "cost": track.cost.is_finite().then_some(track.cost),
            "probability_within_5mm_5deg": row.score,
            "milliseconds": {
                "preparation": milliseconds(timing.preparation),
                "steps": milliseconds(timing.steps),
                "judgement": milliseconds(timing.validation),
                "recovery": milliseconds(timing.recovery),
            },
            "t_cam_model_mm": pose.translation_m.map(|v| v * 1e3),
            "quaternion_wxyz": pose.quaternion_wxyz,
        })
    }
}

/// What became of `frames`, which are not empty.
pub(super) fn told(frames: &[Done]) -> String {
    // To find an object takes far longer than to follow it, and is rare.
    let rare = |f: &&Done| matches!(f.track.status, TrackStatus::Relocalized | TrackStatus::Lost);
    let of = |f: &Done| f.timing.total().as_secs_f64();
    let mut seconds: Vec<f64> = frames.iter().filter(|f| !rare(f)).map(of).collect();
    if seconds.is_empty() {
        seconds = frames.iter().map(of).collect();
    }
    let total: f64 = seconds.iter().sum();
    seconds.sort_by(f64::total_cmp);
    let mut text = format!("{} frames tracked", frames.len());
    // Without time for any of them they were only predicted.
    if total > 0.0 {
        let (rate, median) = (seconds.len() as f64 / total, 1e3 * seconds[seconds.len() / 2]);
        text += &format!(" at {rate:.1} a second, median {median:.1} ms");
    }
    let all =
        [TrackStatus::Tracked, TrackStatus::Predicted, TrackStatus::Relocalized, TrackStatus::Lost];
    let count = |status: TrackStatus| {
        let count = frames.iter().filter(|done| done.track.status == status).count();
        (count > 0).then(|| format!("{count} {}", status.name()))
    };
    let counts: Vec<String> = all.into_iter().filter_map(count).collect();
    format!("{text}: {}", counts.join(", "))
}
