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
        PolygonCorner { id, at: Point2::new(p[i], flip * p[j]) }
    };
    let (mut outer, mut holes) = (Vec::new(), Vec::new());
    for ring in rings(edges) {
        let ring: Vec<PolygonCorner> = ring.into_iter().map(flat).collect();
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
struct PolygonCorner {
    id: u32,
    at: Point2<f64>,
}

/// Twice the area of the triangle, positive where it turns left.
fn turn(a: &PolygonCorner, b: &PolygonCorner, c: &PolygonCorner) -> f64 {
    (b.at - a.at).perp(&(c.at - a.at))
}

fn area(ring: &[PolygonCorner]) -> f64 {
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
fn contains(ring: &[PolygonCorner], hole: &[PolygonCorner]) -> bool {
    let is_inside = |p: &PolygonCorner| {
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
fn joined(mut ring: Vec<PolygonCorner>, mut holes: Vec<Vec<PolygonCorner>>) -> Vec<PolygonCorner> {
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
fn opens_to(ring: &[PolygonCorner], r: usize, p: &PolygonCorner) -> bool {
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
fn cross([p, q]: [&PolygonCorner; 2], [a, b]: [&PolygonCorner; 2]) -> bool {
    if [p.id, q.id].iter().any(|id| *id == a.id || *id == b.id) {
        return false;
    }
    let apart = |x: f64, y: f64| (x > 0.0 && y > 0.0) || (x < 0.0 && y < 0.0);
    !apart(turn(p, q, a), turn(p, q, b)) && !apart(turn(a, b, p), turn(a, b, q))
}

/// Cuts ears off `ring`: the best-shaped of those that hold no other corner.
fn clip(mut ring: Vec<PolygonCorner>, triangles: &mut Vec<[u32; 3]>) {
    let ear = |ring: &[PolygonCorner], k: usize| -> f64 {
        let n = ring.len();
        let (a, b, c) = (&ring[(k + n - 1) % n], &ring[k], &ring[(k + 1) % n]);
        let area = turn(a, b, c);
        let longest = [(a, b), (b, c), (c, a)]
            .map(|(p, q)| (p.at - q.at).norm_squared())
            .into_iter()
            .fold(0.0, f64::max);
        let holds = |p: &PolygonCorner| {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix64;

    /// Fills rings of points in a plane seen from `normal` and checks area, direction and boundary.
    fn check(rings: &[Vec<Point2<f64>>], expected: f64) {
        let points: Vec<Point3<f64>> =
            rings.iter().flatten().map(|p| Point3::new(p.x, p.y, 0.3 * p.x - 0.1 * p.y)).collect();
        let (mut edges, mut first) = (Vec::new(), 0);
        for ring in rings {
            let n = ring.len() as u32;
            edges.extend((0..n).map(|k| [first + k, first + (k + 1) % n]));
            first += n;
        }
        // The same from the other side: every edge and the normal turned round.
        for turned in [false, true] {
            let mut normal = Vector3::new(-0.3, 0.1, 1.0);
            if turned {
                normal = -normal;
                edges.iter_mut().for_each(|e| e.swap(0, 1));
            }
            let triangles = fill(&edges, |id| points[id as usize], &normal);
            let mut area = 0.0;
            let mut left = Vec::new();
            for t in &triangles {
                let [a, b, c] = t.map(|v| points[v as usize]);
                let own = (b - a).cross(&(c - a)).z * if turned { -0.5 } else { 0.5 };
                assert!(own > -1e-15, "{t:?}");
                area += own;
                left.extend([[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]);
            }
            assert!((area - expected).abs() < 1e-12, "{area} {expected}");
            for edge in &edges {
                let at = left.iter().position(|e| e == edge).unwrap();
                left.swap_remove(at);
            }
            while let Some([a, b]) = left.pop() {
                let at = left.iter().position(|e| *e == [b, a]).unwrap();
                left.swap_remove(at);
            }
        }
    }

    fn rectangle(low: [f64; 2], high: [f64; 2]) -> Vec<Point2<f64>> {
        [[low[0], low[1]], [high[0], low[1]], high, [low[0], high[1]]].map(Point2::from).to_vec()
    }

    fn reversed(mut ring: Vec<Point2<f64>>) -> Vec<Point2<f64>> {
        ring.reverse();
        ring
    }

    #[test]
    fn pieces_with_holes_and_islands_in_them() {
        let square = rectangle([0.0, 0.0], [4.0, 4.0]);
        let hole = |x: f64, y: f64| reversed(rectangle([x, y], [x + 1.0, y + 1.0]));
        check(std::slice::from_ref(&square), 16.0);
        check(&[square.clone(), hole(0.5, 0.5), hole(2.0, 2.5), hole(2.5, 0.25)], 13.0);
        let island = rectangle([0.75, 0.75], [1.25, 1.25]);
        check(&[island, hole(0.5, 0.5), square, rectangle([5.0, 0.0], [6.0, 1.0])], 16.25);
    }

    #[test]
    fn stars_with_points_on_their_sides() {
        let mut random = SplitMix64::new(1);
        for n in 5..60_u32 {
            let corner = |k: u32, r: f64| {
                let a = std::f64::consts::TAU * f64::from(k) / f64::from(n);
                Point2::new(r * a.cos(), r * a.sin())
            };
            let outer: Vec<_> = (0..n).map(|k| corner(k, 1.0 + random.uniform())).collect();
            let inner: Vec<_> =
                (0..n).rev().map(|k| corner(k, 0.2 + 0.2 * random.uniform())).collect();
            // Middles of sides make straight corners.
            let outer: Vec<_> = (0..outer.len())
                .flat_map(|k| {
                    let next = outer[(k + 1) % outer.len()];
                    [outer[k], nalgebra::center(&outer[k], &next)]
                })
                .collect();
            let area = |ring: &[Point2<f64>]| {
                let next = ring.iter().cycle().skip(1);
                0.5 * ring.iter().zip(next).map(|(p, q)| p.coords.perp(&q.coords)).sum::<f64>()
            };
            let expected = area(&outer) + area(&inner);
            check(&[outer, inner], expected);
        }
    }
}
