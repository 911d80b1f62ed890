//! Meshes to be rendered, from files or arrays of Python.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::PyUntypedArrayMethods;
use prehend_geometry::{Texture, TriMesh};
use prehend_render::RenderModel;
use pyo3::prelude::*;

use super::image::picture;
use crate::arrays::{Numbers, faces, in_order, points};
use crate::error::{Raise, wrong};

/// Colors of a mesh, in the place of its own.
pub(super) struct Look<'py> {
    pub(super) colors: Option<Numbers<'py>>,
    pub(super) uvs: Option<Numbers<'py>>,
    pub(super) texture: Option<Bound<'py, PyAny>>,
}

/// The model of a mesh: the path of a file, or vertices (n × 3) and faces (m × 3).
pub(super) fn model(mesh: &Bound<'_, PyAny>, look: &Look<'_>) -> PyResult<Arc<RenderModel>> {
    let mut mesh = read(mesh)?;
    if let Some(colors) = &look.colors {
        mesh.colors = Some(rows(colors, "colors")?);
        mesh.texture = None;
    }
    if let Some(uvs) = &look.uvs {
        mesh.uvs = Some(rows(uvs, "uvs")?);
    }
    if let Some(texture) = &look.texture {
        let image = picture(texture)?;
        if mesh.uvs.is_none() {
            return Err(wrong("texture: the mesh has no texture coordinates, give uvs (n × 2)"));
        }
        let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
        let pixels = image.pixels().iter().map(|c| c.map(byte)).collect();
        let (width, height) = (image.width(), image.height());
        mesh.texture = Some(Arc::new(Texture { width, height, pixels }));
    }
    RenderModel::new(&mesh).map(Arc::new).raise()
}

fn read(mesh: &Bound<'_, PyAny>) -> PyResult<TriMesh> {
    if let Ok((vertices, faces)) = mesh.extract::<(Numbers<'_>, Numbers<'_>)>() {
        let vertices = points(&vertices, "vertices")?;
        let faces = self::faces(&faces, vertices.len())?;
        return Ok(TriMesh::new(vertices, faces));
    }
    if let Ok(mesh) = mesh.cast::<crate::refine::PyMesh>() {
        return Ok(mesh.get().mesh.clone());
    }
    let Ok(path) = mesh.extract::<PathBuf>() else {
        return Err(wrong(
            "mesh: a Mesh is expected, a path, or vertices (n × 3) and faces (m × 3)",
        ));
    };
    TriMesh::load(&path).raise()
}

/// Rows of `N` numbers, in single precision as the renderer keeps them.
fn rows<const N: usize>(array: &Numbers<'_>, what: &str) -> PyResult<Vec<[f32; N]>> {
    match array.shape() {
        [_, n] if *n == N => Ok(single(&in_order(array))),
        shape => Err(wrong(format!("{what}: an array of n × {N} is expected, not {shape:?}"))),
    }
}

/// Numbers by `N` in single precision.
pub(super) fn single<const N: usize>(values: &[f64]) -> Vec<[f32; N]> {
    values.as_chunks().0.iter().map(|row: &[f64; N]| row.map(|v| v as f32)).collect()
}
