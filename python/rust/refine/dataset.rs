//! Datasets in BOP's format.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use prehend_refine::data::bop::{self, Detections, GroundTruth};
use prehend_refine::data::{Assets, MaskSource, Target, find_targets, user_cache};
use pyo3::prelude::*;

use super::frame::PyFrame;
use super::object::PyObject;
use super::rig::PyRig;
use crate::arrays::{Array, matrix};
use crate::error::Raise;
use crate::threads::detached;

/// A split of a BOP dataset: `prehend.datasets.Bop` is made of it.
#[pyclass(name = "Dataset", frozen, subclass, module = "prehend")]
pub(crate) struct PyDataset {
    pub(super) dataset: bop::Dataset,
    assets: Mutex<Assets>,
}

impl PyDataset {
    pub(super) fn assets(&self) -> MutexGuard<'_, Assets> {
        self.assets.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl PyDataset {
    #[new]
    #[pyo3(signature = (path, split=None, *, rig=None, detections=None, seed=0))]
    fn new(
        path: PathBuf,
        split: Option<&str>,
        rig: Option<&PyRig>,
        detections: Option<PathBuf>,
        seed: u64,
    ) -> PyResult<Self> {
        let dataset = match split {
            Some(split) => bop::Dataset::open_split(&path, split),
            None => bop::Dataset::open(&path),
        };
        let dataset = dataset.raise()?;
        let detections = detections.map(|file| Detections::load(&file)).transpose().raise()?;
        let masks =
            detections.map_or(MaskSource::Files, |found| MaskSource::Detections(Arc::new(found)));
        let assets = Assets::new(&dataset, seed)
            .with_cache(user_cache())
            .with_masks(masks)
            .with_rig(rig.map(|rig| Arc::clone(&rig.rig)))
            .with_optional_masks();
        Ok(Self { dataset, assets: Mutex::new(assets) })
    }

    /// The numbers of its scenes.
    #[getter]
    fn scenes(&self) -> Vec<u32> {
        self.dataset.scenes().map(bop::DatasetScene::id).collect()
    }

    /// The numbers of the images of a scene.
    fn images(&self, scene: u32) -> PyResult<Vec<u32>> {
        self.dataset.scene(scene).raise()?.images().raise()
    }

    /// The numbers of its objects.
    #[getter]
    fn objects(&self) -> PyResult<Vec<u32>> {
        self.dataset.models().object_ids().raise()
    }

    /// The object of that number, prepared once.
    fn object(&self, py: Python<'_>, object: u32) -> PyResult<PyObject> {
        let object = detached(py, || self.assets().object(object))?.raise()?;
        Ok(PyObject { object })
    }

    /// Targets that the dataset lists, by the numbers of scene, image, object and mask.
    fn _listed(&self) -> PyResult<Vec<(u32, u32, u32, usize)>> {
        let all = find_targets(&self.dataset, None).raise()?;
        Ok(all.iter().map(|t| (t.scene_id, t.im_id, t.obj_id, t.instance)).collect())
    }

    /// The frame of an object in an image. `instance` is the number of its mask, where the image has several.
    #[pyo3(signature = (scene, image, object, instance=0))]
    fn frame(
        &self,
        py: Python<'_>,
        scene: u32,
        image: u32,
        object: u32,
        instance: usize,
    ) -> PyResult<PyFrame> {
        let target = Target { scene_id: scene, im_id: image, obj_id: object, instance };
        // Python's lock first let go: another thread may wait for it with the assets in hand.
        let input = detached(py, || self.assets().load(&target, None, &[]))?.raise()?;
        Ok(PyFrame { input, target: Some(target) })
    }

    /// The true poses in an image, with the numbers of their objects, in the order of their masks: (object, 4 × 4, camera ← object [m]).
    fn truth<'py>(
        &self,
        py: Python<'py>,
        scene: u32,
        image: u32,
    ) -> PyResult<Vec<(u32, Array<'py>)>> {
        let objects = GroundTruth::new(&self.dataset).objects(scene, image).raise()?;
        objects.iter().map(|o| Ok((o.obj_id, matrix(py, &o.t_cam_model)?))).collect()
    }

    fn __repr__(&self) -> String {
        let scenes = self.dataset.scenes().count();
        format!("Bop('{}', {scenes} scenes)", self.dataset.split_dir().display())
    }
}
