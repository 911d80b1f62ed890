//! A closed surface prepared for meeting another.

use nalgebra::{Point3, Vector3};

use crate::box_tree::{Bounds, BoxTree};
use crate::predicates::Plane;

/// Closed surfaces, taken as a chain: what counts is how often they wind about a point.
///
/// Nothing is asked of the faces but that along every edge as many run forward as back.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    pub(super) positions: Vec<Point3<f64>>,
    pub(super) faces: Vec<[u32; 3]>,
    pub(super) tree: BoxTree,
    /// A vertex of every connected piece.
    roots: Vec<u32>,
    /// The sides of faces that lead from the roots to all other vertices, every vertex after the one it is reached from.
    steps: Vec<ChainStep>,
}

#[derive(Clone, Copy, Debug)]
struct ChainStep {
    from: u32,
    to: u32,
    /// The side of a face between them, three a face.
    side: u32,
}

/// The corners that the sides of a face join.
pub(super) const SIDES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];

impl Chain {
    /// Faces whose corners differ, between positions that are all finite; at least one face.
    pub(super) fn new(positions: Vec<Point3<f64>>, faces: Vec<[u32; 3]>) -> Self {
        let boxes: Vec<Bounds> = faces.iter().map(|f| bounds(&positions, f)).collect();
        let tree = BoxTree::new(&boxes);
        let (roots, steps) = spanning_forest(positions.len(), &faces);
        Self { positions, faces, tree, roots, steps }
    }

    pub(super) fn triangle(&self, face: usize) -> [&Point3<f64>; 3] {
        self.faces[face].map(|v| &self.positions[v as usize])
    }

    /// The vertices that a side of a face runs from and to.
    pub(super) fn side(&self, side: u32) -> [u32; 2] {
        SIDES[side as usize % 3].map(|corner| self.faces[side as usize / 3][corner])
    }

    /// How often the surface winds about `point` of the other body; this is A where `is_a`.
    pub(super) fn winding(&self, point: &Point3<f64>, is_a: bool) -> i32 {
        let mut winding = 0;
        self.tree.each(
            |bounds| bounds.is_ahead_of(point),
            |face| {
                winding += Plane::new(self.triangle(face), is_a).along_x(point);
                true
            },
        );
        winding
    }

    /// How often `other` winds about each vertex, given by how much that changes along every side of a face.
    pub(super) fn windings(&self, other: &Self, change: &[i32], other_is_a: bool) -> Vec<i32> {
        let mut windings = vec![0; self.positions.len()];
        for &root in &self.roots {
            windings[root as usize] = other.winding(&self.positions[root as usize], other_is_a);
        }
        for step in &self.steps {
            let forward = self.side(step.side)[0] == step.from;
            let change = change[step.side as usize];
            windings[step.to as usize] =
                windings[step.from as usize] + if forward { change } else { -change };
        }
        windings
    }
}

fn bounds(positions: &[Point3<f64>], face: &[u32; 3]) -> Bounds {
    Bounds::of(face.iter().map(|v| &positions[*v as usize]))
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

fn spanning_forest(vertices: usize, faces: &[[u32; 3]]) -> (Vec<u32>, Vec<ChainStep>) {
    // Sides at each vertex, by counting.
    let mut start = vec![0_u32; vertices + 1];
    for v in faces.iter().flatten() {
        start[*v as usize + 1] += 2;
    }
    for v in 0..vertices {
        start[v + 1] += start[v];
    }
    let mut place = start.clone();
    let mut at = vec![0_u32; 6 * faces.len()];
    for (f, face) in faces.iter().enumerate() {
        for (k, corners) in SIDES.iter().enumerate() {
            for corner in corners {
                let place = &mut place[face[*corner] as usize];
                at[*place as usize] = (3 * f + k) as u32;
                *place += 1;
            }
        }
    }
    let mut seen = vec![false; vertices];
    let (mut roots, mut steps) = (Vec::new(), Vec::with_capacity(vertices));
    for root in 0..vertices {
        // A vertex of no face bounds nothing.
        if seen[root] || start[root] == start[root + 1] {
            continue;
        }
        seen[root] = true;
        roots.push(root as u32);
        let mut next = steps.len();
        let mut from = root as u32;
        loop {
            for &side in &at[start[from as usize] as usize..start[from as usize + 1] as usize] {
                let face = faces[side as usize / 3];
                let [a, b] = SIDES[side as usize % 3].map(|corner| face[corner]);
                let to = if a == from { b } else { a };
                if !seen[to as usize] {
                    seen[to as usize] = true;
                    steps.push(ChainStep { from, to, side });
                }
            }
            let Some(step) = steps.get(next) else { break };
            (from, next) = (step.to, next + 1);
        }
    }
    (roots, steps)
}
