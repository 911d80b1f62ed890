//! A balanced tree of boxes over the faces of a mesh, refitted when the mesh moves.

use nalgebra::{Point3, Vector3};

/// An axis-aligned box; one side belongs to it as much as the other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub(super) low: Point3<f64>,
    pub(super) high: Point3<f64>,
}

impl Bounds {
    /// Holds nothing, and meets nothing.
    const EMPTY: Self = Self {
        low: Point3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
        high: Point3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY),
    };

    pub(super) fn of<'a>(points: impl IntoIterator<Item = &'a Point3<f64>>) -> Self {
        let grow = |b: Self, p: &Point3<f64>| Self { low: b.low.inf(p), high: b.high.sup(p) };
        points.into_iter().fold(Self::EMPTY, grow)
    }

    fn joined(&self, other: &Self) -> Self {
        Self { low: self.low.inf(&other.low), high: self.high.sup(&other.high) }
    }

    /// Whether they share a point: in a side is enough, as one body may be moved infinitesimally.
    #[inline]
    pub(super) fn meets(&self, other: &Self) -> bool {
        (0..3).all(|k| self.low[k] <= other.high[k] && other.low[k] <= self.high[k])
    }

    /// Whether they share a point with the ray from `point` along x.
    pub(super) fn is_ahead_of(&self, point: &Point3<f64>) -> bool {
        point.x <= self.high.x
            && (1..3).all(|k| self.low[k] <= point[k] && point[k] <= self.high[k])
    }

    fn size(&self) -> f64 {
        let d = self.high - self.low;
        d.x + d.y + d.z
    }
}

const LEAF: usize = 4;

#[derive(Clone, Debug)]
struct Node {
    bounds: Bounds,
    /// Faces of a leaf, as places in the tree's order.
    first: u32,
    count: u32,
    /// The first of two children that follow each other; of no meaning in a leaf.
    children: u32,
}

impl Node {
    fn is_leaf(&self) -> bool {
        self.children == 0
    }

    fn places(&self) -> std::ops::Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }
}

/// The tree.
#[derive(Clone, Debug)]
pub(super) struct Tree {
    /// A parent comes before its children.
    nodes: Vec<Node>,
    /// Faces in the tree's order.
    faces: Vec<u32>,
    /// Their boxes.
    boxes: Vec<Bounds>,
}

impl Tree {
    pub(super) fn new(positions: &[Point3<f64>], faces: &[[u32; 3]]) -> Self {
        let mut order: Vec<(u32, Vector3<f64>)> = (0..)
            .zip(faces)
            .map(|(f, corners)| {
                (f, corners.iter().map(|v| positions[*v as usize].coords).sum::<Vector3<f64>>())
            })
            .collect();
        let root = Node { bounds: Bounds::EMPTY, first: 0, count: order.len() as u32, children: 0 };
        let mut nodes = vec![root];
        let mut next = 0;
        while next < nodes.len() {
            let (places, first) = (nodes[next].places(), nodes[next].first);
            if places.len() > LEAF {
                let part = &mut order[places];
                let empty = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
                let (low, high) = part.iter().fold(empty, |(l, h), (_, c)| (l.inf(c), h.sup(c)));
                let axis = (high - low).imax();
                let half = part.len() / 2;
                part.select_nth_unstable_by(half, |a, b| {
                    a.1[axis].total_cmp(&b.1[axis]).then(a.0.cmp(&b.0))
                });
                let count = part.len() as u32;
                nodes[next].children = nodes.len() as u32;
                let middle = half as u32;
                for (first, count) in [(first, middle), (first + middle, count - middle)] {
                    nodes.push(Node { bounds: Bounds::EMPTY, first, count, children: 0 });
                }
            }
            next += 1;
        }
        let faces_in_order: Vec<u32> = order.iter().map(|(f, _)| *f).collect();
        let boxes = vec![Bounds::EMPTY; faces_in_order.len()];
        let mut tree = Self { nodes, faces: faces_in_order, boxes };
        tree.refit(positions, faces);
        tree
    }

    /// Takes over new positions of the same faces.
    pub(super) fn refit(&mut self, positions: &[Point3<f64>], faces: &[[u32; 3]]) {
        for (bounds, face) in self.boxes.iter_mut().zip(&self.faces) {
            *bounds = Bounds::of(faces[*face as usize].iter().map(|v| &positions[*v as usize]));
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

    pub(super) fn bounds(&self) -> Bounds {
        self.nodes[0].bounds
    }

    /// Calls `visit` with every face whose box `wanted` accepts, `wanted` of a box implying that of those around it.
    pub(super) fn each(&self, wanted: impl Fn(&Bounds) -> bool, mut visit: impl FnMut(usize)) {
        let mut open = vec![0];
        while let Some(n) = open.pop() {
            let node: &Node = &self.nodes[n];
            if !wanted(&node.bounds) {
                continue;
            }
            if node.is_leaf() {
                let places = node.places().filter(|i| wanted(&self.boxes[*i]));
                places.for_each(|i| visit(self.faces[i] as usize));
            } else {
                let first = node.children as usize;
                open.extend([first + 1, first]);
            }
        }
    }

    /// Calls `visit` with every face here and face of `other` whose boxes meet, always in the same order.
    pub(super) fn each_meeting(&self, other: &Self, mut visit: impl FnMut(usize, usize)) {
        let mut open = vec![(0, 0)];
        while let Some((i, j)) = open.pop() {
            let (a, b): (&Node, &Node) = (&self.nodes[i], &other.nodes[j]);
            if !a.bounds.meets(&b.bounds) {
                continue;
            }
            if a.is_leaf() && b.is_leaf() {
                for x in a.places().filter(|x| self.boxes[*x].meets(&b.bounds)) {
                    for y in b.places().filter(|y| self.boxes[x].meets(&other.boxes[*y])) {
                        visit(self.faces[x] as usize, other.faces[y] as usize);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TriMesh;
    use crate::volume::tests::icosphere;
    use nalgebra::Isometry3;

    fn bounds(mesh: &TriMesh, face: usize) -> Bounds {
        Bounds::of(&mesh.triangle(face))
    }

    #[test]
    fn finds_what_a_search_of_all_pairs_finds() {
        let a = icosphere(0.1, 2);
        let mut b = icosphere(0.08, 3);
        let mut tree = Tree::new(&b.vertices, &b.faces);
        b = b.transformed(&Isometry3::translation(0.08, 0.03, 0.05));
        tree.refit(&b.vertices, &b.faces);
        let mut found = Vec::new();
        Tree::new(&a.vertices, &a.faces).each_meeting(&tree, |i, j| found.push((i, j)));
        found.sort_unstable();
        let all = (0..a.faces.len()).flat_map(|i| (0..b.faces.len()).map(move |j| (i, j)));
        let expected: Vec<_> = all.filter(|(i, j)| bounds(&a, *i).meets(&bounds(&b, *j))).collect();
        assert!(found == expected && found.len() > 100);

        let point = Point3::new(0.05, 0.02, 0.04);
        let mut found = Vec::new();
        tree.each(|b| b.is_ahead_of(&point), |f| found.push(f));
        found.sort_unstable();
        let expected: Vec<_> =
            (0..b.faces.len()).filter(|f| bounds(&b, *f).is_ahead_of(&point)).collect();
        assert!(found == expected && !found.is_empty());
    }
}
