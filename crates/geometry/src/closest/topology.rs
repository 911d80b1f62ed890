//! Is a mesh a closed surface, and which way does it face at its edges and corners?

use nalgebra::Vector3;

use crate::mesh::TriMesh;
use crate::topology::{edges, is_collapsed};

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
        let partners = partners(&corners)?;
        if !fans_are_single(&corners, &partners, vertex_count) {
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
fn partners(corners: &[[u32; 3]]) -> Option<Vec<Option<usize>>> {
    let edges = edges(corners);
    let mut partners = vec![None; 3 * corners.len()];
    for edge in edges.iter() {
        if !edge.is_manifold() {
            return None;
        }
        let [a, b] = [0, 1].map(|i| 3 * edge.uses[i].face as usize + edge.uses[i].corner as usize);
        (partners[a], partners[b]) = (Some(b), Some(a));
    }
    (!edges.is_empty()).then_some(partners)
}

/// Whether the faces around every vertex form one fan: a vertex where two bodies touch has two.
fn fans_are_single(corners: &[[u32; 3]], partners: &[Option<usize>], vertex_count: usize) -> bool {
    let mut degree = vec![0usize; vertex_count];
    let mut start = vec![None; vertex_count];
    for (f, c) in corners.iter().enumerate().filter(|(_, c)| !is_collapsed(c)) {
        for i in 0..3 {
            degree[c[i] as usize] += 1;
            start[c[i] as usize] = Some(3 * f + i);
        }
    }
    (0..vertex_count).all(|v| {
        let Some(first) = start[v] else { return true };
        let mut half_edge = first;
        for turned in 1..=degree[v] {
            // The half-edge that enters the vertex, seen from the neighboring face, leaves it.
            let entering = half_edge - half_edge % 3 + (half_edge % 3 + 2) % 3;
            match partners[entering] {
                Some(next) => half_edge = next,
                None => return false,
            }
            if half_edge == first {
                return turned == degree[v];
            }
        }
        false
    })
}
