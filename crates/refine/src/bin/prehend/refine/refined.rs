//! A refined frame, and its part of the results.

use nalgebra::Isometry3;
use prehend_refine::Refined;
use prehend_refine::check::Warning;
use prehend_refine::data::PlainPose;
use prehend_refine::data::bop::ResultRow;
use prehend_refine::data::details::FrameDetails;
use prehend_refine::evaluate::report::{DrawnFrame, FrameReport};
use prehend_refine::strategy::{DiagnosisSummary, PosteriorSummary, Trace};
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::options::Job;

/// A refined frame as the journal has it.
#[derive(Serialize, Deserialize)]
pub(super) struct RefinedFrame {
    pub(super) pose: PlainPose,
    pub(super) iteration: usize,
    pub(super) iterations: usize,
    pub(super) warnings: Vec<String>,
    pub(super) object_warnings: Vec<String>,
    /// How sure the pose is, where the method knows.
    pub(super) confidence: Option<PosteriorSummary>,
    /// Estimates without each sensor, if these were asked for.
    #[serde(default)]
    pub(super) diagnosis: Vec<DiagnosisSummary>,
    /// Time that it took \[s\].
    pub(super) seconds: f64,
    /// Kept only if something will be made of it: it is long.
    pub(super) trace: Option<Trace>,
}

impl RefinedFrame {
    /// From a frame that was refined from the pose `initial`.
    pub(super) fn new(refined: Refined<'_>, initial: &Isometry3<f64>) -> Self {
        let texts = |warnings: Vec<Warning>| warnings.iter().map(Warning::to_string).collect();
        let [object_warnings, warnings] = refined.input.warnings(initial).map(texts);
        let found = refined.estimate;
        Self {
            pose: PlainPose::from(found.t_cam_object()),
            iteration: found.iteration,
            iterations: found.trace.iterations.len().saturating_sub(1),
            warnings,
            object_warnings,
            confidence: found.posterior.as_ref().map(PosteriorSummary::from),
            diagnosis: Vec::new(),
            seconds: refined.seconds,
            trace: Some(found.trace),
        }
    }

    pub(super) fn all_warnings(&self) -> Vec<String> {
        self.object_warnings.iter().chain(&self.warnings).cloned().collect()
    }

    /// Row of the results file, with the time if that is `timed`: else resumed runs would not end with the same file.
    pub(super) fn row(&self, job: &Job, timed: bool) -> ResultRow {
        ResultRow {
            t_cam_model: (&self.pose).into(),
            // BOP leaves open what a score is; here it is the probability of being right, and that of the initial pose where the method knows none.
            score: self.confidence.as_ref().map_or(job.row.score, |c| c.probability),
            time: if timed { self.seconds } else { -1.0 },
            ..job.row.clone()
        }
    }

    /// Its part of the page, with the errors \[m, rad\] of its pose and of the initial one, where the truth is known.
    pub(super) fn report(
        &self,
        job: &Job,
        errors: [Option<[f64; 2]>; 2],
        timed: bool,
        drawing: Option<DrawnFrame>,
    ) -> FrameReport {
        let name = job.target.to_string();
        let mut report = FrameReport::refined(name, self.details(job, timed), errors, drawing);
        report.remarks.extend(self.diagnosis.iter().map(DiagnosisSummary::to_string));
        report
    }

    /// Its row of the table.
    pub(super) fn details(&self, job: &Job, timed: bool) -> FrameDetails {
        FrameDetails {
            target: job.target,
            t_cam_model: (&self.pose).into(),
            initial: Some(job.row.t_cam_model),
            posterior: self.confidence.clone(),
            iterations: self.iterations,
            seconds: timed.then_some(self.seconds),
            warnings: self.all_warnings(),
            track: None,
        }
    }

    /// Its JSON value.
    pub(super) fn summary(&self, job: &Job) -> serde_json::Value {
        json!({
            "scene_id": job.row.scene_id,
            "im_id": job.row.im_id,
            "obj_id": job.row.obj_id,
            "seconds": self.seconds,
            "iteration": self.iteration,
            "iterations": self.iterations,
            "t_cam_model_mm": self.pose.translation_m.map(|v| v * 1e3),
            "quaternion_wxyz": self.pose.quaternion_wxyz,
            "warnings": self.all_warnings(),
            "confidence": self.confidence,
            "diagnosis": self.diagnosis,
            "trace": self.trace,
        })
    }
}
