//! Exact nearest neighbors among a fixed set of points.

mod build;
mod probe;
mod search;

use nalgebra::Point3;

use self::build::{Leaf, Node};
use self::probe::{PointProbe, TriangleProbe};
use self::search::{Alone, Best, Collect, Every, Nearest};
use super::CloudError;
use crate::closest::triangle::Triangle;

/// A point of a cloud near a query.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbor {
    /// Index of the point in the cloud.
    pub index: usize,
    /// Its squared distance from the query \[m²\].
    pub distance_squared: f64,
}

/// A balanced k-d tree over points: exact neighbors of points, and of triangles.
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
    nodes: Vec<Node>,
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

    /// The indices of the points in the order of the leaves: points that follow each other are near each other.
    pub(crate) fn order(&self) -> impl Iterator<Item = usize> {
        self.leaves.iter().flat_map(|l| l.indices).filter(|&i| i != u32::MAX).map(|i| i as usize)
    }

    /// The point nearest to `query` within `max_distance` \[m\], which may be infinite; `None` too for a query
    /// that is not finite or farther than 1e18 m, whose square leaves single precision.
    #[inline]
    pub fn nearest(&self, query: &Point3<f64>, max_distance: f64) -> Option<Neighbor> {
        let probe = PointProbe::new(query)?;
        self.search(&probe, Nearest::within(max_distance)?).found()
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
        let probe = PointProbe::new(query)?;
        let mut best = Nearest::within(max_distance)?;
        if let Some(point) = self.points.get(hint) {
            best.offer((query - point).norm_squared(), hint as u32);
        }
        self.search(&probe, best).found()
    }

    /// As [`Self::nearest_with_hint`], with the squared distance \[m²\] that no other point is nearer than.
    #[inline]
    pub(crate) fn nearest_alone(
        &self,
        query: &Point3<f64>,
        max_distance: f64,
        hint: Option<usize>,
    ) -> Option<(Neighbor, f64)> {
        let probe = PointProbe::new(query)?;
        let mut alone = Alone::within(max_distance)?;
        if let Some((hint, point)) = hint.and_then(|i| Some((i, self.points.get(i)?))) {
            let d2 = (query - point).norm_squared();
            if d2 <= alone.limit() {
                alone.offer(d2, hint as u32);
            }
        }
        self.search(&probe, alone).found()
    }

    /// The `k` points nearest to `query`, nearest first; fewer where the cloud has fewer.
    pub fn k_nearest(&self, query: &Point3<f64>, k: usize) -> Vec<Neighbor> {
        let limit = k.min(self.points.len());
        match PointProbe::new(query) {
            Some(probe) if limit > 0 => self.search(&probe, Best::new(limit)).found(),
            _ => Vec::new(),
        }
    }

    /// Every point within `radius` \[m\] of `query`, nearest first.
    pub fn within(&self, query: &Point3<f64>, radius: f64) -> Vec<Neighbor> {
        match (PointProbe::new(query), Every::within(radius)) {
            (Some(probe), Some(every)) => self.search(&probe, every).found(),
            _ => Vec::new(),
        }
    }

    /// The point nearest to any part of the triangle of `corners` \[m\], within `max_distance` \[m\];
    /// `None` too for corners that are not finite. `hint`, a point expected to be near, is tried first and
    /// does not change the answer.
    pub fn nearest_to_triangle(
        &self,
        corners: [Point3<f64>; 3],
        max_distance: f64,
        hint: Option<usize>,
    ) -> Option<Neighbor> {
        let triangle = Triangle::new(corners, 0);
        let probe = TriangleProbe::new(&corners, &triangle)?;
        let mut best = Nearest::within(max_distance)?;
        if let Some((hint, point)) = hint.and_then(|i| Some((i, self.points.get(i)?))) {
            best.offer(triangle.closest(&point.coords).distance_squared, hint as u32);
        }
        self.search(&probe, best).found()
    }
}

#[cfg(test)]
mod tests;
