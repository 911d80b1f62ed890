//! Edges with a direction, and crease-aware normals.

use nalgebra::{Point3, Vector3};
use prehend_geometry::topology;

/// Marks an absent neighbor in [`Edge`].
pub(crate) const NONE: u32 = u32::MAX;

/// An edge of the welded mesh, directed as its first face runs through it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Edge {
    /// First vertex, then second vertex as seen by `face`.
    pub(crate) vertices: [u32; 2],
    /// The face that runs through the edge in this direction.
    pub(crate) face: u32,
    /// Corner of `face` at which the edge starts.
    pub(crate) corner: u8,
    /// The face that runs through it the other way, or [`NONE`] on a boundary.
    pub(crate) other: u32,
    /// Corner of `other` at which it starts the edge (in its own, opposite direction).
    pub(crate) other_corner: u8,
}

/// Pairs up the half-edges of `faces`. A half-edge without an opposite is a boundary; where more than two
/// faces meet, they are paired in order of appearance.
pub(crate) fn edges(faces: &[[u32; 3]]) -> Vec<Edge> {
    let mut out = Vec::with_capacity(faces.len() * 3 / 2);
    for topology::Edge { vertices: [low, high], uses } in topology::edges(faces) {
        let (back, ahead) = uses.split_at(uses.partition_point(|u| !u.forward));
        for i in 0..ahead.len().max(back.len()) {
            let (vertices, own, opposite) = match (ahead.get(i), back.get(i)) {
                (Some(own), opposite) => ([low, high], own, opposite),
                (None, Some(own)) => ([high, low], own, None),
                (None, None) => continue,
            };
            out.push(Edge {
                vertices,
                face: own.face,
                corner: own.corner,
                other: opposite.map_or(NONE, |o| o.face),
                other_corner: opposite.map_or(0, |o| o.corner),
            });
        }
    }
    out
}

/// The faces around each vertex, with their angles there.
pub(super) fn around(positions: &[Point3<f64>], faces: &[[u32; 3]]) -> Vec<Vec<(u32, f64)>> {
    let mut around: Vec<Vec<(u32, f64)>> = vec![Vec::new(); positions.len()];
    for (f, face) in faces.iter().enumerate() {
        let p = face.map(|v| positions[v as usize]);
        for k in 0..3 {
            let angle = (p[(k + 1) % 3] - p[k]).angle(&(p[(k + 2) % 3] - p[k]));
            around[face[k] as usize].push((f as u32, angle));
        }
    }
    around
}

/// A unit normal for each corner of each face: the mean of the normals of the faces around the vertex that
/// lie within `crease` \[rad\] of the face's own, weighted by their angles at the vertex.
pub(crate) fn corner_normals(
    positions: &[Point3<f64>],
    faces: &[[u32; 3]],
    face_normals: &[Vector3<f64>],
    crease: f64,
) -> Vec<[Vector3<f64>; 3]> {
    let around = around(positions, faces);
    let limit = crease.cos();
    let corner = |own: &Vector3<f64>, vertex: u32| {
        let mut sum = Vector3::zeros();
        for &(g, angle) in &around[vertex as usize] {
            let normal = face_normals[g as usize];
            if normal.dot(own) >= limit {
                sum += normal * angle;
            }
        }
        sum.try_normalize(1e-12).unwrap_or(*own)
    };
    faces.iter().zip(face_normals).map(|(face, own)| face.map(|v| corner(own, v))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use prehend_geometry::TriMesh;

    /// Two triangles over a common edge, folded by `angle` about the x axis, the edge stored twice.
    fn fold(angle: f64) -> TriMesh {
        let vertices = vec![
            Point3::new(0.0, 0.0, 0.0),
            Point3::new(1.0, 0.0, 0.0),
            Point3::new(0.5, 1.0, 0.0),
            Point3::new(0.0, 0.0, 0.0),
            Point3::new(1.0, 0.0, 0.0),
            Point3::new(0.5, -angle.cos(), -angle.sin()),
        ];
        TriMesh::new(vertices, vec![[0, 1, 2], [4, 3, 5]]).welded()
    }

    #[test]
    fn seams_weld_and_pair_up() {
        let faces = fold(0.3).faces;
        let edges = edges(&faces);
        assert_eq!(edges.len(), 5);
        let inner: Vec<&Edge> = edges.iter().filter(|e| e.other != NONE).collect();
        assert_eq!(inner.len(), 1);
        assert_eq!(inner[0].vertices, [0, 1]);
        // Every edge starts at the named corner of its face.
        for e in &edges {
            assert_eq!(faces[e.face as usize][e.corner as usize], e.vertices[0]);
            if e.other != NONE {
                assert_eq!(faces[e.other as usize][e.other_corner as usize], e.vertices[1]);
            }
        }
    }

    #[test]
    fn normals_smooth_below_the_crease_angle_only() {
        for (angle, smooth) in [(0.3f64, true), (1.2, false)] {
            let mesh = fold(angle);
            let normals = [0, 1].map(|f| mesh.area_vector(f).normalize());
            let corners = corner_normals(&mesh.vertices, &mesh.faces, &normals, 0.65);
            let tilt = corners[0][0].angle(&normals[0]);
            assert!((tilt - if smooth { angle / 2.0 } else { 0.0 }).abs() < 1e-9);
        }
    }
}
