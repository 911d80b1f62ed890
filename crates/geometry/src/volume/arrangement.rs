//! Where two closed surfaces cross: the points at which edges pierce faces, and the segments between them.

use std::cell::Cell;

use nalgebra::Point3;

use super::chain::{Chain, NearFaces, SIDES};
use super::winding::windings;
use crate::predicates::{Plane, Side, edges_turn};

/// Where an edge of one surface pierces a face of the other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piercing {
    /// Names the point: the edge's surface (0 or 1), its vertices in increasing order, and the face of the other one.
    pub(super) key: (u8, [u32; 2], u32),
    pub(super) point: Point3<f64>,
}

/// Where a side of a face enters or leaves the other body.
#[derive(Clone, Copy, Debug)]
pub(super) struct EdgeCrossing {
    /// The side of a face, three a face.
    pub(super) side: u32,
    /// Where along the edge, from 0 at the smaller vertex to 1 at the larger.
    along: f64,
    /// By how much the winding number of the other surface grows along the side.
    pub(super) change: i32,
    pub(super) at: Piercing,
}

/// Where a face of the first surface and one of the second cross.
///
/// On the first face, the inside of the second body lies to the left of the way `from` → `to`; on the
/// second face, the inside of the first body lies to its right.
#[derive(Clone, Copy, Debug)]
pub(super) struct FaceSegment {
    pub(super) faces: [u32; 2],
    pub(super) from: Piercing,
    pub(super) to: Piercing,
}

/// How the other surface lies to one of the two.
#[derive(Debug)]
pub(super) struct FaceCut {
    /// Faces that share a point with the bounds of the other surface, in increasing order.
    pub(super) faces: Vec<u32>,
    /// For each of `faces`, whether its box meets that of a face of the other surface.
    pub(super) met: Vec<bool>,
    /// Crossings of the sides of faces, by side, and in the order in which the side meets them.
    pub(super) crossings: Vec<EdgeCrossing>,
    /// How often the other surface winds about each vertex.
    pub(super) windings: Vec<i32>,
}

/// How two surfaces cross.
#[derive(Debug)]
pub(super) struct Arrangement {
    pub(super) cuts: [FaceCut; 2],
    pub(super) segments: Vec<FaceSegment>,
}

impl Arrangement {
    /// Crosses `a` with `b`, which is moved infinitesimally where they only touch (see `crate::predicates`).
    pub(super) fn new(a: &Chain, b: &Chain) -> Self {
        let regions = [a.region(&b.bounds), b.region(&a.bounds)];
        let mut met = regions.each_ref().map(|region| vec![false; region.faces.len()]);
        let mut crossings = [Vec::new(), Vec::new()];
        let mut segments = Vec::new();
        regions[0].tree.each_meeting(&regions[1].tree, |i, j| {
            (met[0][i], met[1][j]) = (true, true);
            let faces = [regions[0].faces[i], regions[1].faces[j]];
            segments.extend(meet([a, b], faces.map(|f| f as usize), &mut crossings));
        });
        let [met_a, met_b] = met;
        let [of_a, of_b] = crossings;
        let [near_a, near_b] = regions;
        let cuts = [cut(a, b, near_a, met_a, of_a, false), cut(b, a, near_b, met_b, of_b, true)];
        Self { cuts, segments }
    }
}

fn cut(
    own: &Chain,
    other: &Chain,
    region: NearFaces,
    met: Vec<bool>,
    mut crossings: Vec<EdgeCrossing>,
    other_is_a: bool,
) -> FaceCut {
    crossings.sort_unstable_by(|x, y| {
        // Both faces at an edge must agree on the order along it, also where points fall together.
        let order = x.along.total_cmp(&y.along).then(x.at.key.2.cmp(&y.at.key.2));
        let [from, to] = own.side(x.side);
        x.side.cmp(&y.side).then(if from < to { order } else { order.reverse() })
    });
    let windings = windings(own, &region, other, &crossings, other_is_a);
    FaceCut { faces: region.faces, met, crossings, windings }
}

/// Takes the crossings of the sides of `face` off the front of `crossings`.
pub(super) fn crossings_of<'a>(
    face: u32,
    crossings: &mut &'a [EdgeCrossing],
) -> &'a [EdgeCrossing] {
    let count = crossings.iter().take_while(|c| c.side / 3 == face).count();
    crossings.split_off(..count).unwrap_or_default()
}

/// Crosses face `i` of the first surface with face `j` of the second.
fn meet(
    chains: [&Chain; 2],
    [i, j]: [usize; 2],
    crossings: &mut [Vec<EdgeCrossing>; 2],
) -> Option<FaceSegment> {
    let (ta, tb) = (chains[0].triangle(i), chains[1].triangle(j));
    let plane = Plane::new(tb, false);
    let sides_a = ta.map(|p| plane.side(p));
    if are_apart(&sides_a) {
        return None;
    }
    let plane = Plane::new(ta, true);
    let sides_b = tb.map(|p| plane.side(p));
    if are_apart(&sides_b) {
        return None;
    }
    // How the side k of the first face passes the side l of the second, asked for once.
    let known = Cell::new([[None; 3]; 3]);
    let turn = |k: usize, l: usize| {
        let mut table = known.get();
        let value = *table[k][l]
            .get_or_insert_with(|| edges_turn(SIDES[k].map(|c| ta[c]), SIDES[l].map(|c| tb[c])));
        known.set(table);
        value
    };
    let mut ends = [None; 2];
    for own in 0..2 {
        let (sides, faces) = if own == 0 { (&sides_a, [i, j]) } else { (&sides_b, [j, i]) };
        for (k, ends_of_side) in SIDES.into_iter().enumerate() {
            let [s, e] = ends_of_side.map(|c| sides[c]);
            let at = |l: usize| if own == 0 { turn(k, l) } else { turn(l, k) };
            if s.sign * e.sign != -1 || at(0) != at(1) || at(1) != at(2) {
                continue;
            }
            let crossing = pierce(chains[own], own as u8, 3 * faces[0] + k, faces[1], s, e);
            // On the first face a way starts where a side of it leaves the second body, or where one of the second
            // face enters the first body.
            let is_end = (crossing.change > 0) == (own == 0);
            ends[usize::from(is_end)] = Some(crossing.at);
            crossings[own].push(crossing);
        }
    }
    let [Some(from), Some(to)] = ends else { return None };
    Some(FaceSegment { faces: [i as u32, j as u32], from, to })
}

/// All on one side; a triangle without area has none, yet its sides may pierce others.
fn are_apart(sides: &[Side; 3]) -> bool {
    sides.iter().all(|s| s.sign > 0) || sides.iter().all(|s| s.sign < 0)
}

/// The crossing of `side` with `face` of the other surface, given on which sides of it its ends lie.
fn pierce(
    own: &Chain,
    owner: u8,
    side: usize,
    face: usize,
    start: Side,
    end: Side,
) -> EdgeCrossing {
    let [from, to] = own.side(side as u32);
    let change = i32::from(start.sign);
    // From the smaller vertex, so that both faces at the edge find the same point.
    let (vertices, low, high) =
        if from < to { ([from, to], start, end) } else { ([to, from], end, start) };
    let span = low.value - high.value;
    // An edge that runs within the plane of the face pierces it anywhere.
    let along = if span == 0.0 { 0.5 } else { (low.value / span).clamp(0.0, 1.0) };
    let [p, q] = vertices.map(|v| own.positions[v as usize]);
    let point = if along < 0.5 { p + (q - p) * along } else { q + (p - q) * (1.0 - along) };
    let at = Piercing { key: (owner, vertices, face as u32), point };
    EdgeCrossing { side: side as u32, along, change, at }
}
