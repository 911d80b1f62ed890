//! The union of two closed surfaces.

use std::collections::HashMap;

use nalgebra::Point3;

use super::arrangement::{Arrangement, FaceCut, Piercing, crossings_of};
use super::chain::{Chain, SIDES};
use super::polygon::fill;
use crate::topology::is_collapsed;
use crate::weld::position_bits;

/// The surface that winds a + b − ab times about a point about which `a` and `b` wind a and b times.
///
/// Each surface is taken 1 − w times where the other winds w times about it: once outside, not at all inside.
/// Where rounding has let a surface cross itself, w may be any integer, and the result still closes.
/// Faces whose boxes meet none of the other surface are taken over as they are.
pub(super) fn union(a: &Chain, b: &Chain) -> Chain {
    let offsets = [0, a.positions.len() as u32];
    let positions = a.positions.iter().chain(&b.positions).copied().collect();
    let mut points = Points { positions, ids: HashMap::new() };
    let mut faces = UnionFaces { apart: Vec::new(), met: Vec::new() };
    let arrangement = Arrangement::new(a, b);
    let mut segments = [Vec::new(), Vec::new()];
    for segment in &arrangement.segments {
        let [from, to] = [&segment.from, &segment.to].map(|end| points.id(end));
        segments[0].push((segment.faces[0], [to, from]));
        segments[1].push((segment.faces[1], [from, to]));
    }
    for (k, chain) in [a, b].into_iter().enumerate() {
        segments[k].sort_unstable();
        outside(chain, &arrangement.cuts[k], &segments[k], offsets[k], &mut points, &mut faces);
    }
    let firsts = [offsets[1], (a.positions.len() + b.positions.len()) as u32];
    let UnionFaces { mut apart, met } = faces;
    apart.extend(tidied(&points.positions, firsts, met));
    Chain::new(&points.positions, apart)
}

/// Faces of a union.
struct UnionFaces {
    /// Faces whose boxes meet none of the other surface.
    apart: Vec<[u32; 3]>,
    /// All others, and their parts.
    met: Vec<[u32; 3]>,
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
    faces: &mut UnionFaces,
) {
    let (mut crossings, mut segments) = (cut.crossings.as_slice(), segments);
    let mut near = cut.faces.iter().zip(&cut.met).peekable();
    let mut edges = Vec::new();
    for (f, face) in chain.faces.iter().enumerate() {
        let corners = face.map(|v| v + offset);
        let Some((_, met)) = near.next_if(|(near, _)| **near as usize == f) else {
            faces.apart.push(corners);
            continue;
        };
        let sides_cut = crossings_of(f as u32, &mut crossings);
        let here = segments.iter().take_while(|s| s.0 as usize == f).count();
        let ways = segments.split_off(..here).unwrap_or_default();
        let weights = face.map(|v| 1 - cut.windings[v as usize]);
        if sides_cut.is_empty() && ways.is_empty() {
            let [x, y, z] = corners;
            let turned = if weights[0] < 0 { [x, z, y] } else { corners };
            let list = if *met { &mut faces.met } else { &mut faces.apart };
            list.extend((0..weights[0].abs()).map(|_| turned));
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
        faces.met.extend(fill(&edges, |id| points.positions[id as usize], &normal));
    }
}

/// Joins equal positions of different owners and drops faces without extent and pairs that cancel.
///
/// Owners of vertices are the first surface, from the first of `firsts` on the second one, and from the other one on their crossing.
/// A vertex keeps its name where the position is of the same surface: faces that are not here may use it.
/// Walls between touching bodies leave pairs that cancel where both bodies have the same triangles.
fn tidied(positions: &[Point3<f64>], firsts: [u32; 2], faces: Vec<[u32; 3]>) -> Vec<[u32; 3]> {
    let mut used: Vec<u32> = faces.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let mut names: Vec<u32> = (0..positions.len() as u32).collect();
    let mut known = HashMap::with_capacity(used.len());
    for v in used {
        let first = *known.entry(position_bits(&positions[v as usize])).or_insert(v);
        if firsts[1] <= v || (first < firsts[0] && firsts[0] <= v) {
            names[v as usize] = first;
        }
    }
    let mut named: Vec<([u32; 3], i32)> = (faces.iter().map(|f| f.map(|v| names[v as usize])))
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
    kept.collect()
}
