//! Rigs learnt from frames of a dataset.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use prehend_refine::calibration::Calibrator;
use prehend_refine::data::{AssetError, Assets, Target, user_cache};
use prehend_refine::data::{Calibrated, CalibrationFrames};
use pyo3::prelude::*;

use super::dataset::PyDataset;
use super::poses::poses;
use super::rig::PyRig;
use super::run::at_least_one;
use super::settings::settings;
use crate::arrays::Numbers;
use crate::error::{Raise, wrong};
use crate::threads::detached;

/// `prehend.calibrate` is made of it: the rig, what is to be said of frames that were left out, and what is wrong with others. `ids` are the numbers of
/// scene, image, object and mask of each pose.
#[pyfunction]
#[pyo3(signature = (dataset, ids, poses, passes=6, window=None, settings=None))]
#[allow(clippy::type_complexity, clippy::too_many_arguments)] // as Python has it
pub(crate) fn _calibrate(
    py: Python<'_>,
    dataset: &PyDataset,
    ids: Vec<(u32, u32, u32, usize)>,
    poses: Numbers<'_>,
    passes: usize,
    window: Option<usize>,
    settings: Option<Bound<'_, PyAny>>,
) -> PyResult<(PyRig, Vec<String>, Vec<String>)> {
    let poses = self::poses(&poses, "poses")?;
    if poses.len() != ids.len() {
        return Err(wrong(format!("{} poses of {} objects in images", poses.len(), ids.len())));
    }
    let target =
        |&(scene_id, im_id, obj_id, instance)| Target { scene_id, im_id, obj_id, instance };
    let told: Vec<_> = ids.iter().map(target).zip(poses).collect();
    let targets: Vec<Target> = told.iter().map(|(target, _)| *target).collect();
    let passes = at_least_one(passes, "passes")?;
    let window = window.map(|window| at_least_one(window, "window")).transpose()?;
    let settings = self::settings(settings.as_ref())?.calibration();
    // Frames as they are, whatever rig the dataset is read with.
    let assets = Assets::new(&dataset.dataset, 0);
    let learn = move || -> Result<Calibrated, AssetError> {
        let mut assets = assets.with_cache(user_cache()).with_optional_masks();
        let numbers: BTreeSet<u32> = told.iter().map(|(target, _)| target.obj_id).collect();
        let objects: BTreeMap<_, _> = numbers
            .into_iter()
            .map(|id| Ok((id, assets.object(id)?)))
            .collect::<Result<_, AssetError>>()?;
        let frames = CalibrationFrames::new(assets, told);
        let (joints, size) = frames.layout()?;
        let nominal = Calibrator::new(joints.unwrap_or(0), size, objects, settings)?;
        frames.calibrate(nominal, passes, window, &mut |_| ())
    };
    let done = detached(py, learn)?.raise()?;
    let failed = done.failed.iter().map(|(index, error)| format!("{}: {error}", targets[*index]));
    let failed: Vec<String> = failed.collect();
    if done.poses.is_empty() {
        return Err(wrong(format!("no frame could be used: {}", failed.join("; "))));
    }
    let rig = PyRig { rig: Arc::new(done.calibrator.rig().clone()) };
    Ok((rig, done.left_out.into_values().collect(), failed))
}
