//! Repairing what scans and exporters leave behind.

use nalgebra::{Point3, Vector3};

use crate::TriMesh;
use crate::topology::{Edge, EdgeUse, components, edges, is_collapsed};

/// Components with fewer faces than this fraction of the largest are stray if open or hollow.
const STRAY_FRACTION: f64 = 0.01;
/// A closed component that small \[of the largest volume\] encloses nothing.
const HOLLOW_FRACTION: f64 = 1e-6;

/// What [`TriMesh::cleaned`] changed, and the topology of its result.
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
    /// Faces turned over to agree with their neighbours.
    pub flipped_faces: usize,
    /// The mesh as a whole faced inward and was turned over.
    pub inverted: bool,
    /// Edge-connected components of the result.
    pub components: usize,
    /// Edges of the result with a single face.
    pub open_edges: usize,
    /// Edges of the result with more than two faces, or two of contrary orientation.
    pub non_manifold_edges: usize,
    /// Every edge of the result has exactly two faces, of one orientation.
    pub watertight: bool,
}

impl TriMesh {
    /// The welded mesh (see [`TriMesh::welded`]) without degenerate, duplicate, fin and stray faces, consistently
    /// oriented and facing outward; attributes are dropped.
    ///
    /// A component is stray if it has less than 1 % of the faces of the largest and is open or encloses no volume:
    /// scans carry a few such faces. Faces of no area whose corners differ are kept, since their neighbours need
    /// them. Holes are not filled: the report says whether the result is watertight.
    pub fn cleaned(&self) -> (TriMesh, MeshReport) {
        let weld = self.weld();
        let mut report = MeshReport {
            welded_vertices: self.vertices.len() - weld.positions.len(),
            ..Default::default()
        };
        let mut faces = weld.faces(self);
        let given = faces.len();
        faces.retain(|f| !is_collapsed(f));
        report.degenerate_faces = given - faces.len();
        let distinct = faces.len();
        let mut seen = std::collections::HashSet::with_capacity(distinct);
        faces.retain(|f| {
            let mut key = *f;
            key.sort_unstable();
            seen.insert(key)
        });
        report.duplicate_faces = distinct - faces.len();
        drop_fins(&mut faces, &mut report);
        drop_stray(&weld.positions, &mut faces, &mut report);
        orient(&weld.positions, &mut faces, &mut report);

        let edges = edges(&faces);
        report.components = components(&edges, faces.len()).1;
        report.open_edges = edges.iter().filter(|e| e.uses.len() == 1).count();
        report.non_manifold_edges =
            edges.iter().filter(|e| e.uses.len() > 1 && !e.is_manifold()).count();
        report.watertight =
            !faces.is_empty() && report.open_edges == 0 && report.non_manifold_edges == 0;
        (compacted(&weld.positions, &faces), report)
    }
}

/// Six times the signed volume that each face spans with `origin`.
fn wedge(positions: &[Point3<f64>], face: &[u32; 3], origin: &Point3<f64>) -> f64 {
    let [a, b, c] = face.map(|v| positions[v as usize] - origin);
    a.dot(&b.cross(&c))
}

/// A fin has an open edge and one that more than two faces share; removing it may leave another behind it.
fn drop_fins(faces: &mut Vec<[u32; 3]>, report: &mut MeshReport) {
    loop {
        let (mut open, mut crowded) = (vec![false; faces.len()], vec![false; faces.len()]);
        for edge in edges(faces) {
            match edge.uses.as_slice() {
                [only] => open[only.face as usize] = true,
                [_, _] => {}
                uses => uses.iter().for_each(|u| crowded[u.face as usize] = true),
            }
        }
        let before = faces.len();
        let mut fin = open.iter().zip(&crowded).map(|(o, c)| *o && *c);
        faces.retain(|_| !fin.next().unwrap_or(false));
        if faces.len() == before {
            return;
        }
        report.fin_faces += before - faces.len();
    }
}

fn drop_stray(positions: &[Point3<f64>], faces: &mut Vec<[u32; 3]>, report: &mut MeshReport) {
    let edges = edges(faces);
    let (of, count) = components(&edges, faces.len());
    if count < 2 {
        return;
    }
    let mut size = vec![0_usize; count];
    let mut volume = vec![0.0; count];
    let mut first: Vec<Option<Point3<f64>>> = vec![None; count];
    for (face, &c) in faces.iter().zip(&of) {
        let c = c as usize;
        size[c] += 1;
        let origin = *first[c].get_or_insert(positions[face[0] as usize]);
        volume[c] += wedge(positions, face, &origin);
    }
    let mut open = vec![false; count];
    edges
        .iter()
        .filter(|e| e.uses.len() == 1)
        .for_each(|e| open[of[e.uses[0].face as usize] as usize] = true);
    let largest = size.iter().copied().max().unwrap_or(0) as f64;
    let fullest = volume.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let stray: Vec<bool> = (0..count)
        .map(|c| {
            (size[c] as f64) < STRAY_FRACTION * largest
                && (open[c] || volume[c].abs() <= HOLLOW_FRACTION * fullest)
        })
        .collect();
    report.stray_components = stray.iter().filter(|s| **s).count();
    let before = faces.len();
    let mut at = of.iter();
    faces.retain(|_| at.next().is_none_or(|&c| !stray[c as usize]));
    report.stray_faces = before - faces.len();
}

/// Makes neighbours agree, following the majority of each component, and the whole face outward.
fn orient(positions: &[Point3<f64>], faces: &mut [[u32; 3]], report: &mut MeshReport) {
    let all = edges(faces);
    let pairs: Vec<&Edge> = all.iter().filter(|e| e.uses.len() == 2).collect();
    let mut turn = vec![false; faces.len()];
    if pairs.iter().any(|e| !e.is_manifold()) {
        let mut neighbours: Vec<Vec<(u32, bool)>> = vec![Vec::new(); faces.len()];
        for edge in &pairs {
            let [EdgeUse { face: f, forward, .. }, other] = [edge.uses[0], edge.uses[1]];
            neighbours[f as usize].push((other.face, forward == other.forward));
            neighbours[other.face as usize].push((f, forward == other.forward));
        }
        let mut reached = vec![false; faces.len()];
        for start in 0..faces.len() {
            if std::mem::replace(&mut reached[start], true) {
                continue;
            }
            let mut component = vec![start];
            let mut next = 0;
            while next < component.len() {
                let f = component[next];
                next += 1;
                for &(g, contrary) in &neighbours[f] {
                    let g = g as usize;
                    if !std::mem::replace(&mut reached[g], true) {
                        turn[g] = turn[f] ^ contrary;
                        component.push(g);
                    }
                }
            }
            if 2 * component.iter().filter(|f| turn[**f]).count() > component.len() {
                component.iter().for_each(|f| turn[*f] = !turn[*f]);
            }
        }
    }
    for (face, _) in faces.iter_mut().zip(&turn).filter(|(_, t)| **t) {
        face.swap(1, 2);
        report.flipped_faces += 1;
    }
    // An open surface has no inside; one with a small hole still has, so the sign decides there too.
    let n = positions.len().max(1) as f64;
    let centre = Point3::from(positions.iter().fold(Vector3::zeros(), |s, p| s + p.coords) / n);
    let wedges: Vec<f64> = faces.iter().map(|f| wedge(positions, f, &centre)).collect();
    let (signed, unsigned) = wedges.iter().fold((0.0, 0.0), |(s, u), w| (s + w, u + w.abs()));
    // A flat sheet gives a sum of rounding errors, whose sign means nothing.
    if signed < -1e-9 * unsigned {
        faces.iter_mut().for_each(|f| f.swap(1, 2));
        report.inverted = true;
    }
}

/// The mesh without vertices that no face uses.
fn compacted(positions: &[Point3<f64>], faces: &[[u32; 3]]) -> TriMesh {
    let mut new = vec![u32::MAX; positions.len()];
    let mut kept = Vec::new();
    let faces = faces.iter().map(|f| {
        f.map(|v| {
            let slot = &mut new[v as usize];
            if *slot == u32::MAX {
                *slot = kept.len() as u32;
                kept.push(positions[v as usize]);
            }
            *slot
        })
    });
    let faces = faces.collect();
    TriMesh::new(kept, faces)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology;
    use crate::volume::tests::{cuboid, icosphere};

    #[test]
    fn a_sound_mesh_stays_as_it_is() {
        let sphere = icosphere(1.0, 2);
        let (clean, report) = sphere.cleaned();
        assert_eq!(report, MeshReport { components: 1, watertight: true, ..Default::default() });
        assert_eq!(clean.faces.len(), sphere.faces.len());
    }

    #[test]
    fn everything_at_once_is_repaired() {
        let sphere = icosphere(1.0, 3);
        let mut mesh = TriMesh::default();
        // Every face with vertices of its own, every ninth turned over, and the whole inside out.
        for (k, f) in sphere.faces.iter().enumerate() {
            let base = mesh.vertices.len() as u32;
            mesh.vertices.extend(f.map(|v| sphere.vertices[v as usize]));
            mesh.faces.push(if k % 9 == 0 {
                [base, base + 1, base + 2]
            } else {
                [base, base + 2, base + 1]
            });
        }
        let n = mesh.faces.len();
        mesh.faces.push([0, 0, 1]);
        mesh.faces.push([1, 0, 2]);
        let far = mesh.vertices.len() as u32;
        mesh.vertices.extend([[2.0, 0.0, 0.0], [2.1, 0.0, 0.0], [2.0, 0.1, 0.0]].map(Point3::from));
        mesh.faces.push([far, far + 1, far + 2]);
        let (clean, report) = mesh.cleaned();
        let expected = MeshReport {
            welded_vertices: 3 * n - sphere.vertices.len(),
            degenerate_faces: 1,
            duplicate_faces: 1,
            stray_components: 1,
            stray_faces: 1,
            flipped_faces: n.div_ceil(9),
            inverted: true,
            components: 1,
            watertight: true,
            ..Default::default()
        };
        assert_eq!(report, expected);
        assert_eq!((clean.faces.len(), clean.vertices.len()), (n, sphere.vertices.len()));
        assert!((0..n).all(|f| clean.area_vector(f).dot(&clean.triangle(f)[0].coords) > 0.0));
        assert!(topology::edges(&clean.faces).iter().all(Edge::is_manifold));
    }

    #[test]
    fn fins_go_holes_are_reported_and_second_bodies_stay() {
        let mut two = cuboid([1.0; 3], [0.0; 3]);
        two.append(
            &icosphere(0.1, 1).transformed(&nalgebra::Isometry3::translation(5.0, 0.0, 0.0)),
        );
        let (_, report) = two.cleaned();
        assert_eq!((report.components, report.watertight, report.stray_faces), (2, true, 0));
        let mut open = two.clone();
        open.faces.remove(0);
        let (_, report) = open.cleaned();
        assert_eq!((report.open_edges, report.watertight, report.inverted), (3, false, false));
        let mut fin = two.clone();
        fin.vertices.push(Point3::new(3.0, 3.0, 3.0));
        let tip = fin.vertices.len() as u32 - 1;
        fin.faces.push([fin.faces[0][0], fin.faces[0][1], tip]);
        let (clean, report) = fin.cleaned();
        assert_eq!(
            (report.fin_faces, report.watertight, clean.vertices.len()),
            (1, true, two.vertices.len())
        );
        // Two boxes that share an edge contradict the surface's topology, but no face of theirs is to blame.
        let mut hinge = cuboid([1.0; 3], [0.0; 3]);
        hinge.append(&cuboid([1.0; 3], [1.0, 1.0, 0.0]));
        let (_, report) = hinge.cleaned();
        assert_eq!(
            (report.open_edges, report.non_manifold_edges, report.watertight),
            (0, 1, false)
        );
        let (nothing, report) = TriMesh::default().cleaned();
        assert!(nothing.faces.is_empty() && !report.watertight);
    }
}
