//! An eight-wide hierarchy of oriented boxes over the triangles of a mesh.
//!
//! `obvhs` builds the binary tree; it offers ray queries only, so the tree is regrouped here. Boxes turn with the
//! surface they hold, because for a point far from a smooth surface much of it is nearly equally near: an upright box
//! is loose by about the size of its piece of surface, an oriented one by its bulge only.

use std::time::Duration;

use nalgebra::{Matrix3, Point3, Vector3};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use wide::f32x8;

use super::pack::{LANES, Pack, Point8, dot3};
use super::triangle::Triangle;
use crate::mesh::TriMesh;

/// Largest number of faces a child reference can address.
pub(super) const MAX_FACES: usize = 1 << 28;
const LEAF: u32 = 1 << 31;

/// Eight boxes, lane by lane; one without a child is infinitely far.
#[derive(Clone, Debug)]
pub(super) struct Node {
    center: [f32x8; 3],
    axes: [[f32x8; 3]; 3],
    half: [f32x8; 3],
    pub(super) child: [u32; LANES],
    /// How many of the lanes hold a child.
    pub(super) used: usize,
}

/// Target of a child reference.
pub(super) enum Child {
    /// Index of another node.
    Node(usize),
    /// Index of a pack of triangles.
    Pack(usize),
}

#[inline]
pub(super) fn child(reference: u32) -> Child {
    if reference & LEAF == 0 {
        Child::Node(reference as usize)
    } else {
        Child::Pack((reference & !LEAF) as usize)
    }
}

impl Node {
    fn new(boxes: &[OrientedBox], child: [u32; LANES]) -> Self {
        let mut columns = [[0.0; LANES]; 15];
        columns[12..].fill([f32::NEG_INFINITY; LANES]);
        for (lane, b) in boxes.iter().enumerate() {
            for (column, x) in columns.iter_mut().zip(b.numbers()) {
                column[lane] = x;
            }
        }
        let c = columns.map(f32x8::from);
        Self {
            center: [c[0], c[1], c[2]],
            axes: [[c[3], c[4], c[5]], [c[6], c[7], c[8]], [c[9], c[10], c[11]]],
            half: [c[12], c[13], c[14]],
            child,
            used: boxes.len(),
        }
    }

    /// Squared distances to the boxes \[m²\] and a bit for each of those that are at most `limit`.
    #[inline]
    pub(super) fn within(&self, p: &Point8, limit: f32) -> ([f32; LANES], u32) {
        let squared = self.distances_squared(p);
        (squared.to_array(), squared.simd_le(f32x8::splat(limit)).to_bitmask())
    }

    /// The lane of the nearest box, or of one that is hardly farther.
    #[inline]
    pub(super) fn nearest(&self, p: &Point8) -> usize {
        // Distances are not negative, so that their bits are in order; the lowest three make way for the lane.
        let bits = self.distances_squared(p).to_array().map(f32::to_bits);
        let mut least = u32::MAX;
        for (lane, bits) in bits.into_iter().enumerate() {
            least = least.min(bits & !7 | lane as u32);
        }
        (least & 7) as usize
    }

    #[inline(always)]
    fn distances_squared(&self, p: &Point8) -> f32x8 {
        let d = [p[0] - self.center[0], p[1] - self.center[1], p[2] - self.center[2]];
        let zero = f32x8::ZERO;
        let x = (dot3(&d, &self.axes[0]).abs() - self.half[0]).fast_max(zero);
        let y = (dot3(&d, &self.axes[1]).abs() - self.half[1]).fast_max(zero);
        let z = (dot3(&d, &self.axes[2]).abs() - self.half[2]).fast_max(zero);
        x * x + y * y + z * z
    }

    /// A ball around what lane `lane` holds: center, from that of the mesh, and radius \[m\].
    pub(super) fn ball(&self, lane: usize) -> (Vector3<f64>, f64) {
        let at =
            |v: &[f32x8; 3]| Vector3::from([0, 1, 2].map(|i| f64::from(v[i].to_array()[lane])));
        (at(&self.center), at(&self.half).norm() * (1.0 + 1e-6))
    }
}

/// A box in its own orientation, in single precision, that bounds its triangles from outside.
struct OrientedBox {
    center: [f32; 3],
    axes: [[f32; 3]; 3],
    half: [f32; 3],
}

impl OrientedBox {
    fn around(triangles: &[[Vector3<f64>; 3]]) -> Self {
        let upright = Self::along(&Matrix3::identity(), triangles);
        let turned = Self::along(&principal_axes(triangles), triangles);
        let area = |b: &Self| {
            let [x, y, z] = b.half;
            x * y + y * z + z * x
        };
        if area(&turned) < area(&upright) { turned } else { upright }
    }

    /// The smallest box with these axes (columns).
    fn along(axes: &Matrix3<f64>, triangles: &[[Vector3<f64>; 3]]) -> Self {
        let axes: [[f32; 3]; 3] = [0, 1, 2].map(|i| axes.column(i).map(|x| x as f32).into());
        let wide = axes.map(|a| Vector3::from(a.map(f64::from)));
        let project = |v: &Vector3<f64>| Vector3::from([0, 1, 2].map(|i| wide[i].dot(v)));
        let (mut lo, mut hi) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
        for v in triangles.iter().flatten() {
            let x = project(v);
            (lo, hi) = (lo.inf(&x), hi.sup(&x));
        }
        let mid = (lo + hi) * 0.5;
        let center: [f32; 3] =
            (wide[0] * mid.x + wide[1] * mid.y + wide[2] * mid.z).map(|x| x as f32).into();
        let rounded = project(&Vector3::from(center.map(f64::from)));
        let half = (hi - rounded).sup(&(rounded - lo));
        Self { center, axes, half: half.map(above).into() }
    }

    fn numbers(&self) -> impl Iterator<Item = f32> {
        self.center.into_iter().chain(self.axes.into_iter().flatten()).chain(self.half)
    }
}

/// Directions of greatest and least extent: eigenvectors of the second moment of area.
fn principal_axes(triangles: &[[Vector3<f64>; 3]]) -> Matrix3<f64> {
    let origin = triangles.first().map_or_else(Vector3::zeros, |t| t[0]);
    let (mut area, mut first, mut second) = (0.0, Vector3::zeros(), Matrix3::zeros());
    for corners in triangles {
        let [a, b, c] = corners.map(|v| v - origin);
        let own = (b - a).cross(&(c - a)).norm();
        let sum = a + b + c;
        area += own;
        first += sum * (own / 3.0);
        // The mean of x xᵀ over a triangle is (Σ v vᵀ + s sᵀ) / 12 with s = Σ v.
        let squares = a * a.transpose() + b * b.transpose() + c * c.transpose();
        second += (squares + sum * sum.transpose()) * (own / 12.0);
    }
    let moment = second - first * first.transpose() * (1.0 / area);
    // Scaled to one, because an eigenvalue solver may take small numbers for zero.
    let scale = moment.norm();
    if area > 0.0 && scale > 0.0 && scale.is_finite() {
        let vectors = (moment / scale).symmetric_eigen().eigenvectors;
        if vectors.iter().all(|x| x.is_finite()) {
            return vectors;
        }
    }
    Matrix3::identity()
}

/// Up to a hundredth along each axis, by the number of a face.
///
/// The builder merges nearest neighbors; among equal boxes (a strip of equal triangles, faces on top of each other) it
/// takes quadratic time and may build a chain. What it gets has no equals. Only the tree's shape depends on it: the
/// boxes that queries look at are made from the triangles.
fn jitter(face: usize) -> Vector3<f64> {
    let hash = (face as u32).wrapping_mul(0x9E37_79B9);
    let part = |bits: u32| f64::from(bits >> 8) / f64::from(1 << 24) * 0.01;
    Vector3::new(part(hash), part(hash.rotate_left(11)), part(hash.rotate_left(22)))
}

fn below(x: f64) -> f32 {
    let y = x as f32;
    if f64::from(y) > x { y.next_down() } else { y }
}

fn above(x: f64) -> f32 {
    let y = x as f32;
    if f64::from(y) < x { y.next_up() } else { y }
}

/// The tree over the triangles of a mesh, stored in leaf order.
#[derive(Clone, Debug)]
pub(super) struct Bvh {
    pub(super) nodes: Vec<Node>,
    pub(super) packs: Vec<Pack>,
    pub(super) triangles: Vec<Triangle>,
    /// Position in `triangles` of each face of the mesh.
    pub(super) slot: Vec<u32>,
    /// Index in `packs` of each face of the mesh.
    pub(super) pack: Vec<u32>,
    /// Boxes and packs are measured from here \[m\], the middle of the mesh.
    pub(super) center: Vector3<f64>,
    /// Largest coordinate from there \[m\].
    pub(super) reach: f64,
}

impl Bvh {
    /// Builds the tree; the mesh has between one and [`MAX_FACES`] faces, all finite.
    pub(super) fn new(mesh: &TriMesh) -> Self {
        let faces = 0..mesh.faces.len();
        let (mut lo, mut hi) = (mesh.triangle(0)[0], mesh.triangle(0)[0]);
        let boxes: Vec<(Point3<f64>, Point3<f64>)> = faces
            .map(|f| {
                let [a, b, c] = mesh.triangle(f);
                let bounds = (a.inf(&b).inf(&c), a.sup(&b).sup(&c));
                (lo, hi) = (lo.inf(&bounds.0), hi.sup(&bounds.1));
                bounds
            })
            .collect();
        let center = nalgebra::center(&lo, &hi).coords;
        let reach = (hi.coords - center).amax();
        let boxes: Vec<Aabb> = boxes
            .iter()
            .enumerate()
            .map(|(face, (lo, hi))| {
                let (lo, hi) = (lo.coords - center, hi.coords - center);
                let size = (hi - lo).amax().max(1e-6 * reach);
                let hi = hi + jitter(face) * size;
                Aabb::new(
                    [below(lo.x), below(lo.y), below(lo.z)].into(),
                    [above(hi.x), above(hi.y), above(hi.z)].into(),
                )
            })
            .collect();
        let mut params = BvhBuildParams::medium_build();
        params.max_prims_per_leaf = 1;
        let binary = build_bvh2(&boxes, params, &mut Duration::default());
        let ranges = Ranges::new(&binary);
        let triangles: Vec<Triangle> =
            ranges.order.iter().map(|&f| Triangle::new(mesh.triangle(f as usize), f)).collect();
        let mut slot = vec![0; triangles.len()];
        for (i, t) in triangles.iter().enumerate() {
            slot[t.face as usize] = i as u32;
        }
        let corners: Vec<[Vector3<f64>; 3]> = ranges
            .order
            .iter()
            .map(|&f| mesh.triangle(f as usize).map(|v| v.coords - center))
            .collect();
        let pack = vec![0; slot.len()];
        let (nodes, packs) = (Vec::new(), Vec::new());
        let mut tree = Self { nodes, packs, triangles, slot, pack, center, reach };
        tree.widen(&binary, &ranges, &corners);
        tree
    }

    /// Regroups the binary tree into nodes and packs of eight.
    fn widen(&mut self, binary: &Bvh2, ranges: &Ranges, corners: &[[Vector3<f64>; 3]]) {
        let mut open = vec![(0usize, 0usize)];
        let empty = Node::new(&[], [0; LANES]);
        self.nodes.push(empty.clone());
        while let Some((wide, root)) = open.pop() {
            let mut members = vec![root];
            // Open the largest box that is not yet a pack until the node is full.
            while members.len() < LANES {
                let largest = (0..members.len())
                    .filter(|&i| ranges.of(members[i]).len() > LANES)
                    .max_by(|&i, &j| {
                        let area = |k: usize| binary.nodes[members[k]].aabb.half_area();
                        area(i).total_cmp(&area(j))
                    });
                let Some(i) = largest else { break };
                let first = binary.nodes[members[i]].first_index as usize;
                members[i] = first;
                members.push(first + 1);
            }
            let mut children = [0; LANES];
            let mut boxes = Vec::with_capacity(LANES);
            for (lane, &m) in members.iter().enumerate() {
                let range = ranges.of(m);
                boxes.push(OrientedBox::around(&corners[range.clone()]));
                children[lane] = if range.len() <= LANES {
                    let index = self.packs.len() as u32;
                    for i in range.clone() {
                        self.pack[self.triangles[i].face as usize] = index;
                    }
                    let first = range.start as u32;
                    self.packs.push(Pack::new(&corners[range], first));
                    LEAF | index
                } else {
                    let index = self.nodes.len();
                    self.nodes.push(empty.clone());
                    open.push((index, m));
                    index as u32
                };
            }
            self.nodes[wide] = Node::new(&boxes, children);
        }
    }

    /// The triangles of a pack.
    pub(super) fn triangles_of(&self, pack: usize) -> &[Triangle] {
        &self.triangles[self.packs[pack].range()]
    }

    /// Unit normal of a face of the mesh (zero without area).
    pub(super) fn face_normal(&self, face: u32) -> Vector3<f64> {
        self.triangles[self.slot[face as usize] as usize].normal
    }
}

/// The faces of a binary tree in the order of its leaves, so that every subtree holds a range of them.
struct Ranges {
    order: Vec<u32>,
    /// Start and length, by node.
    of: Vec<(u32, u32)>,
}

impl Ranges {
    fn new(binary: &Bvh2) -> Self {
        let mut order = Vec::with_capacity(binary.primitive_indices.len());
        let mut of = vec![(0, 0); binary.nodes.len()];
        let mut open = vec![(0usize, false)];
        while let Some((n, done)) = open.pop() {
            let node = &binary.nodes[n];
            let first = node.first_index as usize;
            if done {
                of[n].1 = order.len() as u32 - of[n].0;
                continue;
            }
            of[n].0 = order.len() as u32;
            if node.prim_count > 0 {
                let own = first..first + node.prim_count as usize;
                order.extend_from_slice(&binary.primitive_indices[own]);
                of[n].1 = node.prim_count;
            } else {
                open.extend([(n, true), (first + 1, false), (first, false)]);
            }
        }
        Self { order, of }
    }

    fn of(&self, node: usize) -> std::ops::Range<usize> {
        let (start, len) = self.of[node];
        start as usize..(start + len) as usize
    }
}
