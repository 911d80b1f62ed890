//! Triangle meshes.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::ndarray::IxDyn;
use numpy::{PyArray, PyArrayMethods, PyUntypedArrayMethods};
use prehend_geometry::{Texture, TriMesh};
use pyo3::prelude::*;

use super::images;
use crate::arrays::{Numbers, array, faces, in_order, points};
use crate::error::{Raise, wrong};

/// A triangle mesh in meters, with colors or a texture where it has them.
///
/// vertices: n × 3 [m]; faces: m × 3, counter-clockwise seen from outside; colors: n × 3 in 0..1, sRGB; or uvs: n × 2, (0, 0) the lower left corner
/// of texture, H × W × 3 of uint8.
#[pyclass(name = "Mesh", frozen, module = "prehend")]
pub(crate) struct PyMesh {
    pub(crate) mesh: TriMesh,
}

#[pymethods]
impl PyMesh {
    #[new]
    #[pyo3(signature = (vertices, faces, *, colors=None, uvs=None, texture=None))]
    fn new(
        vertices: Numbers<'_>,
        faces: Numbers<'_>,
        colors: Option<Numbers<'_>>,
        uvs: Option<Numbers<'_>>,
        texture: Option<Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let vertices = points(&vertices, "vertices")?;
        let count = vertices.len();
        if let Some(at) = vertices.iter().position(|p| !p.coords.iter().all(|x| x.is_finite())) {
            return Err(wrong(format!("vertices: vertex {at} is not finite")));
        }
        let corners = self::faces(&faces, count)?;
        let mut mesh = TriMesh::new(vertices, corners);
        if let Some(colors) = colors {
            mesh.colors = Some(of_vertices::<3>(&colors, count, "colors")?);
            let outside = |color: &[f32; 3]| color.iter().any(|c| !(0.0..=1.0).contains(c));
            if mesh.colors.iter().flatten().any(outside) {
                return Err(wrong("colors: they are not all between 0 and 1"));
            }
        }
        match (uvs, texture) {
            (Some(uvs), Some(texture)) => {
                mesh.uvs = Some(of_vertices::<2>(&uvs, count, "uvs")?);
                let image = images::color(&texture)?;
                let (width, height) = (image.width(), image.height());
                let bytes = image.pixels().iter().map(|p| p.map(|c| (255.0 * c).round() as u8));
                mesh.texture = Some(Arc::new(Texture { width, height, pixels: bytes.collect() }));
            }
            (None, None) => {}
            _ => return Err(wrong("uvs and texture: one needs the other")),
        }
        Ok(Self { mesh })
    }

    /// Reads PLY, OBJ, STL, GLB or glTF; `scale` is how many meters one of the file's units is (1e-3 for millimeters).
    #[staticmethod]
    #[pyo3(signature = (path, scale=1.0))]
    fn load(path: PathBuf, scale: f64) -> PyResult<Self> {
        if !(scale.is_finite() && scale > 0.0) {
            return Err(wrong(format!("scale: {scale} is no length")));
        }
        Ok(Self { mesh: TriMesh::load(&path).raise()?.scaled(scale) })
    }

    /// n × 3 [m].
    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray<f64, IxDyn>>> {
        let numbers = self.mesh.vertices.iter().flat_map(|v| [v.x, v.y, v.z]).collect();
        array(py, numbers, &[self.mesh.vertices.len(), 3])
    }

    /// m × 3.
    #[getter]
    fn faces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray<i64, IxDyn>>> {
        let indices = self.mesh.faces.iter().flatten().map(|v| i64::from(*v)).collect();
        PyArray::from_vec(py, indices).reshape(IxDyn(&[self.mesh.faces.len(), 3]))
    }

    fn __repr__(&self) -> String {
        let look = match (&self.mesh.texture, &self.mesh.colors) {
            (Some(_), _) => ", texture",
            (None, Some(_)) => ", colors",
            (None, None) => "",
        };
        let (vertices, faces) = (self.mesh.vertices.len(), self.mesh.faces.len());
        format!("Mesh({vertices} vertices, {faces} faces{look})")
    }
}

/// N numbers for each vertex.
fn of_vertices<const N: usize>(
    array: &Numbers<'_>,
    count: usize,
    what: &str,
) -> PyResult<Vec<[f32; N]>> {
    if array.shape() != [count, N] {
        let shape = array.shape();
        return Err(wrong(format!("{what}: an array of {count} × {N} is expected, not {shape:?}")));
    }
    let numbers = in_order(array);
    Ok(numbers.as_chunks::<N>().0.iter().map(|row| row.map(|v| v as f32)).collect())
}
