//! The renderer: pictures of a mesh as functions of arrays.

use std::sync::Arc;

use numpy::ndarray::IxDyn;
use numpy::{PyArray, PyArrayMethods};
use prehend_render::{Camera, Light, Mode, RenderModel, Rendering, render_each};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::camera::camera;
use super::light::to_array;
use super::mesh::{Look, model};
use super::mode::mode;
use super::pullback::{RenderPullback, picture};
use crate::arrays::{Array, Numbers, array, vector_or};
use crate::threads::detached;

/// Pictures of a mesh, with derivatives by its pose and by all that makes them.
///
/// `mesh` is the path of a file (OBJ, PLY, STL, glTF), or vertices (n × 3, m) and faces (m × 3, counter-clockwise seen from outside). `K` is the
/// camera matrix (3 × 3, px; pixel centers at whole numbers), `size` the rows and columns (H, W) of the pictures. Colors of vertices
/// (`colors`, n × 3), or a `texture` (H × W × 3, bytes or 0..1; `uvs`, n × 2, v upwards), take the place of the mesh's own; without any it is gray.
/// `light` is an array of 3 × 5 (`ambient_light`, the default, and `headlight` make some), `background` a color.
///
/// `mode` is "contour", sharp and exact (settings `half_width` of the band across outlines, px, and `creases`), or "softras", the
/// soft rasterizer in the form of PyTorch3D (`sigma`, `gamma`, `blur_radius`, `faces_per_pixel`, `z_near`, `z_far`, `perspective_correct`,
/// `clip_barycentric`, `cull_backfaces`).
///
/// Vertices of the mesh at one place are one: `vertices` and `faces` are those that the renderer has. Shapes and colors are kept in single precision, all else is
/// computed in double.
#[pyclass(name = "Renderer", frozen, module = "prehend")]
pub(crate) struct PyRenderer {
    pub(super) model: Arc<RenderModel>,
    pub(super) camera: Camera,
    pub(super) mode: Mode,
    pub(super) light: Light,
    pub(super) background: [f64; 3],
}

impl PyRenderer {
    /// The pictures, and what carries derivatives back.
    fn rendered(
        &self,
        py: Python<'_>,
        pose: &Numbers<'_>,
        others: [&Option<Numbers<'_>>; 6],
    ) -> PyResult<(Vec<Rendering<Light>>, RenderPullback)> {
        let inputs = self.inputs(pose, others)?;
        let scenes = self.scenes(&inputs)?;
        let renderings = detached(py, || render_each(self.mode, &scenes))?;
        let scenes = scenes.into_iter().map(|(scene, _)| scene).collect();
        let pullback = RenderPullback::new(scenes, inputs.batched(), inputs.batch.is_some());
        Ok((renderings, pullback))
    }
}

#[pymethods]
impl PyRenderer {
    #[new]
    #[pyo3(signature = (mesh, K, size, *, colors=None, uvs=None, texture=None, light=None, background=None, mode="contour", **settings))]
    #[expect(non_snake_case, clippy::too_many_arguments)] // Python's own
    fn new(
        mesh: &Bound<'_, PyAny>,
        K: Numbers<'_>,
        size: (usize, usize),
        colors: Option<Numbers<'_>>,
        uvs: Option<Numbers<'_>>,
        texture: Option<Bound<'_, PyAny>>,
        light: Option<Numbers<'_>>,
        background: Option<Numbers<'_>>,
        mode: &str,
        settings: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        Ok(Self {
            model: model(mesh, &Look { colors, uvs, texture })?,
            camera: camera(&K, size)?,
            mode: self::mode(mode, settings)?,
            light: super::light::given(light.as_ref())?,
            background: vector_or(background.as_ref(), [0.0; 3], "background")?.into(),
        })
    }

    /// The picture of the mesh at `pose`, mesh to camera frame (4 × 4; x right, y down, z forward, m): its color (H, W, 3), coverage (H, W; 0..1), depth
    /// (H, W; m, 0 where there is nothing) and normal (H, W, 3; camera frame, zero where there is nothing).
    ///
    /// `vertices` (n × 3, m), `colors` (n × 3), `texels` (H × W × 3), `light` (3 × 5), `background` (3) and `intrinsics` (fx, fy, cx, cy; px) take
    /// the place of the renderer's own. With one more dimension in front, inputs are a batch; those without are the same for all its
    /// pictures, which are rendered side by side on all cores. What the matrix's upper left block lacks of a rotation, 1e-4 at most, is taken out: the
    /// nearest rotation counts.
    #[pyo3(signature = (pose, *, vertices=None, colors=None, texels=None, light=None, background=None, intrinsics=None))]
    #[expect(clippy::too_many_arguments)] // Python's own
    fn render<'py>(
        &self,
        py: Python<'py>,
        pose: Numbers<'py>,
        vertices: Option<Numbers<'py>>,
        colors: Option<Numbers<'py>>,
        texels: Option<Numbers<'py>>,
        light: Option<Numbers<'py>>,
        background: Option<Numbers<'py>>,
        intrinsics: Option<Numbers<'py>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let others = [&vertices, &colors, &texels, &light, &background, &intrinsics];
        let (renderings, pullback) = self.rendered(py, &pose, others)?;
        picture(py, &renderings, pullback.is_batch())
    }

    /// The picture as of `render`, and its pullback, which carries derivatives of a number by the picture back to the inputs.
    #[pyo3(signature = (pose, *, vertices=None, colors=None, texels=None, light=None, background=None, intrinsics=None))]
    #[expect(clippy::too_many_arguments)] // Python's own
    fn vjp<'py>(
        &self,
        py: Python<'py>,
        pose: Numbers<'py>,
        vertices: Option<Numbers<'py>>,
        colors: Option<Numbers<'py>>,
        texels: Option<Numbers<'py>>,
        light: Option<Numbers<'py>>,
        background: Option<Numbers<'py>>,
        intrinsics: Option<Numbers<'py>>,
    ) -> PyResult<(Bound<'py, PyAny>, RenderPullback)> {
        let others = [&vertices, &colors, &texels, &light, &background, &intrinsics];
        let (renderings, pullback) = self.rendered(py, &pose, others)?;
        Ok((picture(py, &renderings, pullback.is_batch())?, pullback.of(renderings)))
    }

    /// Vertices, mesh frame (n × 3, m): those of the mesh in their order, each place once.
    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let all = self.model.positions();
        let shape = [all.len(), 3];
        array(py, all.iter().flat_map(|p| [p.x, p.y, p.z]).collect(), &shape)
    }

    /// The faces drawn (m × 3), as indices of `vertices`.
    #[getter]
    fn faces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray<i64, IxDyn>>> {
        let all = self.model.faces();
        let shape = [all.len(), 3];
        PyArray::from_vec(py, all.iter().flatten().map(|v| i64::from(*v)).collect())
            .reshape(IxDyn(&shape))
    }

    /// Colors of `vertices` (n × 3), if the mesh is colored by vertices.
    #[getter]
    fn colors<'py>(&self, py: Python<'py>) -> PyResult<Option<Array<'py>>> {
        let Some(all) = self.model.vertex_colors() else { return Ok(None) };
        double(py, &all, &[all.len(), 3]).map(Some)
    }

    /// The texture (H × W × 3), if the mesh has one.
    #[getter]
    fn texels<'py>(&self, py: Python<'py>) -> PyResult<Option<Array<'py>>> {
        let Some((width, height, all)) = self.model.texture() else { return Ok(None) };
        double(py, all, &[height, width, 3]).map(Some)
    }

    /// The light (3 × 5).
    #[getter]
    fn light<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        to_array(py, &self.light)
    }

    /// The color before which the mesh is.
    #[getter]
    fn background<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        array(py, self.background.to_vec(), &[3])
    }

    /// fx, fy, cx and cy \[px\].
    #[getter]
    fn intrinsics<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let Camera { fx, fy, cx, cy, .. } = self.camera;
        array(py, vec![fx, fy, cx, cy], &[4])
    }

    /// Center of the mesh's bounding box, mesh frame \[m\]: twists turn about where the pose puts it.
    #[getter]
    fn center<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        array(py, self.model.center().iter().copied().collect(), &[3])
    }

    /// Rows and columns of the pictures.
    #[getter]
    fn size(&self) -> (usize, usize) {
        (self.camera.height, self.camera.width)
    }

    fn __repr__(&self) -> String {
        let Camera { width, height, .. } = self.camera;
        format!("Renderer({} faces, size=({height}, {width}))", self.model.face_count())
    }
}

fn double<'py>(py: Python<'py>, rows: &[[f32; 3]], shape: &[usize]) -> PyResult<Array<'py>> {
    array(py, rows.as_flattened().iter().map(|v| f64::from(*v)).collect(), shape)
}
