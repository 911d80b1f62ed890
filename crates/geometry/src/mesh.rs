//! Indexed triangle meshes and the textures painted on them.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3};

/// An indexed triangle mesh in meters, with optional per-vertex attributes.
///
/// Attribute vectors, where present, have one entry a vertex; a position on a texture seam is stored
/// once for each of its UVs (weld by position before asking topological questions).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriMesh {
    /// Vertex positions \[m\].
    pub vertices: Vec<Point3<f64>>,
    /// Vertex indices of each triangle, counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
    /// Unit normals, one a vertex.
    pub normals: Option<Vec<Vector3<f64>>>,
    /// Texture coordinates, one a vertex; (0, 0) is the lower-left corner of the image, v points up.
    pub uvs: Option<Vec<[f32; 2]>>,
    /// Colors in 0..=1 as stored in files (sRGB-encoded), one a vertex.
    pub colors: Option<Vec<[f32; 3]>>,
    /// The image that `uvs` refer to.
    pub texture: Option<Arc<Texture>>,
}

impl TriMesh {
    /// A mesh of positions and faces without attributes.
    pub fn new(vertices: Vec<Point3<f64>>, faces: Vec<[u32; 3]>) -> Self {
        Self { vertices, faces, ..Self::default() }
    }

    /// The mesh of `faces` alone, its vertices those that they use, in the order in which they do.
    pub(crate) fn compacted(
        vertices: &[Point3<f64>],
        faces: impl IntoIterator<Item = [u32; 3]>,
    ) -> Self {
        let mut new = vec![u32::MAX; vertices.len()];
        let mut used = Vec::new();
        let mut renumbered = |v: u32| {
            let id = &mut new[v as usize];
            if *id == u32::MAX {
                *id = used.len() as u32;
                used.push(vertices[v as usize]);
            }
            *id
        };
        let faces = faces.into_iter().map(|face| face.map(&mut renumbered)).collect();
        Self::new(used, faces)
    }

    /// The corner positions of face `face` \[m\].
    #[inline]
    pub fn triangle(&self, face: usize) -> [Point3<f64>; 3] {
        self.faces[face].map(|v| self.vertices[v as usize])
    }

    /// Twice the area of face `face` times its unit normal \[m²\].
    #[inline]
    pub fn area_vector(&self, face: usize) -> Vector3<f64> {
        let [a, b, c] = self.triangle(face);
        (b - a).cross(&(c - a))
    }

    /// Surface area \[m²\].
    pub fn area(&self) -> f64 {
        (0..self.faces.len()).map(|f| 0.5 * self.area_vector(f).norm()).sum()
    }

    /// Smallest and largest corner of the axis-aligned box around the faces \[m\], of a mesh without faces around its vertices; `None` without
    /// vertices.
    pub fn bounds(&self) -> Option<(Point3<f64>, Point3<f64>)> {
        type Corners = (Point3<f64>, Point3<f64>);
        let join = |a: Corners, b: Corners| (a.0.inf(&b.0), a.1.sup(&b.1));
        // Vertices that no face uses are no part of the surface.
        let used = self.faces.iter().flatten().filter_map(|&v| self.vertices.get(v as usize));
        let all = || self.vertices.iter().map(|v| (*v, *v)).reduce(join);
        used.map(|v| (*v, *v)).reduce(join).or_else(all)
    }

    /// Moves every vertex and normal by `t_new_mesh`, which maps mesh coordinates into the new frame.
    pub fn transformed(&self, t_new_mesh: &Isometry3<f64>) -> Self {
        let mut mesh = self.clone();
        mesh.vertices.iter_mut().for_each(|v| *v = t_new_mesh * *v);
        if let Some(normals) = &mut mesh.normals {
            normals.iter_mut().for_each(|n| *n = t_new_mesh * *n);
        }
        mesh
    }

    /// Multiplies every coordinate by `factor` (0.001 brings millimeters to meters). A negative factor reflects the
    /// body; its faces and normals still look outward.
    pub fn scaled(mut self, factor: f64) -> Self {
        self.vertices.iter_mut().for_each(|v| v.coords *= factor);
        if factor < 0.0 {
            self.faces.iter_mut().for_each(|f| f.swap(1, 2));
            self.normals.iter_mut().flatten().for_each(|n| *n = -*n);
        }
        self
    }

    /// Appends the geometry of `other`; attributes that only one side has are dropped.
    pub fn append(&mut self, other: &TriMesh) {
        fn join<T: Clone>(own: &mut Option<Vec<T>>, other: &Option<Vec<T>>) {
            match (own.as_mut(), other) {
                (Some(a), Some(b)) => a.extend_from_slice(b),
                _ => *own = None,
            }
        }
        if self.vertices.is_empty() {
            *self = other.clone();
            return;
        }
        let offset = self.vertices.len() as u32;
        self.vertices.extend_from_slice(&other.vertices);
        self.faces.extend(other.faces.iter().map(|f| f.map(|v| v + offset)));
        join(&mut self.normals, &other.normals);
        join(&mut self.uvs, &other.uvs);
        join(&mut self.colors, &other.colors);
        let same_texture = match (&self.texture, &other.texture) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (None, None) => true,
            _ => false,
        };
        if !same_texture {
            (self.uvs, self.texture) = (None, None);
        }
    }
}

/// An 8-bit RGB image, row-major from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// sRGB-encoded pixels, `width * height` of them, row-major from the top-left.
    pub pixels: Vec<[u8; 3]>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mass::signed_volume;
    use crate::shapes::cuboid;

    #[test]
    fn bounds_are_of_what_faces_use() {
        let mut mesh = cuboid(Vector3::new(0.1, 0.2, 0.3));
        let bounds = mesh.bounds();
        assert_eq!(bounds, Some((Point3::new(-0.05, -0.1, -0.15), Point3::new(0.05, 0.1, 0.15))));
        mesh.vertices.push(Point3::new(5.0, 0.0, 0.0));
        assert_eq!(mesh.bounds(), bounds);
        mesh.faces.clear();
        assert_eq!(mesh.bounds().unwrap().1, Point3::new(5.0, 0.1, 0.15));
        assert_eq!(TriMesh::default().bounds(), None);
    }

    #[test]
    fn a_reflected_body_still_looks_outward() {
        let mut mesh = cuboid(Vector3::new(1.0, 2.0, 3.0));
        mesh.normals = Some(mesh.vertex_normals());
        let scaled = mesh.scaled(-2.0);
        assert!((signed_volume(&scaled) - 48.0).abs() < 1e-12);
        let normals = scaled.normals.as_ref().unwrap();
        assert!(scaled.vertex_normals().iter().zip(normals).all(|(a, b)| (a - b).norm() < 1e-12));
    }
}
