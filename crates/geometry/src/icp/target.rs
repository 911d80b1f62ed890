//! What a cloud is aligned to.

use nalgebra::{Point3, Vector3};

use super::IcpError;
use crate::closest::ClosestPoints;
use crate::cloud::{KdTree, PointCloud};
use crate::mesh::TriMesh;

/// The point of a target that is closest to a query.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    /// The point \[m\], in the target's frame.
    pub point: Point3<f64>,
    /// Unit normal of the target there; zero where it has none.
    pub normal: Vector3<f64>,
}

/// A shape to align to: [`CloudTarget`], [`MeshTarget`], or any other that knows its closest point.
///
/// ```
/// use nalgebra::{Point3, Vector3};
/// use prehend_geometry::icp::{Match, Target};
///
/// /// The ball of this radius \[m\] about the origin.
/// struct Ball(f64);
///
/// impl Target for Ball {
///     type Memory = ();
///     fn closest(&self, query: &Point3<f64>, max_distance: f64, _: &mut ()) -> Option<Match> {
///         let normal = query.coords.try_normalize(0.0)?;
///         let near = (query.coords.norm() - self.0).abs() <= max_distance;
///         near.then(|| Match { point: (normal * self.0).into(), normal })
///     }
///     fn has_normals(&self) -> bool {
///         true
///     }
/// }
/// ```
pub trait Target: Sync {
    /// What is worth remembering of a query when the next is for the same point, a little farther.
    type Memory: Default + Send;

    /// The point closest to `query` within `max_distance` \[m\]. `memory`, of the last query for the same source point,
    /// may only change how fast the answer is found. A match that is not finite makes the alignment so.
    fn closest(
        &self,
        query: &Point3<f64>,
        max_distance: f64,
        memory: &mut Self::Memory,
    ) -> Option<Match>;

    /// Whether matches have normals.
    fn has_normals(&self) -> bool;
}

/// A point cloud to align to, with its normals if it has some.
#[derive(Clone, Debug)]
pub struct CloudTarget {
    tree: KdTree,
    normals: Option<Vec<Vector3<f64>>>,
}

impl CloudTarget {
    /// Prepares the search.
    ///
    /// # Errors
    /// [`IcpError::Cloud`] for a cloud that is not finite or whose normals are not one a point.
    pub fn new(cloud: &PointCloud) -> Result<Self, IcpError> {
        cloud.check()?;
        Ok(Self { tree: KdTree::new(&cloud.points)?, normals: cloud.normals.clone() })
    }
}

/// An answer of a [`CloudTarget`], and how far from there it holds.
#[derive(Clone, Copy, Debug, Default)]
pub struct MatchCache {
    nearest: Option<usize>,
    query: Point3<f64>,
    /// No other point is nearer to `query` than this \[m\].
    others: f64,
}

impl MatchCache {
    /// Whether the nearest point, `point`, is still that of `query`: by the triangle inequality no other can be
    /// nearer before the two ways, of the query and to the point, add up to the distance of the others.
    #[inline]
    fn holds(&self, query: &Point3<f64>, point: &Point3<f64>, max_distance: f64) -> bool {
        let distance = (query - point).norm();
        // A margin for rounding.
        let ways = (distance + (query - self.query).norm()) * (1.0 + 1e-9);
        ways < self.others && distance <= max_distance
    }
}

impl Target for CloudTarget {
    type Memory = MatchCache;

    #[inline]
    fn closest(
        &self,
        query: &Point3<f64>,
        max_distance: f64,
        memory: &mut MatchCache,
    ) -> Option<Match> {
        let points = self.tree.points();
        let index = match memory.nearest {
            Some(last) if memory.holds(query, &points[last], max_distance) => last,
            last => {
                let found = self.tree.nearest_and_next(query, max_distance, last);
                let (nearest, others) = found.map(|(n, d2)| (n.index, d2.sqrt())).unzip();
                *memory = MatchCache { nearest, query: *query, others: others.unwrap_or(0.0) };
                nearest?
            }
        };
        let normal = self.normals.as_ref().map_or_else(Vector3::zeros, |n| n[index]);
        Some(Match { point: points[index], normal })
    }

    fn has_normals(&self) -> bool {
        self.normals.is_some()
    }
}

/// A triangle mesh to align to: the closest point of its surface, and the normal of the face it lies on.
#[derive(Clone, Debug)]
pub struct MeshTarget {
    surface: ClosestPoints,
    normals: Vec<Vector3<f64>>,
}

impl MeshTarget {
    /// Prepares the search.
    ///
    /// # Errors
    /// [`IcpError::Mesh`] as [`ClosestPoints::new`] says.
    pub fn new(mesh: &TriMesh) -> Result<Self, IcpError> {
        let surface = ClosestPoints::new(mesh)?;
        let unit = |f| mesh.area_vector(f).try_normalize(0.0).unwrap_or_else(Vector3::zeros);
        Ok(Self { surface, normals: (0..mesh.faces.len()).map(unit).collect() })
    }
}

impl Target for MeshTarget {
    /// The face found last.
    type Memory = Option<u32>;

    #[inline]
    fn closest(
        &self,
        query: &Point3<f64>,
        max_distance: f64,
        memory: &mut Option<u32>,
    ) -> Option<Match> {
        let found = match *memory {
            Some(face) => self.surface.closest_with_hint(query, max_distance, face)?,
            None => self.surface.closest(query, max_distance)?,
        };
        *memory = Some(found.face);
        Some(Match { point: found.point, normal: self.normals[found.face as usize] })
    }

    fn has_normals(&self) -> bool {
        true
    }
}
