//! Which way faces look: neighbors alike, and shells outward.

use nalgebra::{Point3, Vector3};

use crate::box_tree::{Bounds, BoxTree};
use crate::closest::ClosestPoints;
use crate::mesh::TriMesh;
use crate::report::MeshReport;
use crate::topology::{Edge, EdgeUse, components, edges, is_collapsed};
use crate::weld::is_finite;

/// A sum of signed volumes smaller than this fraction of the sum of their sizes is rounding, and its sign means
/// nothing.
const MEANINGFUL: f64 = 1e-9;
/// Vertices of a shell that are asked whether they lie in another.
const PROBES: usize = 16;

/// Six times the signed volume that a face spans with `origin`.
pub(crate) fn wedge(positions: &[Point3<f64>], face: &[u32; 3], origin: &Point3<f64>) -> f64 {
    let [a, b, c] = face.map(|v| positions[v as usize] - origin);
    a.dot(&b.cross(&c))
}

impl TriMesh {
    /// The mesh with faces turned as [`TriMesh::cleaned`] turns them: neighbors alike, and shells outward. Vertices, attributes and the number of
    /// faces stay.
    ///
    /// # Panics
    /// If a face refers to a vertex that the mesh has not.
    pub fn faced_outward(mut self) -> Self {
        let weld = self.weld();
        let all = weld.faces(&self);
        let usable = |f: &[u32; 3]| {
            !is_collapsed(f) && f.iter().all(|v| is_finite(&weld.positions[*v as usize]))
        };
        let kept: Vec<usize> = (0..all.len()).filter(|f| usable(&all[*f])).collect();
        let mut turned: Vec<[u32; 3]> = kept.iter().map(|f| all[*f]).collect();
        orient(&weld.positions, &mut turned, &mut MeshReport::default());
        for (f, turned) in kept.into_iter().zip(turned) {
            if turned != all[f] {
                self.faces[f].swap(1, 2);
            }
        }
        self
    }
}

/// Makes neighbors agree and shells face outward, and counts the nested ones.
///
/// A closed shell within no other that encloses a negative volume is turned over, together with all shells
/// within it: those keep facing the way they do relative to it, since a shell that faces inward inside another is a
/// cavity. Open shells are turned over together, by the volume they span with the center of the mesh: a hole
/// leaves enough of a surface to tell.
pub(crate) fn orient(positions: &[Point3<f64>], faces: &mut [[u32; 3]], report: &mut MeshReport) {
    align_neighbors(faces, report);
    let mut shells = Shells::new(positions, faces);
    let around = shells.around(positions, faces);
    let turn: Vec<bool> = (0..shells.list.len())
        .map(|s| shells.list[shells.outermost(s, &around)].facing < 0.0)
        .collect();
    report.inverted_shells = turn.iter().filter(|t| **t).count();
    for (face, &shell) in faces.iter_mut().zip(&shells.of) {
        if turn[shell as usize] {
            face.swap(1, 2);
        }
    }
    for (shell, _) in shells.list.iter_mut().zip(&turn).filter(|(_, t)| **t) {
        shell.facing = -shell.facing;
    }
    // Sound shells part what is enclosed once from what is not enclosed.
    let sound = |s: &usize| {
        let outside: f64 = around[*s].iter().map(|&o| shells.list[o].facing).sum();
        let inside = outside + shells.list[*s].facing;
        outside.min(inside) >= 0.0 && outside.max(inside) <= 1.0
    };
    report.nested_shells = (0..shells.list.len()).filter(|s| !sound(s)).count();
}

/// Turns faces so that neighbors agree, following the majority of each component.
fn align_neighbors(faces: &mut [[u32; 3]], report: &mut MeshReport) {
    let all = edges(faces);
    let pairs: Vec<&Edge> = all.iter().filter(|e| e.uses.len() == 2).collect();
    if pairs.iter().all(|e| e.is_manifold()) {
        return;
    }
    let mut turn = vec![false; faces.len()];
    let mut neighbors: Vec<Vec<(u32, bool)>> = vec![Vec::new(); faces.len()];
    for edge in &pairs {
        let [EdgeUse { face: f, forward, .. }, other] = [edge.uses[0], edge.uses[1]];
        neighbors[f as usize].push((other.face, forward == other.forward));
        neighbors[other.face as usize].push((f, forward == other.forward));
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
            for &(g, contrary) in &neighbors[f] {
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
    for (face, _) in faces.iter_mut().zip(&turn).filter(|(_, t)| **t) {
        face.swap(1, 2);
        report.flipped_faces += 1;
    }
}

/// The edge-connected components of a mesh.
struct Shells {
    /// For each face, its shell.
    of: Vec<u32>,
    list: Vec<Shell>,
}

struct Shell {
    closed: bool,
    /// 1 where it faces outward, -1 inward, 0 where it spans no volume.
    facing: f64,
    /// Size of the volume it spans \[m³\].
    volume: f64,
    bounds: Bounds,
}

impl Shells {
    fn new(positions: &[Point3<f64>], faces: &[[u32; 3]]) -> Self {
        let edges = edges(faces);
        let (of, count) = components(&edges, faces.len());
        let mut open = vec![false; count];
        for edge in edges.iter().filter(|e| e.uses.len() == 1) {
            open[of[edge.uses[0].face as usize] as usize] = true;
        }
        let n = positions.len().max(1) as f64;
        let center = positions.iter().fold(Vector3::zeros(), |s, p| s + p.coords / n).into();
        let mut bounds = vec![Bounds::EMPTY; count];
        let mut first = vec![None; count];
        // Volumes about a corner of the shell, those of open shells together and about the center of all.
        let (mut signed, mut unsigned) = (vec![0.0; count], vec![0.0; count]);
        let (mut open_signed, mut open_unsigned) = (0.0, 0.0);
        for (face, &shell) in faces.iter().zip(&of) {
            let s = shell as usize;
            let origin = *first[s].get_or_insert(positions[face[0] as usize]);
            let (own, central) = (wedge(positions, face, &origin), wedge(positions, face, &center));
            signed[s] += own;
            unsigned[s] += own.abs();
            if open[s] {
                open_signed += central;
                open_unsigned += central.abs();
            }
            let own = Bounds::of(face.iter().map(|v| &positions[*v as usize]));
            bounds[s] = bounds[s].joined(&own);
        }
        let facing = |signed: f64, unsigned: f64| {
            if signed.abs() > MEANINGFUL * unsigned { signed.signum() } else { 0.0 }
        };
        let shell = |s: usize| Shell {
            closed: !open[s],
            facing: if open[s] {
                facing(open_signed, open_unsigned)
            } else {
                facing(signed[s], unsigned[s])
            },
            volume: signed[s].abs() / 6.0,
            bounds: bounds[s],
        };
        Self { list: (0..count).map(shell).collect(), of }
    }

    /// For each closed shell, the closed shells around it.
    fn around(&self, positions: &[Point3<f64>], faces: &[[u32; 3]]) -> Vec<Vec<usize>> {
        let n = self.list.len();
        let mut around = vec![Vec::new(); n];
        if self.list.iter().filter(|s| s.closed).count() < 2 {
            return around;
        }
        let boxes: Vec<Bounds> = self.list.iter().map(|s| s.bounds).collect();
        let tree = BoxTree::new(&boxes);
        let mut members: Vec<Vec<[u32; 3]>> = vec![Vec::new(); n];
        for (face, &shell) in faces.iter().zip(&self.of) {
            members[shell as usize].push(*face);
        }
        let mut within: Vec<Vec<usize>> = vec![Vec::new(); n];
        for inner in (0..n).filter(|s| self.list[*s].closed) {
            let i = &boxes[inner];
            tree.each(
                |o| o.holds(i),
                |outer| {
                    if outer != inner && self.list[outer].closed && boxes[outer] != *i {
                        within[outer].push(inner);
                    }
                    true
                },
            );
        }
        for (outer, candidates) in within.iter().enumerate().filter(|(_, c)| !c.is_empty()) {
            let shell = TriMesh::compacted(positions, members[outer].iter().copied());
            let Ok(shell) = ClosestPoints::with_winding_sign(&shell) else { continue };
            for &inner in candidates {
                let list = &members[inner];
                // Shells that cross are not within each other: some vertices lie outside.
                let step = list.len().div_ceil(PROBES);
                let probes = list.iter().step_by(step).map(|f| positions[f[0] as usize]);
                let inside = |p: Point3<f64>| shell.signed_distance(&p).0 <= 0.0;
                if probes.into_iter().all(inside) {
                    around[inner].push(outer);
                }
            }
        }
        around
    }

    /// The largest of the shells around `shell`, or itself.
    fn outermost(&self, shell: usize, around: &[Vec<usize>]) -> usize {
        let larger = |a: &usize, b: &usize| self.list[*a].volume.total_cmp(&self.list[*b].volume);
        around[shell].iter().copied().max_by(larger).unwrap_or(shell)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::tests::{cuboid, icosphere};

    fn inside_out(mut mesh: TriMesh) -> TriMesh {
        mesh.faces.iter_mut().for_each(|f| f.swap(1, 2));
        mesh
    }

    fn together(parts: &[TriMesh]) -> TriMesh {
        let mut mesh = TriMesh::default();
        parts.iter().for_each(|p| mesh.append(p));
        mesh
    }

    /// Signed volume of what `cleaned` makes of the parts, and how many shells it turned and found nested.
    fn volume(parts: &[TriMesh]) -> (f64, usize, usize) {
        let (clean, report) = together(parts).cleaned();
        (crate::mass::signed_volume(&clean), report.inverted_shells, report.nested_shells)
    }

    #[test]
    fn each_outermost_shell_is_turned_and_cavities_stay() {
        let big = || cuboid([4.0; 3], [0.0; 3]);
        let (hole, core) = (|| cuboid([2.0; 3], [0.2; 3]), || cuboid([1.0; 3], [0.1; 3]));
        let apart = || cuboid([1.0; 3], [9.0, 0.0, 0.0]);
        let close = |got: (f64, usize, usize), expected: (f64, usize, usize)| {
            assert!((got.0 - expected.0).abs() < 1e-9, "{got:?} {expected:?}");
            assert_eq!((got.1, got.2), (expected.1, expected.2));
        };
        // Apart, each faces outward on its own.
        close(volume(&[big(), inside_out(apart())]), (65.0, 1, 0));
        close(volume(&[inside_out(big()), apart()]), (65.0, 1, 0));
        // A cavity is kept, with its outer shell either way round.
        close(volume(&[big(), inside_out(hole())]), (56.0, 0, 0));
        close(volume(&[inside_out(big()), hole()]), (56.0, 2, 0));
        // A core inside of the cavity is solid again.
        close(volume(&[big(), inside_out(hole()), core()]), (57.0, 0, 0));
        // A body inside a body counts twice, and the report says so.
        close(volume(&[big(), hole()]), (72.0, 0, 1));
        close(volume(&[inside_out(big()), inside_out(hole()), apart()]), (73.0, 2, 1));
        // A cavity inside a cavity encloses less than nothing.
        close(volume(&[big(), inside_out(hole()), inside_out(core())]), (55.0, 0, 1));
    }

    #[test]
    fn faces_are_turned_outward_where_they_are() {
        let apart = cuboid([1.0; 3], [9.0, 0.0, 0.0]);
        let right = together(&[cuboid([4.0; 3], [0.0; 3]), apart.clone()]);
        let mut mesh = together(&[inside_out(cuboid([4.0; 3], [0.0; 3])), apart]);
        // One face besides, and a degenerate one.
        mesh.faces[1].swap(1, 2);
        mesh.faces.push([0, 0, 1]);
        let turned = mesh.clone().faced_outward();
        assert_eq!(turned.vertices, mesh.vertices);
        let (faces, rest) = turned.faces.split_at(right.faces.len());
        let rolled = |f: &[u32; 3]| [*f, [f[1], f[2], f[0]], [f[2], f[0], f[1]]];
        assert!(faces.iter().zip(&right.faces).all(|(f, r)| rolled(f).contains(r)));
        assert_eq!(rest, [[0, 0, 1]]);
        assert_eq!(turned.clone().faced_outward().faces, turned.faces);
    }

    #[test]
    fn bodies_that_overlap_are_turned_one_by_one() {
        let second =
            icosphere(1.0, 2).transformed(&nalgebra::Isometry3::translation(1.0, 0.0, 0.0));
        let (clean, report) = together(&[icosphere(1.0, 2), inside_out(second)]).cleaned();
        assert_eq!((report.inverted_shells, report.nested_shells), (1, 0));
        assert!(report.self_intersections > 10);
        let one = crate::mass::signed_volume(&icosphere(1.0, 2));
        assert!((crate::mass::signed_volume(&clean) - 2.0 * one).abs() < 1e-9);
    }

    #[test]
    fn open_shells_follow_what_most_of_them_enclose() {
        // A box whose sides are all apart from each other, inside out.
        let mut cube = inside_out(cuboid([1.0; 3], [0.0; 3]));
        let side = |f: &[u32; 3], mesh: &TriMesh| {
            let [a, b, c] = f.map(|v| mesh.vertices[v as usize]);
            (b - a).cross(&(c - a)).iamax()
        };
        let lids: Vec<[u32; 3]> =
            cube.faces.iter().copied().filter(|f| side(f, &cube) == 2).collect();
        cube.faces = lids;
        let (clean, report) = cube.cleaned();
        assert_eq!((report.components, report.inverted_shells, report.watertight), (2, 2, false));
        let outward = |f: usize| clean.area_vector(f).z * clean.triangle(f)[0].z > 0.0;
        assert!((0..clean.faces.len()).all(outward));
    }
}
