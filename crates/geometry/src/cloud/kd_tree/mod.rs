//! Exact nearest neighbors among a fixed set of points.

mod build;
mod probe;
mod search;

use nalgebra::Point3;

use self::build::{KdNode, Leaf};
use self::probe::KdProbe;
pub use self::search::Neighbor;
use self::search::{CollectNear, KNearest, KdNearest, WithinRadius, search};
use super::CloudError;

/// A balanced k-d tree over points: exact neighbors of points.
///
/// Every answer is a function of the points and the query alone: of points at exactly equal distance the one
/// of lowest index counts as nearer, whatever the hint. Four branches leave each node, cut by medians along the
/// longest side of the box around what is left; the boxes are in single precision, rounded outwards, and
/// distances of points in double.
///
/// ```
/// use nalgebra::Point3;
/// use prehend_geometry::cloud::KdTree;
///
/// let tree = KdTree::new(&[Point3::origin(), Point3::new(1.0, 0.0, 0.0)])?;
/// let nearest = tree.nearest(&Point3::new(0.7, 0.0, 0.4), f64::INFINITY).map(|n| n.index);
/// assert_eq!(nearest, Some(1));
/// # Ok::<(), prehend_geometry::cloud::CloudError>(())
/// ```
#[derive(Clone, Debug)]
pub struct KdTree {
    points: Vec<Point3<f64>>,
    /// A complete tree in breadth-first order: the children of node i are 4i + 1 to 4i + 4.
    nodes: Vec<KdNode>,
    leaves: Vec<Leaf>,
}

impl KdTree {
    /// Builds the tree; no points make a tree that finds nothing.
    ///
    /// # Errors
    /// [`CloudError::Coordinate`] for a coordinate that is NaN, infinite, or beyond 1e9 m, and
    /// [`CloudError::TooMany`] beyond 2³¹ points.
    pub fn new(points: &[Point3<f64>]) -> Result<Self, CloudError> {
        super::check(points)?;
        let (nodes, leaves) = build::build(points);
        Ok(Self { points: points.to_vec(), nodes, leaves })
    }

    /// The points \[m\], in the order given.
    pub fn points(&self) -> &[Point3<f64>] {
        &self.points
    }

    /// The point nearest to `query` within `max_distance` \[m\], which may be infinite; `None` too for a query
    /// that is not finite or farther than 1e18 m, whose square leaves single precision.
    #[inline]
    pub fn nearest(&self, query: &Point3<f64>, max_distance: f64) -> Option<Neighbor> {
        let probe = KdProbe::new(query)?;
        search(&self.nodes, &self.leaves, &probe, KdNearest::within(max_distance)?).found()
    }

    /// As [`Self::nearest`], trying the point `hint` first: the answer for a nearby query spares most of the
    /// search. The answer does not depend on the hint.
    #[inline]
    pub fn nearest_with_hint(
        &self,
        query: &Point3<f64>,
        max_distance: f64,
        hint: usize,
    ) -> Option<Neighbor> {
        let probe = KdProbe::new(query)?;
        let mut best = KdNearest::within(max_distance)?;
        if let Some(point) = self.points.get(hint) {
            best.offer((query - point).norm_squared(), hint as u32);
        }
        search(&self.nodes, &self.leaves, &probe, best).found()
    }

    /// The `k` points nearest to `query`, nearest first; fewer where the cloud has fewer.
    pub fn k_nearest(&self, query: &Point3<f64>, k: usize) -> Vec<Neighbor> {
        let limit = k.min(self.points.len());
        match KdProbe::new(query) {
            Some(probe) if limit > 0 => {
                search(&self.nodes, &self.leaves, &probe, KNearest::new(limit)).found()
            }
            _ => Vec::new(),
        }
    }

    /// Every point within `radius` \[m\] of `query`, nearest first.
    pub fn within(&self, query: &Point3<f64>, radius: f64) -> Vec<Neighbor> {
        match (KdProbe::new(query), WithinRadius::new(radius)) {
            (Some(probe), Some(every)) => search(&self.nodes, &self.leaves, &probe, every).found(),
            _ => Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests;
