//! Robot hands, prepared once.

use std::path::PathBuf;
use std::sync::Arc;

use prehend_refine::data::user_cache;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::Raise;
use crate::read_options::read_options;
use crate::threads::detached;

/// A robot hand, prepared once for any number of frames: collision geometry of a URDF or MJCF file, and taxels of a CSV file with the columns idx, patch,
/// link, x_m, y_m, z_m, nx, ny, nz (position [m] and outward normal in the frame of the link).
///
/// Options of reading are those of `Model.add_urdf`. What takes long to prepare is kept in the user's cache folder, or in the one that PREHEND_CACHE names (empty: nowhere).
#[pyclass(name = "Hand", frozen, module = "prehend")]
pub(crate) struct PyHand {
    pub(super) hand: Arc<prehend_refine::Hand>,
}

#[pymethods]
impl PyHand {
    #[new]
    #[pyo3(signature = (path, taxels=None, **options))]
    fn new(
        py: Python<'_>,
        path: PathBuf,
        taxels: Option<PathBuf>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let (options, cache) = (read_options(options)?, user_cache());
        let (taxels, cache) = (taxels.as_deref(), cache.as_ref());
        let load = || prehend_refine::Hand::load_with(&path, taxels, cache, &options);
        let hand = detached(py, load)?;
        Ok(Self { hand: Arc::new(hand.raise()?) })
    }

    /// The names of its joints, in the order in which an array has their positions.
    #[getter]
    fn joints(&self) -> Vec<String> {
        self.hand.tree.joint_names().to_vec()
    }

    /// The links that carry its taxels, in the order in which an array has their forces.
    #[getter]
    fn taxels(&self) -> Vec<String> {
        self.hand.taxels.iter().map(|taxel| taxel.link.clone()).collect()
    }

    fn __repr__(&self) -> String {
        let (joints, taxels) = (self.hand.tree.joint_names().len(), self.hand.taxels.len());
        format!("Hand('{}', {joints} joints, {taxels} taxels)", self.hand.tree.name())
    }
}
