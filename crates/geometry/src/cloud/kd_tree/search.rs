//! Branch and bound over the tree, and what may be collected on the way.

use super::build::{KdNode, Leaf};
use super::probe::KdProbe;

/// A point of a cloud near a query.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbor {
    /// Index of the point in the cloud.
    pub index: usize,
    /// Its squared distance from the query \[m²\].
    pub distance_squared: f64,
}

/// Deepest tree: 4¹⁶ leaves of eight exceed the number of points there may be. Each level leaves three siblings.
const STACK: usize = 3 * 16 + 4;

/// Keeps the points that are wanted of those that are offered.
pub(super) trait CollectNear {
    /// Squared distance beyond which nothing is wanted any more \[m²\].
    fn limit(&self) -> f64;
    /// Considers the point `index` at squared distance `d2` \[m²\].
    fn offer(&mut self, d2: f64, index: u32);
}

/// Offers `collect` the points of every leaf within its limit.
#[inline]
pub(super) fn search<C: CollectNear>(
    nodes: &[KdNode],
    leaves: &[Leaf],
    probe: &KdProbe,
    mut collect: C,
) -> C {
    let mut bound = prune_bound(collect.limit());
    let mut stack = [(0_u32, 0.0_f32); STACK];
    let mut len = 1;
    while len > 0 {
        len -= 1;
        let (at, distance) = stack[len];
        if distance > bound {
            continue;
        }
        let Some(node) = nodes.get(at as usize) else {
            let leaf = &leaves[at as usize - nodes.len()];
            let distances = probe.to_points(leaf);
            for (&d2, &index) in distances.iter().zip(&leaf.indices) {
                if d2 <= collect.limit() {
                    collect.offer(d2, index);
                }
            }
            bound = prune_bound(collect.limit());
            continue;
        };
        let distances = probe.to_boxes(node);
        let first = len;
        for (lane, &d) in distances.iter().enumerate() {
            // The box of a leaf without points is infinitely far.
            if d <= bound && d < f32::INFINITY {
                // Farthest first: the nearest ends on top of the stack.
                let mut place = len;
                while place > first && stack[place - 1].1 < d {
                    stack[place] = stack[place - 1];
                    place -= 1;
                }
                stack[place] = (4 * at + 1 + lane as u32, d);
                len += 1;
            }
        }
    }
    collect
}

/// A single-precision squared bound that no box holding something within `squared` exceeds: the five roundings
/// of a squared box distance lose at most a relative 4e-7.
#[inline]
fn prune_bound(squared: f64) -> f32 {
    (squared * (1.0 + 1e-6)) as f32 + f32::MIN_POSITIVE
}

/// The square of a limit \[m\], or `None` of one that is no distance.
fn squared(limit: f64) -> Option<f64> {
    (limit >= 0.0).then_some(limit * limit)
}

/// The nearest point.
pub(super) struct KdNearest {
    d2: f64,
    index: u32,
}

impl KdNearest {
    #[inline]
    pub(super) fn within(max_distance: f64) -> Option<Self> {
        Some(Self { d2: squared(max_distance)?, index: u32::MAX })
    }

    #[inline]
    pub(super) fn found(self) -> Option<Neighbor> {
        (self.index != u32::MAX)
            .then_some(Neighbor { index: self.index as usize, distance_squared: self.d2 })
    }
}

impl CollectNear for KdNearest {
    #[inline]
    fn limit(&self) -> f64 {
        self.d2
    }

    #[inline]
    fn offer(&mut self, d2: f64, index: u32) {
        if d2 < self.d2 || (d2 == self.d2 && index < self.index) {
            *self = Self { d2, index };
        }
    }
}

/// The k nearest points, in order.
pub(super) struct KNearest {
    k: usize,
    found: Vec<(f64, u32)>,
}

impl KNearest {
    /// At least one.
    pub(super) fn new(k: usize) -> Self {
        Self { k, found: Vec::with_capacity(k) }
    }

    pub(super) fn found(self) -> Vec<Neighbor> {
        neighbors(self.found)
    }
}

impl CollectNear for KNearest {
    fn limit(&self) -> f64 {
        if self.found.len() < self.k { f64::MAX } else { self.found[self.k - 1].0 }
    }

    fn offer(&mut self, d2: f64, index: u32) {
        let mut at = self.found.len();
        while at > 0 && (d2, index) < self.found[at - 1] {
            at -= 1;
        }
        if at < self.k {
            self.found.truncate(self.k - 1);
            self.found.insert(at, (d2, index));
        }
    }
}

/// All points within a distance.
pub(super) struct WithinRadius {
    limit: f64,
    found: Vec<(f64, u32)>,
}

impl WithinRadius {
    pub(super) fn new(radius: f64) -> Option<Self> {
        Some(Self { limit: squared(radius)?.min(f64::MAX), found: Vec::new() })
    }

    pub(super) fn found(mut self) -> Vec<Neighbor> {
        self.found.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        neighbors(self.found)
    }
}

impl CollectNear for WithinRadius {
    fn limit(&self) -> f64 {
        self.limit
    }

    fn offer(&mut self, d2: f64, index: u32) {
        self.found.push((d2, index));
    }
}

fn neighbors(found: Vec<(f64, u32)>) -> Vec<Neighbor> {
    let neighbor = |(distance_squared, index)| Neighbor { index: index as usize, distance_squared };
    found.into_iter().map(neighbor).collect()
}
