//! Is a mesh a closed surface, and which way does it face at its edges and corners?

use nalgebra::Vector3;

use crate::mesh::TriMesh;
use crate::topology::{Edge, edges, non_manifold_vertices};

/// Cosine between the normals of two faces below which they are back to back: 150 degrees.
const FOLD: f64 = -0.866;

/// Angle-weighted pseudo-normals of a mesh welded by position.
///
/// Baerentzen and Aanaes, Signed distance computation using the angle weighted pseudonormal, 2005: on a
/// closed two-manifold the sign of `(p - c) · n` tells inside from outside at every closest point `c`.
#[derive(Clone, Debug)]
pub(super) struct PseudoNormals {
    /// Welded corner indices of each face.
    corners: Vec<[u32; 3]>,
    /// Pseudo-normals of the welded vertices.
    vertices: Vec<Vector3<f64>>,
    /// Welded vertices around which the surface all but folds back on itself, where it may cross itself too.
    folded: Vec<bool>,
    /// Pseudo-normals of the edges from corner i to corner i + 1 of each face.
    edges: Vec<[Vector3<f64>; 3]>,
}

impl PseudoNormals {
    /// Pseudo-normals, or `None` unless the welded mesh is a closed, consistently oriented two-manifold.
    pub(super) fn new(mesh: &TriMesh) -> Option<Self> {
        // Exactly: a face collapsed by a tolerance would still have an area, and count in its corners' normals.
        let weld = mesh.weld_within(0.0);
        let (corners, vertex_count) = (weld.faces(mesh), weld.positions.len());
        let edges = edges(&corners);
        let partners = partners(&edges, corners.len())?;
        if !non_manifold_vertices(&corners, &edges).is_empty() {
            return None;
        }
        let unit: Vec<Vector3<f64>> = (0..corners.len())
            .map(|f| {
                let area = mesh.area_vector(f);
                let norm = area.norm();
                if norm > 0.0 { area / norm } else { Vector3::zeros() }
            })
            .collect();
        let mut vertices = vec![Vector3::zeros(); vertex_count];
        for (f, corner) in corners.iter().enumerate() {
            let t = mesh.triangle(f);
            for i in 0..3 {
                let (u, v) = (t[(i + 1) % 3] - t[i], t[(i + 2) % 3] - t[i]);
                // atan2 keeps the small angles of slivers that acos would lose.
                let angle = u.cross(&v).norm().atan2(u.dot(&v));
                vertices[corner[i] as usize] += unit[f] * angle;
            }
        }
        let mut folded = vec![false; vertex_count];
        for (f, corner) in corners.iter().enumerate() {
            for i in 0..3 {
                // Faces on an edge that fold back spoil all around, as does a face turned from its corner.
                let across = partners[3 * f + i].map_or(1.0, |g| unit[f].dot(&unit[g / 3]));
                if across < FOLD {
                    let opposite = partners[3 * f + i].map_or(f, |g| g / 3);
                    for v in corner.iter().chain(&corners[opposite]) {
                        folded[*v as usize] = true;
                    }
                }
                let v = corner[i] as usize;
                folded[v] |= unit[f].dot(&vertices[v]) < 0.0;
            }
        }
        let edges = (0..corners.len())
            .map(|f| {
                [0, 1, 2].map(|i| partners[3 * f + i].map_or(unit[f], |g| unit[f] + unit[g / 3]))
            })
            .collect();
        Some(Self { corners, vertices, folded, edges })
    }

    /// Whether the surface may fold back on itself at a corner of `face`.
    pub(super) fn is_folded(&self, face: usize) -> bool {
        self.corners[face].iter().any(|&v| self.folded[v as usize])
    }

    /// Pseudo-normal of corner `i` of `face`.
    pub(super) fn vertex(&self, face: usize, i: usize) -> Vector3<f64> {
        self.vertices[self.corners[face][i] as usize]
    }

    /// Pseudo-normal of the edge from corner `i` to the next of `face`.
    pub(super) fn edge(&self, face: usize, i: usize) -> Vector3<f64> {
        self.edges[face][i]
    }
}

/// For each half-edge `3 f + i` its opposite one (`None` on collapsed faces); `None` altogether if an
/// edge is open, shared by more than two faces, or run through twice in one direction.
fn partners(edges: &[Edge], faces: usize) -> Option<Vec<Option<usize>>> {
    let mut partners = vec![None; 3 * faces];
    for edge in edges {
        if !edge.is_manifold() {
            return None;
        }
        let [a, b] = [0, 1].map(|i| 3 * edge.uses[i].face as usize + edge.uses[i].corner as usize);
        (partners[a], partners[b]) = (Some(b), Some(a));
    }
    (!edges.is_empty()).then_some(partners)
}
