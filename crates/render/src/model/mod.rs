//! A triangle mesh prepared for rendering.

mod crease;
mod edit;
mod mipmap;
mod normal_adjoint;
mod texels;
mod topology;

use glam::Vec3;
use nalgebra::{Matrix3, Point3, Vector3};
use prehend_geometry::TriMesh;
use prehend_geometry::topology::is_collapsed;

pub(crate) use mipmap::{Cell, Mipmap, Texel};
pub(crate) use topology::{Edge, NONE};

use crate::precision::single;

/// Faces that meet at less than this angle share a smooth normal \[rad\] (37.5 degrees).
const CREASE: f64 = 0.6545;

/// Why a mesh cannot be rendered.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// No face has an area.
    #[error("mesh has no face with an area ({faces} faces, {vertices} vertices)")]
    Empty {
        /// Faces of the mesh.
        faces: usize,
        /// Vertices of the mesh.
        vertices: usize,
    },
    /// A face refers to a vertex that does not exist.
    #[error("face {face} refers to vertex {index}, but there are {vertices}")]
    Index {
        /// The face.
        face: usize,
        /// The index it holds.
        index: u32,
        /// Vertices of the mesh.
        vertices: usize,
    },
    /// A vertex's position, texture coordinates or color are infinite or not numbers.
    #[error("vertex {vertex} has a position, texture coordinate or color that is not finite")]
    NotFinite {
        /// The vertex.
        vertex: usize,
    },
    /// Attributes of vertices, or numbers that should take the place of the model's own, are not as many as are needed.
    #[error("{found} {what} given, expected {expected}")]
    Count {
        /// `"uvs"`, `"positions"`, `"colors"` or `"texels"`.
        what: &'static str,
        /// Numbers given.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
    /// The texture has no pixels or not as many as its size says.
    #[error("texture of {width} x {height} has {found} pixels")]
    Texture {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Pixels it holds.
        found: usize,
    },
}

/// Where the unlit colors come from.
#[derive(Clone, Debug)]
pub(crate) enum Albedo {
    /// One color.
    Uniform([f32; 3]),
    /// A color for each corner of each face.
    Corners(Vec<[[f32; 3]; 3]>),
    /// A texture, and its coordinates for each corner of each face.
    Texture(Mipmap, Vec<[[f32; 2]; 3]>),
}

/// A triangle mesh prepared for rendering: welded topology for contours, crease-aware smooth normals, a
/// mip-mapped texture.
///
/// Immutable; share it by reference or `Arc` between threads and poses.
#[derive(Clone, Debug)]
pub struct RenderModel {
    /// Welded positions, mesh frame, relative to `center` \[m\].
    pub(crate) positions: Vec<Vec3>,
    /// Welded vertex indices of each face.
    pub(crate) faces: Vec<[u32; 3]>,
    /// Unit normals of each face's corners, mesh frame.
    pub(crate) normals: Vec<[Vec3; 3]>,
    pub(crate) edges: Vec<Edge>,
    /// Edges at which normals, texture coordinates or colors jump.
    pub(crate) creases: Vec<u32>,
    pub(crate) albedo: Albedo,
    /// Every edge has two faces: what faces away from the camera cannot be seen.
    pub(crate) closed: bool,
    /// Texels a meter of surface, 0 without a texture.
    pub(crate) texel_density: f64,
    center: Point3<f64>,
    radius: f64,
}

impl RenderModel {
    /// Prepares `mesh` (meters). Color comes from the texture if there is one with coordinates, else from
    /// the vertex colors, else it is mid-gray. Normals are computed, smooth across edges flatter than 37.5
    /// degrees; those of the mesh are not used. Faces without an area are dropped. A mesh whose edges all have two
    /// faces is drawn from outside only, any other from both sides.
    ///
    /// # Errors
    /// When no face has an area, or indices, positions, attributes or the texture are inconsistent.
    pub fn new(mesh: &TriMesh) -> Result<Self, ModelError> {
        check(mesh)?;
        let empty = ModelError::Empty { faces: mesh.faces.len(), vertices: mesh.vertices.len() };
        let (low, high) = mesh.bounds().ok_or(empty)?;
        let center = nalgebra::center(&low, &high);
        let extent = (high - low).norm();
        let weld = mesh.weld_within(1e-6 * extent);
        let welded = weld.faces(mesh);
        let positions = weld.positions;
        let kept: Vec<usize> = (0..mesh.faces.len())
            .filter(|&f| {
                !is_collapsed(&welded[f]) && mesh.area_vector(f).norm() > 1e-14 * extent * extent
            })
            .collect();
        if kept.is_empty() {
            return Err(empty);
        }
        let faces: Vec<[u32; 3]> = kept.iter().map(|&f| welded[f]).collect();
        let face_normals: Vec<Vector3<f64>> =
            kept.iter().map(|&f| mesh.area_vector(f).normalize()).collect();
        let normals = topology::corner_normals(&positions, &faces, &face_normals, CREASE);
        let edges = topology::edges(&faces);
        let (albedo, texel_density) = albedo(mesh, &kept)?;
        let radius = mesh.vertices.iter().map(|v| (v - center).norm()).fold(0.0, f64::max);
        let mut model = Self {
            positions: positions.iter().map(|p| single(&(p - center))).collect(),
            faces,
            normals: normals.iter().map(|n| n.each_ref().map(single)).collect(),
            closed: edges.iter().all(|e| e.other != NONE),
            edges,
            creases: Vec::new(),
            albedo,
            texel_density,
            center,
            radius,
        };
        model.find_creases();
        Ok(model)
    }

    /// Center of the bounding box, mesh frame \[m\].
    pub fn center(&self) -> Point3<f64> {
        self.center
    }

    /// Largest distance of a vertex from [`Self::center`] \[m\].
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Number of faces drawn.
    pub fn face_count(&self) -> usize {
        self.faces.len()
    }
}

fn check(mesh: &TriMesh) -> Result<(), ModelError> {
    let vertices = mesh.vertices.len();
    for (face, indices) in mesh.faces.iter().enumerate() {
        if let Some(&index) = indices.iter().find(|&&i| i as usize >= vertices) {
            return Err(ModelError::Index { face, index, vertices });
        }
    }
    let finite = |p: &Point3<f64>| p.iter().all(|v| v.is_finite());
    let uvs = mesh.uvs.iter().flatten().position(|uv| uv.iter().any(|v| !v.is_finite()));
    let colors = mesh.colors.iter().flatten().position(|c| c.iter().any(|v| !v.is_finite()));
    if let Some(vertex) = mesh.vertices.iter().position(|p| !finite(p)).or(uvs).or(colors) {
        return Err(ModelError::NotFinite { vertex });
    }
    let counts =
        [("uvs", mesh.uvs.as_ref().map(Vec::len)), ("colors", mesh.colors.as_ref().map(Vec::len))];
    counts
        .into_iter()
        .try_for_each(|(what, found)| expect(what, found.unwrap_or(vertices), vertices))
}

fn expect(what: &'static str, found: usize, expected: usize) -> Result<(), ModelError> {
    if found == expected { Ok(()) } else { Err(ModelError::Count { what, found, expected }) }
}

fn albedo(mesh: &TriMesh, kept: &[usize]) -> Result<(Albedo, f64), ModelError> {
    if let (Some(texture), Some(uvs)) = (&mesh.texture, &mesh.uvs) {
        let map = Mipmap::new(texture).ok_or(ModelError::Texture {
            width: texture.width,
            height: texture.height,
            found: texture.pixels.len(),
        })?;
        let corners: Vec<[[f32; 2]; 3]> =
            kept.iter().map(|&f| mesh.faces[f].map(|v| uvs[v as usize])).collect();
        let (width, height) = map.size();
        let (mut texels, mut area) = (0.0, 0.0);
        for (&f, [a, b, c]) in kept.iter().zip(&corners) {
            let edges = Matrix3::from_fn(|i, j| match (i, j) {
                (0 | 1, 0 | 1) => ([b, c][i][j] - a[j]) as f64,
                (2, 2) => 1.0,
                _ => 0.0,
            });
            texels += 0.5 * edges.determinant().abs() * (width * height) as f64;
            area += 0.5 * mesh.area_vector(f).norm();
        }
        return Ok((Albedo::Texture(map, corners), (texels / area).sqrt()));
    }
    if let Some(colors) = &mesh.colors {
        let corners = kept.iter().map(|&f| mesh.faces[f].map(|v| colors[v as usize])).collect();
        return Ok((Albedo::Corners(corners), 0.0));
    }
    Ok((Albedo::Uniform([0.5; 3]), 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    fn triangle() -> TriMesh {
        let vertices =
            vec![Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.0)];
        TriMesh::new(vertices, vec![[0, 1, 2]])
    }

    #[test]
    fn texel_density_is_texels_a_meter() {
        let mut mesh = triangle();
        mesh.uvs = Some(vec![[0.0, 0.0], [0.5, 0.0], [0.0, 0.5]]);
        mesh.texture = Some(Arc::new(prehend_geometry::Texture {
            width: 8,
            height: 8,
            pixels: vec![[9; 3]; 64],
        }));
        let model = RenderModel::new(&mesh).unwrap();
        assert!((model.texel_density - 4.0).abs() < 1e-9);
        assert!(!model.closed);
        assert_eq!(model.face_count(), 1);
        assert!((model.center() - Point3::new(0.5, 0.5, 0.0)).norm() < 1e-15);
    }

    #[test]
    fn inconsistent_meshes_are_errors() {
        assert!(matches!(RenderModel::new(&TriMesh::default()), Err(ModelError::Empty { .. })));
        let mut mesh = triangle();
        mesh.faces[0][1] = 7;
        assert!(matches!(
            RenderModel::new(&mesh),
            Err(ModelError::Index { face: 0, index: 7, .. })
        ));
        let mut mesh = triangle();
        mesh.vertices[2].y = f64::NAN;
        assert_eq!(RenderModel::new(&mesh).unwrap_err(), ModelError::NotFinite { vertex: 2 });
        let mut mesh = triangle();
        mesh.uvs = Some(vec![[0.0; 2], [0.0, f32::NAN], [0.0; 2]]);
        assert_eq!(RenderModel::new(&mesh).unwrap_err(), ModelError::NotFinite { vertex: 1 });
        let mut mesh = triangle();
        mesh.vertices[2] = Point3::new(2.0, 0.0, 0.0);
        assert!(matches!(RenderModel::new(&mesh), Err(ModelError::Empty { faces: 1, .. })));
        let mut mesh = triangle();
        mesh.colors = Some(vec![[0.0; 3]]);
        assert!(matches!(RenderModel::new(&mesh), Err(ModelError::Count { found: 1, .. })));
        let mut mesh = triangle();
        mesh.uvs = Some(vec![[0.0; 2]; 3]);
        mesh.texture =
            Some(Arc::new(prehend_geometry::Texture { width: 2, height: 2, pixels: Vec::new() }));
        assert!(matches!(RenderModel::new(&mesh), Err(ModelError::Texture { found: 0, .. })));
    }
}
