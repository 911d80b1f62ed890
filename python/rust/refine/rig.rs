//! Rigs: what is wrong with camera, hand and models in all frames.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::PyArray;
use numpy::ndarray::IxDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::object::PyObject;
use crate::arrays::array;
use crate::error::Raise;
use crate::threads::detached;

/// Calibration of a rig of camera and hand: errors that all of its frames share, as `calibrate` has found them.
#[pyclass(name = "Rig", frozen, module = "prehend")]
pub(crate) struct PyRig {
    pub(super) rig: Arc<prehend_refine::rig::Rig>,
}

#[pymethods]
impl PyRig {
    /// Reads a rig from a JSON file.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        Ok(Self { rig: Arc::new(prehend_refine::rig::Rig::load(&path).raise()?) })
    }

    /// Writes the rig to a JSON file, which appears whole or not at all.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        self.rig.save(&path).raise()
    }

    /// The object of that number with the surface that the rig has found and its own mass; as it is, if the rig does not know the number.
    fn corrected(&self, py: Python<'_>, object: &PyObject, object_id: u32) -> PyResult<PyObject> {
        let given = Arc::clone(&object.object);
        let corrected = detached(py, || self.rig.corrected_object(object_id, &given))?.raise()?;
        Ok(PyObject { object: corrected.map_or(given, Arc::new) })
    }

    /// Corrections by name [m, rad; focal lengths], without the smooth field of depth offsets.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let parameters = PyDict::new(py);
        for (name, value) in self.rig.parameters() {
            parameters.set_item(name, value)?;
        }
        Ok(parameters)
    }

    /// The covariance of its parameters, first those of `parameters` in their order, then coefficients of depth's field [m].
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray<f64, IxDyn>>> {
        let covariance = &self.rig.covariance;
        array(py, covariance.as_slice().to_vec(), &[covariance.nrows(), covariance.ncols()])
    }

    /// The numbers of the objects whose surfaces it corrects.
    #[getter]
    fn objects(&self) -> Vec<u32> {
        self.rig.objects.keys().copied().collect()
    }
}
