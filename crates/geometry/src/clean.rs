//! Repairing what scans and exporters leave behind.

use std::collections::HashSet;

use nalgebra::Point3;

use crate::mesh::TriMesh;
use crate::orient::{orient, wedge};
use crate::report::MeshReport;
use crate::topology::{components, edges, is_collapsed, non_manifold_vertices};
use crate::weld::is_finite;

/// Components with fewer faces than this fraction of the largest are stray if open or hollow.
const STRAY_FRACTION: f64 = 0.01;
/// A closed component that small \[of the largest volume\] encloses nothing.
const HOLLOW_FRACTION: f64 = 1e-6;
/// A face is flat if its height is below this fraction of its longest side.
const FLAT: f64 = 1e-12;

impl TriMesh {
    /// The welded mesh (see [`TriMesh::welded`]) without degenerate, duplicate, fin and stray faces, consistently
    /// oriented and facing outward; attributes are dropped. A face with a corner that is not finite is degenerate.
    ///
    /// A component is stray if it has less than 1 % of the faces of the largest and is open or encloses no volume:
    /// scans carry a few such faces. Faces of no area whose corners differ are kept, since their neighbors need
    /// them. A closed shell that faces inward within no other is turned over with all it contains; a cavity stays a
    /// cavity. Holes are not filled and overlaps not resolved: the report says whether the result is watertight, and
    /// whether it [overlaps itself](MeshReport::self_intersections).
    ///
    /// ```
    /// # use prehend_geometry::shapes;
    /// let mut mesh = shapes::cuboid([0.1, 0.2, 0.3].into());
    /// mesh.faces.pop();
    /// let (_, report) = mesh.cleaned();
    /// assert!(!report.watertight && report.open_edges == 3);
    /// println!("{report}");
    /// ```
    ///
    /// # Panics
    /// If a face refers to a vertex that the mesh has not.
    pub fn cleaned(&self) -> (TriMesh, MeshReport) {
        let weld = self.weld();
        let mut report = MeshReport {
            welded_vertices: self.vertices.len() - weld.positions.len(),
            ..Default::default()
        };
        let mut faces = weld.faces(self);
        let given = faces.len();
        faces.retain(|f| {
            !is_collapsed(f) && f.iter().all(|v| is_finite(&weld.positions[*v as usize]))
        });
        report.degenerate_faces = given - faces.len();
        let distinct = faces.len();
        let mut seen = HashSet::with_capacity(distinct);
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
        report.non_manifold_vertices = non_manifold_vertices(&faces, &edges).len();
        report.watertight =
            !faces.is_empty() && report.open_edges == 0 && report.non_manifold_edges == 0;
        let clean = TriMesh::compacted(&weld.positions, faces);
        report.flat_faces = (0..clean.faces.len()).filter(|f| is_flat(&clean, *f)).count();
        report.self_intersections = clean.self_intersections().len();
        (clean, report)
    }
}

fn is_flat(mesh: &TriMesh, face: usize) -> bool {
    let [a, b, c] = mesh.triangle(face);
    let longest = (b - a).norm_squared().max((c - a).norm_squared()).max((c - b).norm_squared());
    // Written so that what overflows is not called flat.
    mesh.area_vector(face).norm() <= FLAT * longest
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology::{self, Edge};
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
            inverted_shells: 1,
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
    fn what_is_not_finite_takes_nothing_else_along() {
        for bad in [f64::NAN, f64::INFINITY] {
            let mut mesh = icosphere(1.0, 2);
            let at = mesh.vertices.len() as u32;
            mesh.vertices.extend([Point3::new(bad, 0.0, 0.0), Point3::new(0.0, bad, 1.0)]);
            mesh.faces.extend([[0, 1, at], [at + 1, at, 2]]);
            let (clean, report) = mesh.cleaned();
            assert_eq!((report.degenerate_faces, report.welded_vertices), (2, 0));
            assert!(report.watertight && clean.faces.len() == mesh.faces.len() - 2);
        }
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
        assert_eq!((report.open_edges, report.watertight, report.inverted_shells), (3, false, 0));
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
