//! Joining vertices that share a position.

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};

use crate::box_tree::Bounds;
use crate::mesh::TriMesh;

/// Positions closer than this fraction of the bounding box's diagonal count as one.
const RELATIVE_TOLERANCE: f64 = 1e-9;

pub(crate) fn is_finite(v: &Point3<f64>) -> bool {
    v.iter().all(|c| c.is_finite())
}

/// Equal for equal positions alone.
pub(crate) fn position_bits(v: &Point3<f64>) -> Vector3<u64> {
    // Adding zero makes one of the two zeros.
    v.coords.map(|c| (c + 0.0).to_bits())
}

fn finite_bounds(vertices: &[Point3<f64>]) -> Bounds {
    Bounds::of(vertices.iter().filter(|v| is_finite(v)))
}

/// The distinct positions of a mesh, in the order of their first appearance.
#[derive(Clone, Debug)]
pub struct Weld {
    /// The positions \[m\].
    pub positions: Vec<Point3<f64>>,
    /// For each vertex of the mesh, its entry in `positions`.
    pub index: Vec<u32>,
}

impl Weld {
    /// Joins equal positions only.
    fn exact(vertices: &[Point3<f64>]) -> Self {
        let mut known = HashMap::with_capacity(vertices.len());
        let mut weld = Self { positions: Vec::new(), index: Vec::with_capacity(vertices.len()) };
        for v in vertices {
            weld.index.push(*known.entry(position_bits(v)).or_insert_with(|| {
                weld.positions.push(*v);
                weld.positions.len() as u32 - 1
            }));
        }
        weld
    }

    fn new(vertices: &[Point3<f64>], tolerance: f64) -> Self {
        if tolerance <= 0.0 {
            return Self::exact(vertices);
        }
        let Bounds { low, high } = finite_bounds(vertices);
        // Cells much larger than the tolerance, so that most vertices look into one cell only; and not so small
        // that their numbers overflow.
        let cell = (8.0 * tolerance).max(1e-7 * (high - low).norm()).max(f64::MIN_POSITIVE);
        let cell_of = |v: Vector3<f64>| v.map(|c| (c / cell).floor() as i64);
        let mut cells: HashMap<Vector3<i64>, Vec<u32>> = HashMap::new();
        let mut weld = Self { positions: Vec::new(), index: Vec::with_capacity(vertices.len()) };
        for v in vertices {
            if !is_finite(v) {
                // Near to nothing.
                weld.index.push(weld.positions.len() as u32);
                weld.positions.push(*v);
                continue;
            }
            let offset = v - low;
            let reach = Vector3::repeat(tolerance);
            let (from, to) = (cell_of(offset - reach), cell_of(offset + reach));
            let mut found = None;
            'search: for x in from.x..=to.x {
                for y in from.y..=to.y {
                    for z in from.z..=to.z {
                        let near = cells.get(&Vector3::new(x, y, z)).into_iter().flatten();
                        found = near
                            .copied()
                            .find(|&i| (weld.positions[i as usize] - v).norm() <= tolerance);
                        if found.is_some() {
                            break 'search;
                        }
                    }
                }
            }
            weld.index.push(found.unwrap_or_else(|| {
                let new = weld.positions.len() as u32;
                weld.positions.push(*v);
                cells.entry(cell_of(offset)).or_default().push(new);
                new
            }));
        }
        weld
    }

    /// The faces of `mesh`, which must be the welded one, between the distinct positions.
    ///
    /// # Panics
    /// If a face refers to a vertex that the welded mesh has not.
    pub fn faces(&self, mesh: &TriMesh) -> Vec<[u32; 3]> {
        mesh.faces.iter().map(|f| f.map(|v| self.index[v as usize])).collect()
    }
}

impl TriMesh {
    /// Which vertices share a position, to 1e-9 of the bounding box's diagonal: what topological questions need
    /// where texture seams store vertices several times. Vertices that are not finite join no others.
    pub fn weld(&self) -> Weld {
        let Bounds { low, high } = finite_bounds(&self.vertices);
        let diagonal = if low.x <= high.x { (high - low).norm() } else { 0.0 };
        self.weld_within(RELATIVE_TOLERANCE * diagonal)
    }

    /// As [`TriMesh::weld`], joining vertices within `tolerance` \[m\] of the first of a cluster; 0 joins equal ones.
    pub fn weld_within(&self, tolerance: f64) -> Weld {
        Weld::new(&self.vertices, tolerance.max(0.0))
    }

    /// The mesh with one vertex a position (see [`TriMesh::weld`]) and without attributes.
    ///
    /// Faces keep their number and order; one whose corners fall together is kept as a degenerate face.
    pub fn welded(&self) -> TriMesh {
        let weld = self.weld();
        let faces = weld.faces(self);
        TriMesh::new(weld.positions, faces)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_positions_join_whatever_cell_they_fall_in() {
        // Pairs 0.9 tolerances apart on a line, at every phase of the cells.
        let tolerance = 1e-3;
        let mut vertices = Vec::new();
        for k in 0..1000 {
            let x = f64::from(k) * 3.17 * tolerance;
            vertices.push(Point3::new(x, -x, 0.5 * x));
            vertices.push(Point3::new(
                x + 0.5 * tolerance,
                -x + 0.5 * tolerance,
                0.5 * x + 0.5 * tolerance,
            ));
        }
        let weld = Weld::new(&vertices, tolerance);
        assert_eq!(weld.positions.len(), 1000);
        assert!(weld.index.chunks(2).enumerate().all(|(k, pair)| pair == [k as u32; 2]));
        assert_eq!(Weld::new(&vertices, 0.8 * tolerance).positions.len(), 2000);
    }

    #[test]
    fn exact_duplicates_join_without_tolerance_and_faces_keep_their_order() {
        let p = Point3::new;
        let mesh = TriMesh::new(
            vec![
                p(0., 0., 0.),
                p(1., 0., 0.),
                p(0., 1., 0.),
                p(1., 0., 0.),
                p(0., 1., 0.),
                p(1., 1., 0.),
            ],
            vec![[0, 1, 2], [1, 3, 2], [3, 5, 4]],
        );
        for weld in [mesh.weld(), mesh.weld_within(0.0)] {
            assert_eq!(weld.index, [0, 1, 2, 1, 2, 3]);
            assert_eq!(weld.faces(&mesh), [[0, 1, 2], [1, 1, 2], [1, 3, 2]]);
        }
        let zeros = TriMesh::new(vec![p(0., 0., 0.), p(-0., 0., 0.)], vec![]);
        assert_eq!(zeros.weld_within(0.0).index, [0, 0]);
        assert_eq!(mesh.welded().vertices, mesh.weld().positions);
        assert!(TriMesh::default().welded().vertices.is_empty());
    }
}
