//! Networks that propose poses.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;

use super::settings::settings;
use crate::error::Raise;
use crate::threads::detached;

/// Network that proposes poses of one object, of a safetensors file that `prehend-learn` or others have made: for `Frame.search` and `Tracker`. `settings`
/// are as `Frame.refine` has them.
#[pyclass(name = "PoseNetwork", frozen, module = "prehend")]
pub(crate) struct PyPoseNetwork {
    pub(super) network: Arc<prehend_refine::network::PoseNetwork>,
    file: PathBuf,
}

#[pymethods]
impl PyPoseNetwork {
    #[new]
    #[pyo3(signature = (file, *, settings=None))]
    fn new(py: Python<'_>, file: PathBuf, settings: Option<Bound<'_, PyAny>>) -> PyResult<Self> {
        let settings = self::settings(settings.as_ref())?.network;
        let network =
            detached(py, || prehend_refine::network::PoseNetwork::load(&file))?.raise()?;
        let network = network.with_settings(settings).raise()?;
        Ok(Self { network: Arc::new(network), file })
    }

    fn __repr__(&self) -> String {
        format!("PoseNetwork({})", self.file.display())
    }
}
