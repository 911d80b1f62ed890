//! The collision shape of a robot: per link its bodies, their closest points, and one distance grid.

use std::sync::Arc;

use nalgebra::Point3;
use rayon::prelude::*;

use super::{KinematicTree, Result, RobotError};
use crate::closest::{ClosestPoints, box_distance};
use crate::field::{DistanceField, FieldSample};
use crate::mesh::TriMesh;
use crate::sdf::{GridCache, Lattice, SdfGrid};

/// The collision shape of one link, in the link frame.
#[derive(Clone, Debug)]
pub struct LinkShape {
    parts: Vec<TriMesh>,
    closest: Vec<ClosestPoints>,
    grid: Option<SdfGrid>,
}

/// Cells along the longest side of a grid at most: those of tables and walls are coarser. Beside a flat face a distance is linear, and exact on any grid.
const MOST_CELLS: f64 = 200.0;

impl LinkShape {
    fn new(
        parts: &[TriMesh],
        [spacing, margin]: [f64; 2],
        cache: Option<&GridCache>,
    ) -> Result<Self, String> {
        let closest = parts
            .iter()
            .map(|p| ClosestPoints::new(p).map_err(|e| e.to_string()))
            .collect::<Result<Vec<_>, _>>()?;
        let bounds =
            closest.iter().map(ClosestPoints::bounds).reduce(|a, b| (a.0.inf(&b.0), a.1.sup(&b.1)));
        let grid = bounds
            .map(|bounds| {
                let spacing = spacing.max((bounds.1 - bounds.0).max() / MOST_CELLS);
                let build = || {
                    Lattice::around(bounds, spacing, margin)
                        .map(|lattice| SdfGrid::of_union(&closest, bounds, lattice))
                };
                match cache {
                    Some(cache) => cache.grid(parts, bounds, [spacing, margin], build),
                    None => build(),
                }
            })
            .transpose()
            .map_err(|e| e.to_string())?;
        Ok(Self { parts: parts.to_vec(), closest, grid })
    }

    /// The collision bodies \[m\]; they may overlap each other.
    pub fn parts(&self) -> &[TriMesh] {
        &self.parts
    }

    /// Closest points of each body.
    pub fn closest(&self) -> &[ClosestPoints] {
        &self.closest
    }

    /// Signed distance to the union of the bodies, or `None` for a link without any.
    pub fn grid(&self) -> Option<&SdfGrid> {
        self.grid.as_ref()
    }

    /// Exact signed distance to the union of the bodies \[m\], infinite without any.
    ///
    /// The smallest of the bodies' own distances: exact outside; inside where bodies overlap it
    /// understates the depth, which never exceeds the depth in the union.
    pub fn signed_distance(&self, point: &Point3<f64>) -> f64 {
        self.closest.iter().fold(f64::INFINITY, |best, body| {
            let gap = box_distance(&body.bounds(), point);
            // Outside its box a body matters only if nearer than the best; inside it may also be deeper.
            let limit = if gap > 0.0 { best.max(0.0) } else { f64::INFINITY };
            let within = || body.signed_distance_within(point, limit);
            let distance = if gap > limit { None } else { within() };
            distance.map_or(best, |(distance, _)| best.min(distance))
        })
    }
}

/// That of the grid, in the link frame; nothing is near a link without bodies.
impl DistanceField for LinkShape {
    fn sample(&self, point: &Point3<f64>, reach: f64) -> Option<FieldSample> {
        self.grid()?.sample(point, reach)
    }

    fn distance(&self, point: &Point3<f64>, reach: f64) -> Option<f64> {
        self.grid()?.distance(point, reach)
    }

    fn thickness(&self) -> f64 {
        self.grid().map_or(f64::INFINITY, DistanceField::thickness)
    }

    fn bounding_ball(&self) -> Option<(Point3<f64>, f64)> {
        self.grid()?.bounding_ball()
    }
}

/// The collision shape of a robot in no particular pose. Links of equal geometry share theirs.
#[derive(Clone, Debug)]
pub struct RobotShape {
    names: Vec<String>,
    links: Vec<Arc<LinkShape>>,
}

impl RobotShape {
    /// Spacing that suits a hand: 2 mm.
    pub const DEFAULT_SPACING: f64 = 0.002;
    /// Margin that suits contact on a hand: 12 mm.
    pub const DEFAULT_MARGIN: f64 = 0.012;

    /// Builds every link's distance grid, sampled every `spacing` \[m\] (a 200th of links that are longer than that) and reaching `margin` \[m\] around
    /// the link: at least as far as distances will be asked for.
    ///
    /// # Errors
    /// [`RobotError::Shape`], naming the link whose bodies cannot be used.
    pub fn new(robot: &KinematicTree, spacing: f64, margin: f64) -> Result<Self> {
        Self::cached(robot, spacing, margin, None)
    }

    /// As [`Self::new`] has it, but that grids which `cache` holds are taken from there, and others left there.
    ///
    /// # Errors
    /// As [`Self::new`]; none that has to do with the cache.
    pub fn cached(
        robot: &KinematicTree,
        spacing: f64,
        margin: f64,
        cache: Option<&GridCache>,
    ) -> Result<Self> {
        let links = robot.links();
        // For each link the first one of equal geometry.
        let first: Vec<usize> = (0..links.len())
            .map(|l| (0..l).find(|&k| same(&links[k].parts, &links[l].parts)).unwrap_or(l))
            .collect();
        let built = (0..links.len())
            .into_par_iter()
            .map(|l| {
                if first[l] != l {
                    return Ok(None);
                }
                LinkShape::new(&links[l].parts, [spacing, margin], cache)
                    .map(|shape| Some(Arc::new(shape)))
                    .map_err(|reason| RobotError::Shape { link: links[l].name.clone(), reason })
            })
            .collect::<Vec<_>>();
        let mut shapes: Vec<Arc<LinkShape>> = Vec::with_capacity(links.len());
        for (l, shape) in built.into_iter().enumerate() {
            let shape = shape?.unwrap_or_else(|| shapes[first[l]].clone());
            shapes.push(shape);
        }
        Ok(Self { names: links.iter().map(|l| l.name.clone()).collect(), links: shapes })
    }

    /// Names of the links, in the order of [`KinematicTree::links`].
    pub fn link_names(&self) -> &[String] {
        &self.names
    }

    /// Shapes of the links, in the order of [`KinematicTree::links`].
    pub fn links(&self) -> &[Arc<LinkShape>] {
        &self.links
    }
}

fn same(a: &[TriMesh], b: &[TriMesh]) -> bool {
    a.len() == b.len()
        && a.iter().zip(b).all(|(a, b)| a.faces == b.faces && a.vertices == b.vertices)
}
