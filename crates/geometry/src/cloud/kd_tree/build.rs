//! The tree: medians cut the points into equal leaves, boxes are fitted from the leaves up.

use nalgebra::Point3;

use crate::box_tree::Bounds;

/// Points in a leaf at most.
pub(super) const LEAF: usize = 8;
/// Below this many points a thread sorts on its own.
const SERIAL: usize = 1 << 13;

/// Up to eight points, lane by lane; unused lanes are infinitely far and have no index.
#[derive(Clone, Debug)]
pub(super) struct Leaf {
    pub(super) coordinates: [[f64; LEAF]; 3],
    pub(super) indices: [u32; LEAF],
}

/// The boxes of four children, lane by lane, in single precision rounded outwards.
#[derive(Clone, Debug)]
pub(super) struct KdNode {
    pub(super) lo: [[f32; 4]; 3],
    pub(super) hi: [[f32; 4]; 3],
}

/// The nodes of a complete four-way tree in breadth-first order, and its leaves.
pub(super) fn build(points: &[Point3<f64>]) -> (Vec<KdNode>, Vec<Leaf>) {
    let mut depth = 0;
    while points.len() > LEAF << (2 * depth) {
        depth += 1;
    }
    let count = 1_usize << (2 * depth);
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    cut(points, &mut order, 2 * depth);

    let mut leaves = Vec::with_capacity(count);
    let mut boxes = Vec::with_capacity(count);
    halve(&order, 2 * depth, &mut |part| {
        let mut leaf = Leaf { coordinates: [[f64::INFINITY; LEAF]; 3], indices: [u32::MAX; LEAF] };
        for (lane, &i) in part.iter().enumerate() {
            leaf.indices[lane] = i;
            for (axis, lanes) in leaf.coordinates.iter_mut().enumerate() {
                lanes[lane] = points[i as usize][axis];
            }
        }
        leaves.push(leaf);
        boxes.push(bounds(points, part));
    });

    let mut nodes = vec![KdNode { lo: [[0.0; 4]; 3], hi: [[0.0; 4]; 3] }; (count - 1) / 3];
    for level in (0..depth).rev() {
        let first = ((1 << (2 * level)) - 1) / 3;
        let mut joined = Vec::with_capacity(boxes.len() / 4);
        for (node, children) in nodes[first..].iter_mut().zip(boxes.chunks_exact(4)) {
            for (lane, child) in children.iter().enumerate() {
                for axis in 0..3 {
                    node.lo[axis][lane] = below(child.low[axis]);
                    node.hi[axis][lane] = above(child.high[axis]);
                }
            }
            joined.push(children.iter().fold(Bounds::EMPTY, |all, child| all.joined(child)));
        }
        boxes = joined;
    }
    (nodes, leaves)
}

/// Orders `part` so that `times` halvings at its middle cut it along medians.
fn cut(points: &[Point3<f64>], part: &mut [u32], times: u32) {
    if times == 0 || part.len() < 2 {
        return;
    }
    let bounds = bounds(points, part);
    let axis = (bounds.high - bounds.low).imax();
    let middle = part.len() / 2;
    part.select_nth_unstable_by(middle, |&a, &b| {
        points[a as usize][axis].total_cmp(&points[b as usize][axis]).then(a.cmp(&b))
    });
    let (low, high) = part.split_at_mut(middle);
    if low.len() < SERIAL {
        cut(points, low, times - 1);
        cut(points, high, times - 1);
    } else {
        rayon::join(|| cut(points, low, times - 1), || cut(points, high, times - 1));
    }
}

/// Hands the parts that `times` halvings make of `part` to `take`, in order.
fn halve(part: &[u32], times: u32, take: &mut impl FnMut(&[u32])) {
    if times == 0 {
        return take(part);
    }
    let (low, high) = part.split_at(part.len() / 2);
    halve(low, times - 1, take);
    halve(high, times - 1, take);
}

fn bounds(points: &[Point3<f64>], part: &[u32]) -> Bounds {
    Bounds::of(part.iter().map(|&i| &points[i as usize]))
}

/// The largest single-precision number that is not above `x`.
pub(super) fn below(x: f64) -> f32 {
    let y = x as f32;
    if f64::from(y) > x { y.next_down() } else { y }
}

/// The smallest single-precision number that is not below `x`.
pub(super) fn above(x: f64) -> f32 {
    -below(-x)
}
