//! Networks that propose poses.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;

use crate::error::Raise;
use crate::threads::detached;

/// Network that proposes poses of one object, of a safetensors file that `prehend-learn` or others have made: for `Frame.search` and `Tracker`.
#[pyclass(frozen, module = "prehend")]
pub(crate) struct PoseNetwork {
    pub(super) network: Arc<prehend_refine::network::PoseNetwork>,
    file: PathBuf,
}

#[pymethods]
impl PoseNetwork {
    #[new]
    fn new(py: Python<'_>, file: PathBuf) -> PyResult<Self> {
        let network =
            detached(py, || prehend_refine::network::PoseNetwork::load(&file))?.raise()?;
        Ok(Self { network: Arc::new(network), file })
    }

    fn __repr__(&self) -> String {
        format!("PoseNetwork({})", self.file.display())
    }
}
