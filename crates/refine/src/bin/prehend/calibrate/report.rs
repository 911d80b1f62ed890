//! What a calibration has changed, for people.

use std::collections::BTreeMap;
use std::path::PathBuf;

use nalgebra::Isometry3;
use prehend_refine::Workers;
use prehend_refine::calibration::{
    CalibrationFrame, Calibrator, FrameResiduals, Residuals, SensorResidual,
};
use prehend_refine::data::{Calibrated, CalibrationFrames};
use prehend_refine::evaluate::report::{Report, depth_residual_picture, rig_picture};
use prehend_render::RgbImage;

use crate::failures::Failures;
use crate::terminal::progress;

/// Frames that are drawn.
const DRAWN: usize = 6;

/// Residuals \[m\] of the brightest colors.
const BRIGHTEST: f64 = 3e-3;

/// A frame with the nominal rig and the pose that it has by itself, and with the rig that was found.
struct Compared {
    before: FrameResiduals,
    after: FrameResiduals,
    alone: Isometry3<f64>,
}

/// Name, value, standard deviation and that beforehand of each parameter, but for the coefficients of depth's field.
pub(super) fn parameter_rows(calibrator: &Calibrator) -> Vec<[String; 4]> {
    let rig = calibrator.rig();
    let sigmas = rig.covariance.diagonal().map(f64::sqrt);
    let rows = rig.parameters().into_iter().zip(sigmas.iter().zip(calibrator.prior_sigmas()));
    let number = |value: f64| format!("{value:.5}");
    rows.map(|((name, value), (sigma, before))| {
        [name, number(value), number(*sigma), number(before)]
    })
    .collect()
}

/// Writes the report of `done`, which began with the `nominal` rig, of images of this size, and returns its page; of frames that cannot be shown `failures` hears.
pub(super) fn write(
    mut report: Report,
    frames: &CalibrationFrames,
    (nominal, size): (&Calibrator, (usize, usize)),
    done: &Calibrated,
    failures: &mut Failures,
) -> anyhow::Result<PathBuf> {
    let used = |index: &&usize| !done.left_out.contains_key(index);
    let indices: Vec<usize> = done.poses.keys().filter(used).copied().collect();
    let step = indices.len().div_ceil(DRAWN).max(1);
    let mut drawn: BTreeMap<usize, Isometry3<f64>> =
        indices.iter().step_by(step).map(|index| (*index, Isometry3::identity())).collect();
    let [mut before, mut after] = [Residuals::new(size), Residuals::new(size)];
    let bar = progress(indices.len(), "comparing");
    let report_of = |index: usize| format!("{}: report", frames.poses[index].0);
    let compare = |index: usize| compare(frames, nominal, done, index);
    let workers = Workers::new(indices.len(), rayon::current_num_threads())?;
    workers.run_in_order(&indices, compare, |index, outcome| {
        bar.inc(1);
        let Some(frame) = failures.keep(report_of(index), outcome) else {
            drawn.remove(&index);
            return;
        };
        before.add(&frame.before);
        after.add(&frame.after);
        drawn.entry(index).and_modify(|pose| *pose = frame.alone);
    });
    bar.finish_and_clear();
    let (old, new) = (before.sensors(), after.sensors());
    let number = |value: Option<f64>| value.map_or("–".into(), |value| format!("{value:.2}"));
    let row = |old: &SensorResidual| {
        let new = new.iter().find(|new| new.sensor == old.sensor);
        let values =
            [Some(old.size), new.map(|new| new.size), old.offset, new.and_then(|new| new.offset)];
        let name = format!("{} [{}]", old.sensor, old.unit);
        std::iter::once(name).chain(values.map(number)).collect::<Vec<_>>()
    };
    report.add_table(
        "Residuals by sensor, where all calibrations are believed: medians over frames of the frames' medians",
        ["sensor", "size before", "size after", "offset before", "offset after"],
        old.iter().map(row),
    );
    let picture = depth_residual_picture(&before, &after, BRIGHTEST);
    let what = format!(
        "Mean residual of depth over the image, of hand and object, before and after: red is measured too far away, blue too near, by \
         {:.0} mm where colors are full",
        BRIGHTEST * 1e3
    );
    report.add_comparison(&what, &picture)?;
    report.add_table(
        "Parameters: lengths in meters, angles in radians, the principal point in focal lengths",
        ["parameter", "value", "standard deviation", "beforehand"],
        parameter_rows(&done.calibrator),
    );
    if !done.left_out.is_empty() {
        report.add_table("Left out", ["frame"], done.left_out.values().map(|f| [f.clone()]));
    }
    for (&index, alone) in &drawn {
        let pictures = draw(frames, nominal, done, index, alone);
        if let Some(pictures) = failures.keep(report_of(index), pictures) {
            let target = frames.poses[index].0;
            let what = format!("{target}: outlines of object and hand (blue) before and after");
            report.add_comparison(&what, &pictures)?;
        }
    }
    Ok(report.finish()?)
}

/// The frame of that index before and after.
fn compare(
    frames: &CalibrationFrames,
    nominal: &Calibrator,
    done: &Calibrated,
    index: usize,
) -> anyhow::Result<Compared> {
    let frame = frames.load(index, &done.poses[&index])?;
    let after = done.calibrator.residuals(&frame)?;
    let alone = nominal.visit(&frame)?.t_cam_object;
    let before = nominal.residuals(&CalibrationFrame { initial: alone, ..frame })?;
    Ok(Compared { before, after, alone })
}

/// The frame of that index with the nominal rig and the pose that it has by itself, and with the rig that was found.
fn draw(
    frames: &CalibrationFrames,
    nominal: &Calibrator,
    done: &Calibrated,
    index: usize,
    alone: &Isometry3<f64>,
) -> anyhow::Result<[RgbImage; 2]> {
    let frame = frames.load(index, &done.poses[&index])?;
    let after = done.calibrator.rig().corrected(&frame.frame)?;
    let [object, corrected] =
        [nominal.object(frame.obj_id)?, done.calibrator.object(frame.obj_id)?];
    let before = (&frame.frame, &**object, alone);
    Ok(rig_picture(before, (&after, corrected, &frame.initial)))
}
