//! Checks shared by the tests of every closed shape.

use std::collections::HashMap;

use crate::TriMesh;

/// Signed volume \[m³\] of a mesh that must be, after welding, one closed body of genus 0 facing outward.
pub(crate) fn closed_volume(mesh: &TriMesh) -> f64 {
    let mut ids = HashMap::new();
    let weld: Vec<usize> = mesh
        .vertices
        .iter()
        .map(|p| {
            let next = ids.len();
            // Adding zero turns −0 into 0.
            *ids.entry((p.coords.add_scalar(0.0)).map(f64::to_bits)).or_insert(next)
        })
        .collect();
    let mut edges = HashMap::new();
    for face in &mesh.faces {
        let f = face.map(|v| weld[v as usize]);
        for k in 0..3 {
            assert_ne!(f[k], f[(k + 1) % 3], "degenerate face {face:?}");
            *edges.entry((f[k], f[(k + 1) % 3])).or_insert(0) += 1;
        }
    }
    for (&(a, b), &count) in &edges {
        assert_eq!(
            (count, edges.get(&(b, a))),
            (1, Some(&1)),
            "edge {a}-{b} is not shared by two faces"
        );
    }
    let used: std::collections::HashSet<_> = edges.keys().map(|e| e.0).collect();
    assert_eq!(used.len() + mesh.faces.len(), edges.len() / 2 + 2, "Euler characteristic");
    if let Some(uvs) = &mesh.uvs {
        assert_eq!(uvs.len(), mesh.vertices.len());
        assert!(uvs.iter().flatten().all(|c| (0.0..=1.0).contains(c)));
    }
    let volume = (0..mesh.faces.len())
        .map(|f| {
            let [a, b, c] = mesh.triangle(f).map(|p| p.coords);
            a.dot(&b.cross(&c)) / 6.0
        })
        .sum();
    assert!(volume > 0.0, "inside out");
    volume
}
