//! A closed surface and the parts of it that matter to another.

use nalgebra::{Point3, Vector3};

use crate::box_tree::{Bounds, BoxTree};
use crate::mesh::TriMesh;
use crate::predicates::Plane;

/// Closed surfaces, taken as a chain: what counts is how often they wind about a point.
///
/// Nothing is asked of the faces but that along every edge as many run forward as back.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    /// Positions \[m\], all of them used.
    pub(super) positions: Vec<Point3<f64>>,
    pub(super) faces: Vec<[u32; 3]>,
    pub(super) bounds: Bounds,
}

/// The corners that the sides of a face join.
pub(super) const SIDES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];

/// The faces of a chain that share a point with a box.
pub(super) struct NearFaces {
    /// For each vertex of the chain, the sides of the box beyond which it lies ([`Bounds::beyond`]).
    pub(super) beyond: Vec<u8>,
    /// Faces in increasing order.
    pub(super) faces: Vec<u32>,
    /// Boxes of `faces`, by their places there.
    pub(super) tree: BoxTree,
}

impl Chain {
    /// The surface of `faces` with the positions they use; corners of a face differ, and positions are all finite.
    pub(super) fn new(
        positions: &[Point3<f64>],
        faces: impl IntoIterator<Item = [u32; 3]>,
    ) -> Self {
        let TriMesh { vertices, faces, .. } = TriMesh::compacted(positions, faces);
        Self { bounds: Bounds::of(&vertices), positions: vertices, faces }
    }

    pub(super) fn triangle(&self, face: usize) -> [&Point3<f64>; 3] {
        self.faces[face].map(|v| &self.positions[v as usize])
    }

    /// The vertices that a side of a face, three a face, runs from and to.
    pub(super) fn side(&self, side: u32) -> [u32; 2] {
        SIDES[side as usize % 3].map(|corner| self.faces[side as usize / 3][corner])
    }

    pub(super) fn region(&self, bounds: &Bounds) -> NearFaces {
        let beyond: Vec<u8> = self.positions.iter().map(|p| bounds.beyond(p)).collect();
        // A face apart from the box lies beyond one side of it with all corners.
        let is_apart =
            |f: &[u32; 3]| f.iter().fold(u8::MAX, |all, v| all & beyond[*v as usize]) != 0;
        let near = self.faces.iter().enumerate().filter(|(_, f)| !is_apart(f));
        let faces: Vec<u32> = near.map(|(f, _)| f as u32).collect();
        let boxes: Vec<Bounds> =
            faces.iter().map(|f| Bounds::of(self.triangle(*f as usize))).collect();
        NearFaces { tree: BoxTree::new(&boxes), beyond, faces }
    }

    /// How often the surface winds about each of `points` of the other body; this is A where `is_a`.
    pub(super) fn windings(&self, points: &[Point3<f64>], is_a: bool) -> Vec<i32> {
        if points.is_empty() {
            return Vec::new();
        }
        let mut beam = Bounds::of(points);
        beam.high.x = f64::INFINITY;
        let NearFaces { faces, tree, .. } = self.region(&beam);
        let winding = |point: &Point3<f64>| {
            let mut winding = 0;
            let mut count = |i: usize| {
                let triangle = self.triangle(faces[i] as usize);
                winding += Plane::new(triangle, is_a).along_x(point);
                true
            };
            tree.each(|bounds| bounds.is_ahead_of(point), &mut count);
            winding
        };
        points.iter().map(winding).collect()
    }
}

/// Volume under the faces \[m³\], of every part as often as they wind about it.
pub(super) fn volume(positions: &[Point3<f64>], faces: &[[u32; 3]]) -> f64 {
    let Some(first) = faces.first() else { return 0.0 };
    let origin = positions[first[0] as usize];
    let of = |f: &[u32; 3]| {
        let [a, b, c]: [Vector3<f64>; 3] = f.map(|v| positions[v as usize] - origin);
        a.dot(&b.cross(&c)) / 6.0
    };
    faces.iter().map(of).sum()
}
