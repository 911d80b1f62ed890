//! Checks shared by the tests of every closed shape.

use std::collections::BTreeSet;

use crate::mass::signed_volume;
use crate::mesh::TriMesh;
use crate::topology::{Edge, edges, is_collapsed};

/// Signed volume \[m³\] of a mesh that must be, after welding, one closed body without holes facing outward.
pub(crate) fn closed_volume(mesh: &TriMesh) -> f64 {
    closed_volume_of_genus(mesh, 0)
}

/// Signed volume \[m³\] as of [`closed_volume`], of a body with `genus` holes through it.
pub(crate) fn closed_volume_of_genus(mesh: &TriMesh, genus: usize) -> f64 {
    let faces = mesh.weld_within(0.0).faces(mesh);
    assert!(!faces.iter().any(is_collapsed), "degenerate face");
    let edges = edges(&faces);
    assert!(edges.iter().all(Edge::is_manifold), "an edge is not shared by two faces");
    let used: BTreeSet<_> = faces.iter().flatten().collect();
    let euler = used.len() + faces.len() + 2 * genus;
    assert_eq!(euler, edges.len() + 2, "Euler characteristic");
    if let Some(uvs) = &mesh.uvs {
        assert_eq!(uvs.len(), mesh.vertices.len());
        assert!(uvs.iter().flatten().all(|c| (0.0..=1.0).contains(c)));
    }
    let volume = signed_volume(mesh);
    assert!(volume > 0.0, "inside out");
    volume
}
