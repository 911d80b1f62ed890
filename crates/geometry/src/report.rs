//! Report of a mesh's repairs and remaining defects.

use std::fmt;

/// Repairs made by [`TriMesh::cleaned`](crate::TriMesh::cleaned), and the defects that its result still has.
///
/// Printed, it is one line that names what is not zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MeshReport {
    /// Vertices joined with another at the same position.
    pub welded_vertices: usize,
    /// Faces removed because two of their corners fall together.
    pub degenerate_faces: usize,
    /// Faces removed because an earlier one has the same corners.
    pub duplicate_faces: usize,
    /// Faces removed because they stand off an edge that other faces already share, ending in the open.
    pub fin_faces: usize,
    /// Components removed as stray.
    pub stray_components: usize,
    /// Faces of those.
    pub stray_faces: usize,
    /// Faces turned over to agree with their neighbors.
    pub flipped_faces: usize,
    /// Components turned over as a whole because they faced inward.
    pub inverted_shells: usize,
    /// Edge-connected components of the result.
    pub components: usize,
    /// Edges of the result with a single face: the borders of holes, none of which was filled.
    pub open_edges: usize,
    /// Edges of the result with more than two faces, or two of contrary orientation.
    pub non_manifold_edges: usize,
    /// Vertices of the result in which surfaces touch without sharing an edge
    /// ([`topology::non_manifold_vertices`](crate::topology::non_manifold_vertices)).
    pub non_manifold_vertices: usize,
    /// Faces of the result with three corners in a line: kept, since their neighbors need them.
    pub flat_faces: usize,
    /// Faces of the result that other faces pass through
    /// ([`TriMesh::self_intersections`](crate::TriMesh::self_intersections)): where bodies overlap, or one overlaps itself.
    pub self_intersections: usize,
    /// Closed components of the result that lie within others so that space is enclosed twice, or a negative number of
    /// times: a body inside a body, where a cavity would be sound.
    pub nested_shells: usize,
    /// Every edge of the result has exactly two faces, of one orientation.
    pub watertight: bool,
}

impl fmt::Display for MeshReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list = |items: &[(usize, &str)]| {
            let named = items.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}"));
            named.collect::<Vec<_>>().join(", ")
        };
        let done = list(&[
            (self.welded_vertices, "vertices welded"),
            (self.degenerate_faces, "degenerate faces dropped"),
            (self.duplicate_faces, "duplicate faces dropped"),
            (self.fin_faces, "fins dropped"),
            (self.stray_components, "stray components dropped"),
            (self.flipped_faces, "faces turned"),
            (self.inverted_shells, "inverted shells turned"),
        ]);
        let left = list(&[
            (self.open_edges, "open edges"),
            (self.non_manifold_edges, "non-manifold edges"),
            (self.non_manifold_vertices, "non-manifold vertices"),
            (self.flat_faces, "flat faces"),
            (self.self_intersections, "crossing faces"),
            (self.nested_shells, "nested shells"),
        ]);
        let or = |text: String, none: &str| if text.is_empty() { none.to_owned() } else { text };
        write!(
            f,
            "{}; {}, {} component{}: {}",
            or(done, "nothing to repair"),
            if self.watertight { "watertight" } else { "not watertight" },
            self.components,
            if self.components == 1 { "" } else { "s" },
            or(left, "nothing wrong"),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_prints_what_is_not_zero() {
        let sound = MeshReport { components: 1, watertight: true, ..MeshReport::default() };
        assert_eq!(sound.to_string(), "nothing to repair; watertight, 1 component: nothing wrong");
        let poor = MeshReport { welded_vertices: 3, open_edges: 4, components: 2, ..sound };
        let poor = MeshReport { watertight: false, self_intersections: 2, ..poor };
        assert_eq!(
            poor.to_string(),
            "3 vertices welded; not watertight, 2 components: 4 open edges, 2 crossing faces"
        );
    }
}
