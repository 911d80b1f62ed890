//! Objects, prepared once.

use std::sync::Arc;

use nalgebra::Point3;
use prehend_geometry::mass::mass_properties;
use prehend_refine::scene::Inertial;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use super::mesh::PyMesh;
use crate::arrays::{Numbers, inertia, vector};
use crate::error::{Raise, wrong};
use crate::threads::detached;

/// An object whose pose is sought, prepared once for any number of frames: what takes long is made when it is first needed, and kept.
///
/// Its mass [kg], or density [kg/m³] (500, if neither is given), is spread evenly, which needs a closed mesh; or mass, center of mass `com` [m] and
/// `inertia` about it [kg m²] are all given, in the mesh's frame. `seed` decides where the surface is sampled.
#[pyclass(name = "Object", frozen, module = "prehend")]
pub(crate) struct PyObject {
    pub(super) object: Arc<prehend_refine::Object>,
}

/// The object that Python gave; a mesh is prepared, with a mass that is assumed.
pub(super) fn prepared(given: &Bound<'_, PyAny>) -> PyResult<Arc<prehend_refine::Object>> {
    if let Ok(object) = given.cast::<PyObject>() {
        return Ok(Arc::clone(&object.get().object));
    }
    let Ok(mesh) = given.cast::<PyMesh>() else {
        let kind = given.get_type();
        let text = format!(
            "an Object or a Mesh is expected, not {}; Mesh.load(path) reads one from a file",
            kind.name()?
        );
        return Err(PyTypeError::new_err(text));
    };
    let mesh = mesh.get().mesh.clone();
    let object =
        detached(given.py(), || prehend_refine::Object::with_mass("object", mesh, None, 0))?
            .raise()?;
    Ok(Arc::new(object))
}

#[pymethods]
impl PyObject {
    #[new]
    #[pyo3(signature = (mesh, *, mass=None, density=None, com=None, inertia=None, name="object", seed=0))]
    #[allow(clippy::too_many_arguments)] // as many as Python names
    fn new(
        py: Python<'_>,
        mesh: &PyMesh,
        mass: Option<f64>,
        density: Option<f64>,
        com: Option<Numbers<'_>>,
        inertia: Option<Numbers<'_>>,
        name: &str,
        seed: u64,
    ) -> PyResult<Self> {
        let inertial = match (mass, density, com, inertia) {
            (_, None, None, None) => None,
            (None, Some(density), None, None) => {
                if !(density.is_finite() && density > 0.0) {
                    return Err(wrong(format!("density: {density} kg/m³ is not positive")));
                }
                let (solid, _) = mesh.mesh.cleaned();
                Some(Inertial::from(mass_properties(&solid, density).raise()?))
            }
            (Some(mass), None, Some(com), Some(inertia)) => Some(Inertial {
                mass,
                center_of_mass: Point3::from(vector(&com, "com")?),
                inertia: self::inertia(&inertia)?,
            }),
            _ => {
                return Err(wrong("give one of mass, density, and all of mass, com and inertia"));
            }
        };
        let mesh = mesh.mesh.clone();
        let object = detached(py, || match inertial {
            Some(_) => prehend_refine::Object::new(name, mesh, inertial, seed),
            None => prehend_refine::Object::with_mass(name, mesh, mass, seed),
        })?;
        Ok(Self { object: Arc::new(object.raise()?) })
    }

    /// Its mass [kg].
    #[getter]
    fn mass(&self) -> f64 {
        self.object.inertial.mass
    }

    /// Its mesh, as it was given.
    #[getter]
    fn mesh(&self) -> PyMesh {
        PyMesh { mesh: self.object.mesh.clone() }
    }

    /// The center of its bounding box [m], about which twists of an estimate turn.
    #[getter]
    fn center(&self) -> [f64; 3] {
        self.object.center.coords.into()
    }

    fn __repr__(&self) -> String {
        let (name, mass) = (&self.object.name, self.object.inertial.mass);
        let assumed = if self.object.inertial_assumed { ", assumed" } else { "" };
        format!("Object('{name}', {mass:.3} kg{assumed})")
    }
}
