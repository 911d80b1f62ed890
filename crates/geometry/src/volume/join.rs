//! The union of two closed surfaces.

use std::collections::HashMap;

use nalgebra::Point3;

use super::arrangement::{Arrangement, FaceCut, Piercing};
use super::chain::{Chain, SIDES};
use super::polygon::fill;
use crate::mesh::TriMesh;
use crate::topology::is_collapsed;

/// The surface that winds a + b − ab times about a point about which `a` and `b` wind a and b times.
///
/// Each surface is taken 1 − w times where the other winds w times about it: once outside, not at all inside.
/// Where rounding has let a surface cross itself, w may be any integer, and the result still closes.
pub(super) fn union(a: &Chain, b: &Chain) -> Chain {
    let offset = a.positions.len() as u32;
    let mut points = Points { positions: a.positions.clone(), ids: HashMap::new() };
    points.positions.extend_from_slice(&b.positions);
    let arrangement = Arrangement::new(a, b);
    let mut segments = [Vec::new(), Vec::new()];
    for segment in &arrangement.segments {
        let [from, to] = [&segment.from, &segment.to].map(|end| points.id(end));
        segments[0].push((segment.faces[0], [to, from]));
        segments[1].push((segment.faces[1], [from, to]));
    }
    let mut faces = Vec::with_capacity(a.faces.len() + b.faces.len());
    for (k, (chain, offset)) in [(a, 0), (b, offset)].into_iter().enumerate() {
        segments[k].sort_unstable();
        outside(chain, &arrangement.cuts[k], &segments[k], offset, &mut points, &mut faces);
    }
    tidied(points.positions, &faces)
}

/// Both surfaces as one.
pub(super) fn beside(a: &Chain, b: &Chain) -> Chain {
    let offset = a.positions.len() as u32;
    let positions = a.positions.iter().chain(&b.positions).copied().collect();
    let theirs = b.faces.iter().map(|f| f.map(|v| v + offset));
    Chain::new(positions, a.faces.iter().copied().chain(theirs).collect())
}

/// The vertices of both surfaces and the points at which they cross.
struct Points {
    positions: Vec<Point3<f64>>,
    ids: HashMap<(u8, [u32; 2], u32), u32>,
}

impl Points {
    fn id(&mut self, piercing: &Piercing) -> u32 {
        let Self { positions, ids } = self;
        *ids.entry(piercing.key).or_insert_with(|| {
            positions.push(piercing.point);
            positions.len() as u32 - 1
        })
    }
}

/// Adds the faces of `chain`, each 1 − w times where the other surface winds w times, cut where that changes.
///
/// `segments` are the cuts through faces, by face; vertices are numbered from `offset`.
fn outside(
    chain: &Chain,
    cut: &FaceCut,
    segments: &[(u32, [u32; 2])],
    offset: u32,
    points: &mut Points,
    faces: &mut Vec<[u32; 3]>,
) {
    let (mut crossings, mut segments) = (cut.crossings.as_slice(), segments);
    let mut edges = Vec::new();
    for (f, face) in chain.faces.iter().enumerate() {
        let here = crossings.iter().take_while(|c| c.side as usize / 3 == f).count();
        let (sides_cut, rest) = crossings.split_at(here);
        crossings = rest;
        let here = segments.iter().take_while(|s| s.0 as usize == f).count();
        let (ways, rest) = segments.split_at(here);
        segments = rest;
        let weights = face.map(|v| 1 - cut.windings[v as usize]);
        let corners = face.map(|v| v + offset);
        if sides_cut.is_empty() && ways.is_empty() {
            let [x, y, z] = corners;
            let turned = if weights[0] < 0 { [x, z, y] } else { corners };
            faces.extend((0..weights[0].abs()).map(|_| turned));
            continue;
        }
        edges.clear();
        let mut add = |from: u32, to: u32, weight: i32| {
            let edge = if weight < 0 { [to, from] } else { [from, to] };
            edges.extend((0..weight.abs()).map(|_| edge));
        };
        for (k, [from, to]) in SIDES.into_iter().enumerate() {
            let (mut weight, mut at) = (weights[from], corners[from]);
            for crossing in sides_cut.iter().filter(|c| c.side as usize == 3 * f + k) {
                let next = points.id(&crossing.at);
                add(at, next, weight);
                (weight, at) = (weight - crossing.change, next);
            }
            add(at, corners[to], weight);
        }
        ways.iter().for_each(|(_, [from, to])| add(*from, *to, 1));
        let [p, q, r] = chain.triangle(f);
        let normal = (q - p).cross(&(r - p));
        faces.extend(fill(&edges, |id| points.positions[id as usize], &normal));
    }
}

/// Joins equal positions and drops faces without extent and pairs that cancel.
///
/// Walls between touching bodies leave such pairs where both bodies have the same triangles.
fn tidied(positions: Vec<Point3<f64>>, faces: &[[u32; 3]]) -> Chain {
    let mesh = TriMesh::new(positions, faces.to_vec());
    let weld = mesh.weld_within(0.0);
    let mut named: Vec<([u32; 3], i32)> = (weld.faces(&mesh).into_iter())
        .filter(|f| !is_collapsed(f))
        .map(|[a, b, c]| {
            let mut sorted = [a, b, c];
            sorted.sort_unstable();
            let is_even = [[a, b, c], [b, c, a], [c, a, b]].contains(&sorted);
            (sorted, if is_even { 1 } else { -1 })
        })
        .collect();
    named.sort_unstable();
    let kept = named.chunk_by(|x, y| x.0 == y.0).flat_map(|group| {
        let [a, b, c] = group[0].0;
        let count: i32 = group.iter().map(|g| g.1).sum();
        let face = if count < 0 { [a, c, b] } else { [a, b, c] };
        (0..count.abs()).map(move |_| face)
    });
    compact(&weld.positions, &kept.collect::<Vec<_>>())
}

/// The surface of `faces` with the positions they use.
pub(super) fn compact(positions: &[Point3<f64>], faces: &[[u32; 3]]) -> Chain {
    let mesh = TriMesh::compacted(positions, faces.iter().copied());
    Chain::new(mesh.vertices, mesh.faces)
}
