//! A balanced tree of boxes.
//!
//! For what may not miss a pair: boxes are exact and of any size. The tree of closest points (`closest::bvh`) is another, because it
//! answers another question: its boxes turn with the surface, eight at a time in single precision.

use nalgebra::Point3;

/// An axis-aligned box \[m\]; one side belongs to it as much as the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    pub(crate) low: Point3<f64>,
    pub(crate) high: Point3<f64>,
}

impl Bounds {
    /// Holds nothing, and meets nothing.
    pub(crate) const EMPTY: Self = Self {
        low: Point3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
        high: Point3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY),
    };

    pub(crate) fn of<'a>(points: impl IntoIterator<Item = &'a Point3<f64>>) -> Self {
        points.into_iter().fold(Self::EMPTY, |b, p| b.joined(&Self { low: *p, high: *p }))
    }

    pub(crate) fn joined(&self, other: &Self) -> Self {
        Self { low: self.low.inf(&other.low), high: self.high.sup(&other.high) }
    }

    /// Whether they share a point: in a side is enough, as one body may be moved infinitesimally.
    #[inline]
    pub(crate) fn meets(&self, other: &Self) -> bool {
        (0..3).all(|k| self.low[k] <= other.high[k] && other.low[k] <= self.high[k])
    }

    /// Whether the other lies within this one.
    pub(crate) fn holds(&self, other: &Self) -> bool {
        (0..3).all(|k| self.low[k] <= other.low[k] && other.high[k] <= self.high[k])
    }

    /// Whether it shares a point with the ray from `point` along x.
    pub(crate) fn is_ahead_of(&self, point: &Point3<f64>) -> bool {
        point.x <= self.high.x
            && (1..3).all(|k| self.low[k] <= point[k] && point[k] <= self.high[k])
    }

    /// The sides beyond which `point` lies, a bit each (Cohen and Sutherland's outcode).
    pub(crate) fn beyond(&self, point: &Point3<f64>) -> u8 {
        (0..3).fold(0, |code, k| {
            let beyond = [point[k] < self.low[k], point[k] > self.high[k]];
            code << 2 | u8::from(beyond[0]) << 1 | u8::from(beyond[1])
        })
    }

    /// The square of the longest distance from a point of it to one of the other.
    fn span_squared(&self, other: &Self) -> f64 {
        let longest = |k: usize| (self.high[k] - other.low[k]).max(other.high[k] - self.low[k]);
        (0..3).map(|k| longest(k).powi(2)).sum()
    }

    fn size(&self) -> f64 {
        let d = self.high - self.low;
        d.x + d.y + d.z
    }
}

const LEAF: usize = 4;

#[derive(Clone, Debug)]
struct BoxNode {
    bounds: Bounds,
    /// Boxes of a leaf, as places in the tree's order.
    first: u32,
    count: u32,
    /// The first of two children that follow each other; of no meaning in a leaf.
    children: u32,
}

impl BoxNode {
    fn is_leaf(&self) -> bool {
        self.children == 0
    }

    fn places(&self) -> std::ops::Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }
}

/// A tree over boxes, each known by its place in the list that the tree was made of.
#[derive(Clone, Debug)]
pub(crate) struct BoxTree {
    /// A parent comes before its children.
    nodes: Vec<BoxNode>,
    /// Boxes by their places, in the tree's order.
    order: Vec<u32>,
    /// Boxes in the order of `order`.
    boxes: Vec<Bounds>,
}

impl BoxTree {
    pub(crate) fn new(boxes: &[Bounds]) -> Self {
        // Halved first: the sum of finite numbers may be no finite number.
        let middle = |i: u32, axis: usize| {
            let b = &boxes[i as usize];
            0.5 * b.low[axis] + 0.5 * b.high[axis]
        };
        let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
        let root =
            BoxNode { bounds: Bounds::EMPTY, first: 0, count: order.len() as u32, children: 0 };
        let mut nodes = vec![root];
        let mut next = 0;
        while next < nodes.len() {
            let (places, first) = (nodes[next].places(), nodes[next].first);
            if places.len() > LEAF {
                let part = &mut order[places];
                let spread = [0, 1, 2].map(|axis| {
                    let ends = part.iter().map(|i| middle(*i, axis));
                    let (low, high) = ends
                        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
                    high - low
                });
                let axis = (0..3).fold(0, |a, b| if spread[b] > spread[a] { b } else { a });
                let half = part.len() / 2;
                part.select_nth_unstable_by(half, |a, b| {
                    middle(*a, axis).total_cmp(&middle(*b, axis)).then(a.cmp(b))
                });
                let count = part.len() as u32;
                nodes[next].children = nodes.len() as u32;
                let middle = half as u32;
                for (first, count) in [(first, middle), (first + middle, count - middle)] {
                    nodes.push(BoxNode { bounds: Bounds::EMPTY, first, count, children: 0 });
                }
            }
            next += 1;
        }
        let mut tree = Self { nodes, boxes: vec![Bounds::EMPTY; order.len()], order };
        tree.refit(|i| boxes[i]);
        tree
    }

    /// Takes over the boxes that `of` gives for their places.
    fn refit(&mut self, of: impl Fn(usize) -> Bounds) {
        for (bounds, place) in self.boxes.iter_mut().zip(&self.order) {
            *bounds = of(*place as usize);
        }
        for n in (0..self.nodes.len()).rev() {
            let node = &self.nodes[n];
            self.nodes[n].bounds = if node.is_leaf() {
                self.boxes[node.places()].iter().fold(Bounds::EMPTY, |b, x| b.joined(x))
            } else {
                let children = node.children as usize;
                self.nodes[children].bounds.joined(&self.nodes[children + 1].bounds)
            };
        }
    }

    /// Hands every box that `wanted` accepts to `visit` by its place, until that answers false; `wanted` of a box
    /// implies that of those around it.
    pub(crate) fn each(
        &self,
        wanted: impl Fn(&Bounds) -> bool,
        mut visit: impl FnMut(usize) -> bool,
    ) {
        let mut open = vec![0];
        while let Some(n) = open.pop() {
            let node: &BoxNode = &self.nodes[n];
            if !wanted(&node.bounds) {
                continue;
            }
            if node.is_leaf() {
                let mut places = node.places().filter(|i| wanted(&self.boxes[*i]));
                if !places.all(|i| visit(self.order[i] as usize)) {
                    return;
                }
            } else {
                let first = node.children as usize;
                open.extend([first + 1, first]);
            }
        }
    }

    /// Calls `visit` with the places of every box here and box of `other` that meet, always in the same order.
    pub(crate) fn each_meeting(&self, other: &Self, mut visit: impl FnMut(usize, usize)) {
        let mut open = vec![(0, 0)];
        while let Some((i, j)) = open.pop() {
            let (a, b): (&BoxNode, &BoxNode) = (&self.nodes[i], &other.nodes[j]);
            if !a.bounds.meets(&b.bounds) {
                continue;
            }
            if a.is_leaf() && b.is_leaf() {
                for x in a.places().filter(|x| self.boxes[*x].meets(&b.bounds)) {
                    for y in b.places().filter(|y| self.boxes[x].meets(&other.boxes[*y])) {
                        visit(self.order[x] as usize, other.order[y] as usize);
                    }
                }
            } else if b.is_leaf() || (!a.is_leaf() && a.bounds.size() >= b.bounds.size()) {
                let first = a.children as usize;
                open.extend([(first, j), (first + 1, j)]);
            } else {
                let first = b.children as usize;
                open.extend([(i, first), (i, first + 1)]);
            }
        }
    }
}

impl BoxTree {
    /// The longest distance between points of its boxes; 0 without boxes.
    pub(crate) fn diameter(&self) -> f64 {
        let mut longest = 0.0;
        // The pair that may be farthest apart is looked at first: it spares most others.
        let mut open = vec![(f64::INFINITY, 0, 0)];
        while let Some((most, i, j)) = open.pop() {
            if most <= longest {
                continue;
            }
            let (a, b): (&BoxNode, &BoxNode) = (&self.nodes[i], &self.nodes[j]);
            if a.is_leaf() && b.is_leaf() {
                for x in a.places() {
                    for y in b.places() {
                        longest = self.boxes[x].span_squared(&self.boxes[y]).max(longest);
                    }
                }
                continue;
            }
            let halves = |node: &BoxNode| [node.children as usize, node.children as usize + 1];
            let bound = |i: usize, j: usize| {
                (self.nodes[i].bounds.span_squared(&self.nodes[j].bounds), i, j)
            };
            let begun = open.len();
            if i == j {
                let [first, second] = halves(a);
                open.extend([bound(first, first), bound(second, second), bound(first, second)]);
            } else if b.is_leaf() || (!a.is_leaf() && a.bounds.size() >= b.bounds.size()) {
                open.extend(halves(a).map(|half| bound(half, j)));
            } else {
                open.extend(halves(b).map(|half| bound(i, half)));
            }
            open[begun..].sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        }
        longest.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::TriMesh;
    use crate::random::SplitMix64;
    use crate::volume::tests::icosphere;
    use nalgebra::{Isometry3, Vector3};

    fn bounds(mesh: &TriMesh, face: usize) -> Bounds {
        Bounds::of(&mesh.triangle(face))
    }

    fn tree(mesh: &TriMesh) -> BoxTree {
        let boxes: Vec<Bounds> = (0..mesh.faces.len()).map(|f| bounds(mesh, f)).collect();
        BoxTree::new(&boxes)
    }

    #[test]
    fn finds_what_a_search_of_all_pairs_finds() {
        let a = icosphere(0.1, 2);
        let mut b = icosphere(0.08, 3);
        let mut of_b = tree(&b);
        b = b.transformed(&Isometry3::translation(0.08, 0.03, 0.05));
        of_b.refit(|f| bounds(&b, f));
        let mut found = Vec::new();
        tree(&a).each_meeting(&of_b, |i, j| found.push((i, j)));
        found.sort_unstable();
        let all = (0..a.faces.len()).flat_map(|i| (0..b.faces.len()).map(move |j| (i, j)));
        let expected: Vec<_> = all.filter(|(i, j)| bounds(&a, *i).meets(&bounds(&b, *j))).collect();
        assert!(found == expected && found.len() > 100);

        let point = Point3::new(0.05, 0.02, 0.04);
        let mut found = Vec::new();
        of_b.each(
            |b| b.is_ahead_of(&point),
            |f| {
                found.push(f);
                true
            },
        );
        found.sort_unstable();
        let expected: Vec<_> =
            (0..b.faces.len()).filter(|f| bounds(&b, *f).is_ahead_of(&point)).collect();
        assert!(found == expected && !found.is_empty());
    }

    #[test]
    fn size_does_not_matter_and_a_visitor_may_stop() {
        for scale in [1e-300, 1e-3, 1.0, 1e307] {
            let mut random = SplitMix64::new(5);
            let mut vector = || Vector3::from_fn(|_, _| random.uniform());
            let boxes: Vec<Bounds> = (0..300)
                .map(|_| {
                    let low = Point3::from(vector() * scale);
                    Bounds { low, high: low + vector() * (0.2 * scale) }
                })
                .collect();
            let tree = BoxTree::new(&boxes);
            for query in &boxes {
                let mut found = vec![false; boxes.len()];
                tree.each(|b| b.meets(query), |i| !std::mem::replace(&mut found[i], true));
                assert!(boxes.iter().zip(found).all(|(b, found)| found == b.meets(query)));
            }
            let mut count = 0;
            tree.each(
                |b| b.meets(&boxes[0]),
                |_| {
                    count += 1;
                    false
                },
            );
            assert_eq!(count, 1);
        }
        BoxTree::new(&[]).each(|_| true, |_| panic!("no boxes"));
    }
}
