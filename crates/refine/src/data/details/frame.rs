//! Details of the result for a frame, and their columns.

use nalgebra::Isometry3;

use super::column::{TableColumn, Values};
use crate::scene::Target;
use crate::strategy::PosteriorSummary;
use crate::tracker::{Rejection, TrackStatus};

/// Details of the result for a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameDetails {
    /// Which object in which image.
    pub target: Target,
    /// Object coordinates → camera coordinates \[m\].
    pub t_cam_model: Isometry3<f64>,
    /// Initial pose (object → camera) \[m\], where one was refined.
    pub initial: Option<Isometry3<f64>>,
    /// How uncertain it is, where that is known.
    pub posterior: Option<PosteriorSummary>,
    /// Iterations made, or steps that lowered the cost.
    pub iterations: usize,
    /// Time that it took \[s\], where that is wanted.
    pub seconds: Option<f64>,
    /// Warnings.
    pub warnings: Vec<String>,
    /// How it was followed, if it was.
    pub track: Option<TrackDetails>,
}

/// Further details of a tracked frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackDetails {
    /// How its pose came about.
    pub status: TrackStatus,
    /// Why it was not followed, if it was tried.
    pub rejection: Option<Rejection>,
    /// Cost of the evidence \[nat\]; not a number if the frame was not looked at.
    pub cost: f64,
    /// When the image was taken by the clock of a robot's log \[ns\].
    pub stamp: Option<i64>,
}

/// The columns of `frames`, in their order.
///
/// Those of what no frame has, initial poses, weights or how it was followed, are left out; `docs/EXPORT.md` lists them all.
pub(super) fn details_table(frames: &[FrameDetails]) -> Vec<TableColumn> {
    let rows = || frames.iter();
    let id = |name, of: fn(&Target) -> i64| {
        TableColumn::new(name, rows().map(|frame| of(&frame.target)), Values::Integers)
    };
    let mut columns = vec![
        id("scene_id", |target| target.scene_id.into()),
        id("im_id", |target| target.im_id.into()),
        id("obj_id", |target| target.obj_id.into()),
        id("instance", |target| target.instance as i64),
        TableColumn::arrays("t_cam_model", &[4, 4], rows().map(|f| Some(matrix(&f.t_cam_model)))),
    ];
    if rows().any(|frame| frame.initial.is_some()) {
        let initial = rows().map(|frame| frame.initial.as_ref().map(matrix));
        columns.push(TableColumn::arrays("initial_t_cam_model", &[4, 4], initial));
    }
    columns.extend(of_posteriors(frames));
    let iterations = rows().map(|frame| frame.iterations as i64);
    columns.push(TableColumn::new("iterations", iterations, Values::Integers));
    let seconds = rows().map(|frame| frame.seconds.unwrap_or(f64::NAN));
    columns.push(TableColumn::new("seconds", seconds, Values::Numbers));
    columns.extend(of_tracks(frames));
    let warnings = rows().map(|frame| frame.warnings.join("\n"));
    columns.push(TableColumn::new("warnings", warnings, Values::Texts));
    // A column without anything in a row has as many rows as nobody can tell.
    columns.retain(|column| column.width() > 0);
    columns
}

/// Columns of the uncertainty of poses.
fn of_posteriors(frames: &[FrameDetails]) -> Vec<TableColumn> {
    let rows = || frames.iter().map(|frame| frame.posterior.as_ref());
    let array = |name, shape: &[usize], of: fn(&PosteriorSummary) -> Vec<f64>| {
        TableColumn::arrays(name, shape, rows().map(|p| p.map(of)))
    };
    let number = |name, of: fn(&PosteriorSummary) -> Option<f64>| {
        TableColumn::new(name, rows().map(|p| p.and_then(of).unwrap_or(f64::NAN)), Values::Numbers)
    };
    let text = |name, of: fn(&PosteriorSummary) -> String| {
        TableColumn::new(name, rows().map(|p| p.map(of).unwrap_or_default()), Values::Texts)
    };
    let most = rows().flatten().map(|p| p.weights.len()).max().unwrap_or(0);
    vec![
        array("center", &[3], |p| p.center_m.to_vec()),
        array("covariance", &[6, 6], |p| p.covariance.concat()),
        number("probability", |p| Some(p.probability)),
        number("fit", |p| p.fit),
        array("unobservable", &[6], |p| p.unobservable_mm.iter().map(|mm| mm * 1e-3).collect()),
        array("weights", &[most], |p| p.weights.clone()),
        text("misfits", |p| pairs(&p.misfits)),
        text("inconsistencies", |p| pairs(&p.inconsistencies)),
        text("scales", |p| pairs(&p.scales)),
        text("termination", |p| p.termination.clone()),
    ]
}

/// Columns of tracking; none if no frame was tracked.
fn of_tracks(frames: &[FrameDetails]) -> Vec<TableColumn> {
    let rows = || frames.iter().map(|frame| frame.track.as_ref());
    if rows().all(|track| track.is_none()) {
        return Vec::new();
    }
    let text = |name, of: fn(&TrackDetails) -> String| {
        TableColumn::new(name, rows().map(|t| t.map(of).unwrap_or_default()), Values::Texts)
    };
    let cost = rows().map(|track| track.map_or(f64::NAN, |t| t.cost));
    let mut columns = vec![
        text("status", |track| track.status.name().to_owned()),
        text("rejection", |track| track.rejection.map_or_else(String::new, |r| r.to_string())),
        TableColumn::new("cost", cost, Values::Numbers),
    ];
    let stamps: Option<Vec<i64>> = rows().map(|track| track.and_then(|t| t.stamp)).collect();
    columns.extend(stamps.map(|stamps| TableColumn::new("stamp_ns", stamps, Values::Integers)));
    columns
}

/// The 4×4 matrix of a pose, row-major.
fn matrix(pose: &Isometry3<f64>) -> Vec<f64> {
    pose.to_homogeneous().transpose().as_slice().to_vec()
}

/// Names and numbers, one pair a line.
fn pairs(pairs: &[(String, f64)]) -> String {
    pairs.iter().map(|(name, z)| format!("{name} {z}")).collect::<Vec<_>>().join("\n")
}
