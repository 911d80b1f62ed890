//! Triangles that fill polygons given by their directed edges.

use nalgebra::{Point2, Point3, Vector3};

/// Triangles whose boundary, opposite edges taken away, is that of the directed `edges` \[ids of points\].
///
/// The region lies to the left of its edges seen against `normal`; as many edges enter every point as leave it. Pieces apart,
/// holes, and points met twice are fine. The boundary is kept whatever rounding has done to the points; where it
/// has turned a piece over, a triangle of no extent may face the other way.
pub(super) fn fill(
    edges: &[[u32; 2]],
    point: impl Fn(u32) -> Point3<f64>,
    normal: &Vector3<f64>,
) -> Vec<[u32; 3]> {
    let axis = normal.iamax();
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    let flip = if normal[axis] < 0.0 { -1.0 } else { 1.0 };
    let flat = |id: u32| {
        let p = point(id);
        Corner { id, at: Point2::new(p[i], flip * p[j]) }
    };
    let (mut outer, mut holes) = (Vec::new(), Vec::new());
    for ring in rings(edges) {
        let ring: Vec<Corner> = ring.into_iter().map(flat).collect();
        let area = area(&ring);
        if area < 0.0 { holes.push((area, ring)) } else { outer.push((area, ring)) }
    }
    // The smallest ring around a hole is the one it is in.
    outer.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut inside = vec![Vec::new(); outer.len()];
    let mut triangles = Vec::new();
    for (area, hole) in holes {
        match outer.iter().position(|(size, ring)| *size >= -area && contains(ring, &hole)) {
            Some(k) => inside[k].push(hole),
            // Rounding turned a ring over.
            None => clip(hole, &mut triangles),
        }
    }
    for ((_, ring), holes) in outer.into_iter().zip(inside) {
        clip(joined(ring, holes), &mut triangles);
    }
    triangles
}

#[derive(Clone, Copy)]
struct Corner {
    id: u32,
    at: Point2<f64>,
}

/// Twice the area of the triangle, positive where it turns left.
fn turn(a: &Corner, b: &Corner, c: &Corner) -> f64 {
    (b.at - a.at).perp(&(c.at - a.at))
}

fn area(ring: &[Corner]) -> f64 {
    let next = ring.iter().cycle().skip(1);
    ring.iter().zip(next).map(|(p, q)| turn(&ring[0], p, q)).sum()
}

/// Follows edges until each ring closes.
fn rings(edges: &[[u32; 2]]) -> Vec<Vec<u32>> {
    let mut sorted = edges.to_vec();
    sorted.sort_unstable();
    let mut used = vec![false; sorted.len()];
    let mut rings = Vec::new();
    for first in 0..sorted.len() {
        if used[first] {
            continue;
        }
        let (mut ring, mut e) = (Vec::new(), first);
        loop {
            used[e] = true;
            let [from, to] = sorted[e];
            ring.push(from);
            let start = sorted.partition_point(|edge| edge[0] < to);
            let leaving = (start..sorted.len()).take_while(|k| sorted[*k][0] == to);
            match leaving.into_iter().find(|k| !used[*k]) {
                Some(next) if to != sorted[first][0] => e = next,
                _ => break,
            }
        }
        rings.push(ring);
    }
    rings
}

/// Whether most corners of `hole` lie inside `ring`: one may lie on it.
fn contains(ring: &[Corner], hole: &[Corner]) -> bool {
    let is_inside = |p: &Corner| {
        let next = ring.iter().cycle().skip(1);
        let crossed = ring.iter().zip(next).filter(|(a, b)| {
            let upward = a.at.y <= p.at.y;
            upward != (b.at.y <= p.at.y) && (turn(a, b, p) > 0.0) == upward
        });
        crossed.count() % 2 == 1
    };
    2 * hole.iter().filter(|p| is_inside(p)).count() > hole.len()
}

/// One ring of a ring and its holes, by bridges that are passed twice.
fn joined(mut ring: Vec<Corner>, mut holes: Vec<Vec<Corner>>) -> Vec<Corner> {
    while !holes.is_empty() {
        let mut bridges = Vec::new();
        for (h, hole) in holes.iter().enumerate() {
            for (i, p) in hole.iter().enumerate() {
                for (r, q) in ring.iter().enumerate() {
                    bridges.push(((p.at - q.at).norm_squared(), h, i, r));
                }
            }
        }
        bridges.sort_by(|a, b| a.0.total_cmp(&b.0));
        let is_free = |&&(_, h, i, r): &&(f64, usize, usize, usize)| {
            let (p, q) = (&holes[h][i], &ring[r]);
            holes.iter().chain([&ring]).all(|other| {
                let next = other.iter().cycle().skip(1);
                other.iter().zip(next).all(|(a, b)| !cross([p, q], [a, b]))
            }) && opens_to(&ring, r, p)
        };
        let Some(&(_, h, i, r)) = bridges.iter().find(is_free).or(bridges.first()) else { break };
        let mut hole = holes.remove(h);
        hole.rotate_left(i);
        let (start, end) = (hole[0], ring[r]);
        ring.splice(r + 1..r + 1, hole.into_iter().chain([start, end]));
    }
    ring
}

/// Whether `p` is seen from the inside of the corner `r`: a corner that a bridge has made two opens to either side.
fn opens_to(ring: &[Corner], r: usize, p: &Corner) -> bool {
    let n = ring.len();
    let (before, here, after) = (&ring[(r + n - 1) % n], &ring[r], &ring[(r + 1) % n]);
    let (left_of_in, left_of_out) = (turn(before, here, p) > 0.0, turn(here, after, p) > 0.0);
    if turn(before, here, after) > 0.0 {
        left_of_in && left_of_out
    } else {
        left_of_in || left_of_out
    }
}

/// Whether two segments without a common point cross.
fn cross([p, q]: [&Corner; 2], [a, b]: [&Corner; 2]) -> bool {
    if [p.id, q.id].iter().any(|id| *id == a.id || *id == b.id) {
        return false;
    }
    let apart = |x: f64, y: f64| (x > 0.0 && y > 0.0) || (x < 0.0 && y < 0.0);
    !apart(turn(p, q, a), turn(p, q, b)) && !apart(turn(a, b, p), turn(a, b, q))
}

/// Cuts ears off `ring`: the best-shaped of those that hold no other corner.
fn clip(mut ring: Vec<Corner>, triangles: &mut Vec<[u32; 3]>) {
    let ear = |ring: &[Corner], k: usize| -> f64 {
        let n = ring.len();
        let (a, b, c) = (&ring[(k + n - 1) % n], &ring[k], &ring[(k + 1) % n]);
        let area = turn(a, b, c);
        let longest = [(a, b), (b, c), (c, a)]
            .map(|(p, q)| (p.at - q.at).norm_squared())
            .into_iter()
            .fold(0.0, f64::max);
        let holds = |p: &Corner| {
            ![a, b, c].iter().any(|q| q.id == p.id || q.at == p.at)
                && turn(a, b, p) >= 0.0
                && turn(b, c, p) >= 0.0
                && turn(c, a, p) >= 0.0
        };
        let quality = if longest > 0.0 { area / longest } else { 0.0 };
        // What holds others, or is turned over, is cut only when nothing else is left.
        if area < 0.0 {
            -2.0 + quality
        } else if ring.iter().any(holds) {
            -1.0
        } else {
            quality
        }
    };
    let mut qualities: Vec<f64> = (0..ring.len()).map(|k| ear(&ring, k)).collect();
    while ring.len() > 2 {
        let n = ring.len();
        let best = (0..n).fold(0, |b, k| if qualities[k] > qualities[b] { k } else { b });
        let (before, after) = ((best + n - 1) % n, (best + 1) % n);
        triangles.push([ring[before].id, ring[best].id, ring[after].id]);
        ring.remove(best);
        qualities.remove(best);
        let n = ring.len();
        for k in [(best + n - 1) % n, best % n] {
            qualities[k] = ear(&ring, k);
        }
        // Corners that stood in the way of others may be gone.
        if n > 2 && qualities.iter().all(|q| *q <= 0.0) {
            qualities = (0..n).map(|k| ear(&ring, k)).collect();
        }
    }
}
