//! A four-wide bounding volume hierarchy and its closest-point traversal.
//!
//! `obvhs` builds the binary tree; it offers ray queries only, so the tree is regrouped here into nodes
//! of four boxes, which suit a closest-point query: four squared distances at once, nearest child first.

use std::time::Duration;

use nalgebra::{Point3, Vector3};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;

use super::triangle::{Foot, Triangle};
use crate::TriMesh;

/// Largest number of faces a child reference can address.
pub(super) const MAX_FACES: usize = 1 << 28;
const LEAF: u32 = 1 << 31;
const MAX_LEAF: u32 = 4;
/// Stack that lives in registers and cache; deeper trees fall back to the heap.
const SHORT_STACK: usize = 64;

/// Four boxes, lane by lane; an unused lane has an empty box that no query enters.
#[derive(Clone, Debug)]
pub(super) struct Node {
    lo: [[f32; 4]; 3],
    hi: [[f32; 4]; 3],
    pub(super) child: [u32; 4],
}

/// What a child reference leads to.
pub(super) enum Child {
    /// Index of another node.
    Node(usize),
    /// Range of triangles.
    Leaf(std::ops::Range<usize>),
}

pub(super) fn child(reference: u32) -> Child {
    if reference & LEAF == 0 {
        return Child::Node(reference as usize);
    }
    let first = (reference & (MAX_FACES as u32 - 1)) as usize;
    Child::Leaf(first..first + ((reference >> 28) & 7) as usize + 1)
}

impl Node {
    const EMPTY: Self =
        Self { lo: [[f32::INFINITY; 4]; 3], hi: [[f32::NEG_INFINITY; 4]; 3], child: [u32::MAX; 4] };

    /// Whether lane `i` holds a child.
    pub(super) fn used(&self, i: usize) -> bool {
        self.lo[0][i] <= self.hi[0][i]
    }

    /// Box of lane `i` \[m\].
    pub(super) fn bounds(&self, i: usize) -> (Vector3<f64>, Vector3<f64>) {
        let corner = |b: &[[f32; 4]; 3]| {
            Vector3::new(f64::from(b[0][i]), f64::from(b[1][i]), f64::from(b[2][i]))
        };
        (corner(&self.lo), corner(&self.hi))
    }

    /// Squared distance from the query interval to each box.
    #[inline]
    fn distances_squared(&self, query: &Query) -> [f32; 4] {
        let mut sum = [0.0f32; 4];
        for axis in 0..3 {
            let (lo, hi) = (&self.lo[axis], &self.hi[axis]);
            for i in 0..4 {
                let outside = (lo[i] - query.hi[axis]).max(query.lo[axis] - hi[i]).max(0.0);
                sum[i] += outside * outside;
            }
        }
        sum
    }
}

/// The query point rounded outwards to single precision, so that box distances stay lower bounds.
struct Query {
    lo: [f32; 3],
    hi: [f32; 3],
}

impl Query {
    fn new(p: &Vector3<f64>) -> Self {
        Self { lo: [0, 1, 2].map(|i| below(p[i])), hi: [0, 1, 2].map(|i| above(p[i])) }
    }
}

fn below(x: f64) -> f32 {
    let y = x as f32;
    if f64::from(y) > x { y.next_down() } else { y }
}

fn above(x: f64) -> f32 {
    let y = x as f32;
    if f64::from(y) < x { y.next_up() } else { y }
}

/// A single-precision squared bound that no box holding something nearer than `squared` exceeds.
///
/// The five roundings of a squared box distance lose at most a relative 4e-7.
#[inline]
fn prune_bound(squared: f64) -> f32 {
    (squared * (1.0 + 1e-6)) as f32 + f32::MIN_POSITIVE
}

/// The tree over the triangles of a mesh, stored in leaf order.
#[derive(Clone, Debug)]
pub(super) struct Bvh {
    pub(super) nodes: Vec<Node>,
    pub(super) triangles: Vec<Triangle>,
    /// Position in `triangles` of each face of the mesh.
    slot: Vec<u32>,
    stack: usize,
}

impl Bvh {
    /// Builds the tree; the mesh has between one and [`MAX_FACES`] faces, all finite.
    pub(super) fn new(mesh: &TriMesh) -> Self {
        let boxes: Vec<Aabb> = (0..mesh.faces.len())
            .map(|f| {
                let [a, b, c] = mesh.triangle(f);
                let (lo, hi): (Point3<f64>, Point3<f64>) = (a.inf(&b).inf(&c), a.sup(&b).sup(&c));
                Aabb::new(
                    [below(lo.x), below(lo.y), below(lo.z)].into(),
                    [above(hi.x), above(hi.y), above(hi.z)].into(),
                )
            })
            .collect();
        let mut params = BvhBuildParams::medium_build();
        params.max_prims_per_leaf = MAX_LEAF;
        params.collapse_traversal_cost = 1.0;
        let binary = build_bvh2(&boxes, params, &mut Duration::default());
        let triangles: Vec<Triangle> = binary
            .primitive_indices
            .iter()
            .map(|&f| Triangle::new(mesh.triangle(f as usize), f))
            .collect();
        let mut slot = vec![0; triangles.len()];
        for (i, t) in triangles.iter().enumerate() {
            slot[t.face as usize] = i as u32;
        }
        let mut tree = Self { nodes: Vec::new(), triangles, slot, stack: 0 };
        let depth = tree.widen(&binary);
        // Each level leaves at most three siblings behind.
        tree.stack = 3 * depth + 4;
        tree
    }

    /// Regroups the binary tree into nodes of four; returns the depth.
    fn widen(&mut self, binary: &Bvh2) -> usize {
        let mut depth = 0;
        let mut open = vec![(0usize, 0usize, 1usize)];
        self.nodes.push(Node::EMPTY);
        while let Some((wide, root, level)) = open.pop() {
            depth = depth.max(level);
            let mut members = vec![root];
            // Open the inner child of the largest box until the node is full.
            while members.len() < 4 {
                let largest = (0..members.len())
                    .filter(|&i| binary.nodes[members[i]].prim_count == 0)
                    .max_by(|&i, &j| {
                        let area = |k: usize| binary.nodes[members[k]].aabb.half_area();
                        area(i).total_cmp(&area(j))
                    });
                let Some(i) = largest else { break };
                let first = binary.nodes[members[i]].first_index as usize;
                members[i] = first;
                members.push(first + 1);
            }
            for (lane, &m) in members.iter().enumerate() {
                let node = &binary.nodes[m];
                let reference = if node.prim_count > 0 {
                    LEAF | (node.prim_count - 1) << 28 | node.first_index
                } else {
                    let index = self.nodes.len();
                    self.nodes.push(Node::EMPTY);
                    open.push((index, m, level + 1));
                    index as u32
                };
                let entry = &mut self.nodes[wide];
                entry.child[lane] = reference;
                for axis in 0..3 {
                    entry.lo[axis][lane] = node.aabb.min[axis];
                    entry.hi[axis][lane] = node.aabb.max[axis];
                }
            }
        }
        depth
    }

    /// Unit normal of a face of the mesh (zero without area).
    pub(super) fn face_normal(&self, face: u32) -> Vector3<f64> {
        self.triangles[self.slot[face as usize] as usize].normal
    }

    /// The triangle nearest to `p` among those strictly within the squared distance `limit` \[m²\].
    ///
    /// `hint`, a face of the mesh, is tried first: a good one prunes most of the tree.
    #[inline]
    pub(super) fn closest(
        &self,
        p: &Vector3<f64>,
        limit: f64,
        hint: Option<u32>,
    ) -> Option<(usize, Foot)> {
        let mut best = Best { limit, found: None };
        if let Some(&slot) = hint.and_then(|face| self.slot.get(face as usize)) {
            best.offer(&self.triangles, p, slot as usize);
        }
        if self.stack <= SHORT_STACK {
            self.descend(p, &mut best, &mut [(0, 0.0); SHORT_STACK]);
        } else {
            self.descend(p, &mut best, &mut vec![(0, 0.0); self.stack]);
        }
        best.found
    }

    #[inline]
    fn descend(&self, p: &Vector3<f64>, best: &mut Best, stack: &mut [(u32, f32)]) {
        let query = Query::new(p);
        let mut bound = prune_bound(best.limit);
        let mut len = 1;
        stack[0] = (0, 0.0);
        while len > 0 {
            len -= 1;
            let (reference, distance) = stack[len];
            if distance > bound {
                continue;
            }
            match child(reference) {
                Child::Leaf(range) => {
                    for i in range {
                        best.offer(&self.triangles, p, i);
                    }
                    bound = prune_bound(best.limit);
                }
                Child::Node(index) => {
                    let node = &self.nodes[index];
                    let distances = node.distances_squared(&query);
                    let first = len;
                    for (&d, &reference) in distances.iter().zip(&node.child) {
                        // Unused lanes are infinitely far.
                        if d <= bound && d < f32::INFINITY {
                            // Farthest first: the nearest ends on top of the stack.
                            let mut at = len;
                            while at > first && stack[at - 1].1 < d {
                                stack[at] = stack[at - 1];
                                at -= 1;
                            }
                            stack[at] = (reference, d);
                            len += 1;
                        }
                    }
                }
            }
        }
    }
}

struct Best {
    limit: f64,
    found: Option<(usize, Foot)>,
}

impl Best {
    #[inline]
    fn offer(&mut self, triangles: &[Triangle], p: &Vector3<f64>, i: usize) {
        let triangle = &triangles[i];
        if triangle.plane_distance_squared(p) >= self.limit {
            return;
        }
        let foot = triangle.closest(p);
        if foot.distance_squared < self.limit {
            self.limit = foot.distance_squared;
            self.found = Some((i, foot));
        }
    }
}
