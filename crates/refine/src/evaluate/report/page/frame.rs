//! A frame on the page.

use std::collections::BTreeMap;

use nalgebra::Isometry3;
use serde::{Serialize, Serializer};

use super::document::{Chart, Column, LabeledPicture, Series};
use super::figures::{self, flags, pose_figures};
use super::scene::EncodedScene;
use crate::calibration::{FrameResiduals, SensorResidual};
use crate::data::details::FrameDetails;
use crate::error::RefineError;
use crate::estimator::EstimatorInput;
use crate::strategy::{PosteriorSummary, Trace};

/// A frame: a row of the table, and words.
#[derive(Serialize)]
pub struct FrameReport {
    /// Which frame.
    pub name: String,
    /// Status in a word or two; empty where there is nothing to say.
    pub status: String,
    /// Flags, each in a word or two: filters know them.
    pub flags: Vec<String>,
    /// Sentences.
    pub remarks: Vec<String>,
    /// Its numbers.
    #[serde(serialize_with = "by_key")]
    pub figures: Vec<(Column, Option<f64>)>,
    /// How sure the pose is, where that is known.
    pub posterior: Option<PosteriorSummary>,
    /// The frame as it was drawn, if it was.
    pub drawing: Option<DrawnFrame>,
}

impl FrameReport {
    /// A refined frame, with the errors \[m, rad\] of its pose and of the initial one, where the truth is known.
    pub fn refined(
        name: String,
        details: FrameDetails,
        [error, initial_error]: [Option<[f64; 2]>; 2],
        drawing: Option<DrawnFrame>,
    ) -> Self {
        let FrameDetails { t_cam_model: pose, initial, posterior, iterations, seconds, .. } =
            details;
        let moved = |initial: &Isometry3<f64>| {
            1e3 * (pose.translation.vector - initial.translation.vector).norm()
        };
        let turned =
            |initial: &Isometry3<f64>| pose.rotation.angle_to(&initial.rotation).to_degrees();
        let mut figures = pose_figures(error, posterior.as_ref());
        figures.extend([
            (figures::MOVED, initial.as_ref().map(moved)),
            (figures::TURNED, initial.as_ref().map(turned)),
            (figures::INITIAL_ERROR, initial_error.map(|[meters, _]| 1e3 * meters)),
            (figures::INITIAL_TURN, initial_error.map(|[_, radians]| radians.to_degrees())),
            (figures::SECONDS, seconds),
            (figures::ITERATIONS, Some(iterations as f64)),
        ]);
        let mut flags = posterior.as_ref().map_or_else(Vec::new, flags);
        if !details.warnings.is_empty() {
            flags.push("warning".to_owned());
        }
        let (status, remarks) = (String::new(), details.warnings);
        Self { name, status, flags, remarks, figures, posterior, drawing }
    }
}

/// Known figures by the keys of their columns.
fn by_key<S: Serializer>(
    figures: &[(Column, Option<f64>)],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let known = figures.iter().filter_map(|(column, value)| Some((column.key, (*value)?)));
    serializer.collect_map(known.collect::<BTreeMap<_, _>>())
}

/// Input and result of a frame to draw.
pub struct FrameDrawing<'a> {
    /// The observation and the object.
    pub input: &'a EstimatorInput<'a>,
    /// Where the object was said to be, where that is known (object → camera) \[m\].
    pub initial: Option<&'a Isometry3<f64>>,
    /// Where it was found \[m\].
    pub t_cam_object: &'a Isometry3<f64>,
    /// Covariance of the latter: see [`PosteriorSummary::covariance`].
    pub covariance: Option<&'a [[f64; 6]; 6]>,
    /// How the search went, where that was kept.
    pub trace: Option<&'a Trace>,
}

/// A frame that is drawn.
#[derive(Serialize)]
pub struct DrawnFrame {
    pub(super) pictures: [LabeledPicture; 2],
    pub(super) residuals: Vec<ResidualEntry>,
    pub(super) chart: Option<Chart>,
    pub(super) scene: EncodedScene,
}

/// Median residuals of a sensor.
#[derive(Serialize)]
pub(super) struct ResidualEntry {
    sensor: &'static str,
    unit: &'static str,
    before: Option<f64>,
    after: f64,
}

/// Residuals at both poses, by sensor.
pub(super) fn residuals(drawing: &FrameDrawing<'_>) -> Result<Vec<ResidualEntry>, RefineError> {
    let frame = drawing.input.prepared(None)?;
    let at = |pose| Ok::<_, RefineError>(FrameResiduals::of(&frame, pose)?.sensors());
    let before = drawing.initial.map_or(Ok(Vec::new()), at)?;
    let entry = |SensorResidual { sensor, unit, size, .. }| {
        let before = before.iter().find(|before| before.sensor == sensor).map(|before| before.size);
        ResidualEntry { sensor, unit, before, after: size }
    };
    Ok(at(drawing.t_cam_object)?.into_iter().map(entry).collect())
}

/// Each term's value, relative to its first one.
pub(super) fn loss_chart(trace: &Trace) -> Option<Chart> {
    let first = trace.iterations.first()?;
    let series = trace.terms.iter().enumerate().map(|(term, name)| {
        let scale = 1.0 / first.values[term].max(f64::MIN_POSITIVE);
        let point = |i: &crate::strategy::Iteration| [i.index as f64, i.values[term] * scale];
        Series { name: name.clone(), points: trace.iterations.iter().map(point).collect() }
    });
    Some(Chart {
        title: "Loss".into(),
        axes: ["iteration".into(), "loss / initial loss".into()],
        logarithmic: true,
        series: series.collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategy::Iteration;

    #[test]
    fn losses_are_relative_to_the_first() {
        assert!(loss_chart(&Trace::default()).is_none());
        let mut trace = Trace::new(["depth", "tactile"].into_iter());
        for index in 0..3 {
            let values = vec![4.0 / (1.0 + index as f64), 0.0];
            trace.iterations.push(Iteration { index, values, weights: vec![1.0, 0.0], step: 1e-3 });
        }
        let chart = loss_chart(&trace).unwrap();
        assert_eq!(chart.series[0].points, [[0.0, 1.0], [1.0, 0.5], [2.0, 1.0 / 3.0]]);
        assert_eq!(chart.series[1].points[2], [2.0, 0.0]);
    }
}
