//! Copies of what never changes: the object itself.

use pyo3::prelude::*;

use crate::refine::{PyMesh, PyObject};
use crate::rollout::Rollout;
use crate::shape::PyShape;

macro_rules! immutable {
    ($($class:ident),*) => {$(
        #[pymethods]
        impl $class {
            fn __copy__(own: Py<Self>) -> Py<Self> {
                own
            }

            fn __deepcopy__(own: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
                own
            }
        }
    )*};
}

immutable!(PyMesh, PyObject, Rollout, PyShape);
