//! The search for the closest triangle: everything in single precision but the last word.
//!
//! Boxes and triangles are measured in single precision, to within a slack that bounds every rounding. Triangles that
//! cannot be told from the nearest that way (mostly one; those around a corner where the point is closest to it) are
//! kept and measured in double precision at the end. The answer is the triangle of smallest double-precision
//! distance, and among equals that of lowest face number, wherever the search began.

use nalgebra::Vector3;
use wide::f32x8;

use super::bvh::{Bvh, Child, child};
use super::pack::Point8;
use super::triangle::TriangleFoot;

/// Triangles kept for the last word.
const KEPT: usize = 16;
/// Farther away \[m\] squares leave single precision.
const FAR: f64 = 1e15;

impl Bvh {
    /// The triangle nearest to `p` among those strictly within the squared distance `limit` \[m²\], and where.
    ///
    /// The triangles near `hint`, a face of the mesh, are tried first: a good one prunes most of the tree.
    #[inline]
    pub(super) fn closest(
        &self,
        p: &Vector3<f64>,
        limit: f64,
        hint: Option<u32>,
    ) -> Option<(usize, TriangleFoot)> {
        let local = p - self.center;
        let far = local.amax();
        let mut last = LastWord { p, limit, face: u32::MAX, found: None };
        if far > FAR {
            (0..self.triangles.len()).for_each(|slot| last.offer(self, slot));
            return last.found;
        }
        // Each coordinate, difference and axis is off by at most half a unit in the last place (2⁻²⁴) of the reach
        // or the point, and a distance sums some twenty of them.
        let error = (32.0 / (1u32 << 24) as f64 * (self.reach + far)) as f32 + f32::MIN_POSITIVE;
        let mut search = Search {
            tree: self,
            point: [local.x, local.y, local.z].map(|x| f32x8::splat(x as f32)),
            slack: 2.0 * error,
            nearest: f32::INFINITY,
            limit: 0.0,
            kept: [(0.0, 0); KEPT],
            count: 0,
            last,
        };
        search.limit = search.square_with_slack(limit.sqrt() as f32);
        let skip = match hint.and_then(|face| self.pack.get(face as usize)) {
            Some(&pack) => pack as usize,
            None => search.plunge(),
        };
        search.visit_pack(skip);
        search.visit_node(0, skip);
        search.settle();
        search.last.found
    }
}

/// The numbers of the bits that are set, ascending.
#[inline(always)]
pub(super) fn lanes(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = (bits != 0).then_some(bits.trailing_zeros() as usize);
        bits &= bits.wrapping_sub(1);
        lane
    })
}

struct Search<'a> {
    tree: &'a Bvh,
    point: Point8,
    /// Twice the error of a single-precision distance \[m\].
    slack: f32,
    /// Smallest squared distance seen \[m²\].
    nearest: f32,
    /// Squared distance, with slack, beyond which no triangle can be the nearest \[m²\].
    limit: f32,
    kept: [(f32, u32); KEPT],
    count: usize,
    last: LastWord<'a>,
}

impl Search<'_> {
    #[inline]
    fn square_with_slack(&self, distance: f32) -> f32 {
        let d = distance + self.slack;
        (d * d * (1.0 + 1e-6)).min(f32::MAX)
    }

    /// The pack at the end of the nearest child of the nearest child and so on: near enough to spare the search
    /// proper from sorting children by their distances while it has no bound.
    #[inline]
    fn plunge(&self) -> usize {
        let mut reference = 0;
        loop {
            match child(reference) {
                Child::Pack(pack) => return pack,
                Child::Node(index) => {
                    let node = &self.tree.nodes[index];
                    reference = node.child[node.nearest(&self.point)];
                }
            }
        }
    }

    /// Visits what may hold the nearest below a node, nearest boxes first, but not the pack `skip`.
    fn visit_node(&mut self, index: usize, skip: usize) {
        let tree = self.tree;
        let node = &tree.nodes[index];
        let (distances, mut near) = node.within(&self.point, self.limit);
        while near != 0 {
            let mut nearest = near.trailing_zeros() as usize;
            for lane in lanes(near & (near - 1)) {
                if distances[lane] < distances[nearest] {
                    nearest = lane;
                }
            }
            if distances[nearest] > self.limit {
                return;
            }
            near &= !(1 << nearest);
            match child(node.child[nearest]) {
                Child::Pack(pack) if pack == skip => {}
                Child::Pack(pack) => self.visit_pack(pack),
                Child::Node(index) => self.visit_node(index, skip),
            }
        }
    }

    #[inline]
    fn visit_pack(&mut self, index: usize) {
        let pack = &self.tree.packs[index];
        let squared = pack.distances_squared(&self.point);
        let mut near = pack.within(squared, self.limit);
        if near == 0 {
            return;
        }
        // The limit first: it leaves few to be kept.
        let distances = squared.to_array();
        let least = lanes(near).fold(f32::INFINITY, |least, lane| least.min(distances[lane]));
        if least < self.nearest {
            self.nearest = least;
            self.limit = self.limit.min(self.square_with_slack(least.sqrt()));
            near = pack.within(squared, self.limit);
        }
        for lane in lanes(near) {
            if self.count == KEPT {
                self.make_room();
            }
            self.kept[self.count] = (distances[lane], pack.first + lane as u32);
            self.count += 1;
        }
    }

    /// Drops what is out of reach by now, or else settles all.
    #[cold]
    fn make_room(&mut self) {
        self.limit = self.limit.min(self.square_with_slack(self.nearest.sqrt()));
        let mut left = 0;
        for i in 0..self.count {
            if self.kept[i].0 <= self.limit {
                self.kept[left] = self.kept[i];
                left += 1;
            }
        }
        self.count = left;
        if left > KEPT / 2 {
            self.settle();
        }
    }

    /// Measures what is kept in double precision.
    #[inline]
    fn settle(&mut self) {
        for &(d, slot) in &self.kept[..self.count] {
            if d <= self.limit {
                self.last.offer(self.tree, slot as usize);
            }
        }
        self.count = 0;
    }
}

/// The nearest in double precision.
struct LastWord<'a> {
    p: &'a Vector3<f64>,
    /// Squared distance of the nearest \[m²\]; what is to be found is nearer at first.
    limit: f64,
    face: u32,
    found: Option<(usize, TriangleFoot)>,
}

impl LastWord<'_> {
    #[inline]
    fn offer(&mut self, tree: &Bvh, slot: usize) {
        let triangle = &tree.triangles[slot];
        let foot = triangle.closest(self.p);
        let d = foot.distance_squared;
        if d < self.limit || (d == self.limit && self.found.is_some() && triangle.face < self.face)
        {
            (self.limit, self.face, self.found) = (d, triangle.face, Some((slot, foot)));
        }
    }
}
