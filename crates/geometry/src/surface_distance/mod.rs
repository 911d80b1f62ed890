//! The two-way distance between a mesh and a point cloud, with its derivatives.

mod pair;
mod pose;

use nalgebra::{Isometry3, Point3, Vector3};
use rayon::prelude::*;

use self::pair::Pair;
pub use self::pose::PoseDerivatives;
use crate::closest::ClosestError;
use crate::closest::triangle::Triangle;
use crate::cloud::CloudError;
use crate::{ClosestPoints, KdTree, RobustKernel, TriMesh};

/// Matches whose sums are formed one after the other: sums do not depend on the number of threads.
const CHUNK: usize = 512;

/// The distance 1/|P| Σ_p min_t d(p, t)² + 1/|T| Σ_t min_p d(p, t)² \[m²\] between the points P of a cloud and
/// the triangles T of a mesh, d being the distance of a point to the nearest point of a triangle.
///
/// Equation 2 of the method this project implements. It is continuous in the pose of the mesh and in its vertices,
/// and differentiable wherever each point has one nearest triangle and each triangle one nearest point; elsewhere
/// the derivatives are those of one of the nearest. A [`RobustKernel`] other than the squared one replaces d² by twice
/// its loss, so that outliers of either side count less.
///
/// ```
/// use nalgebra::{Isometry3, Point3, Vector3};
/// use prehend_geometry::{SurfaceDistance, shapes::cuboid};
///
/// let mesh = cuboid(Vector3::repeat(2.0));
/// let distance = SurfaceDistance::new(&mesh, &[Point3::new(4.0, 0.0, 0.0)])?;
/// // The point is 3 m from the box, which moves towards it: d(9)/dx = −6 for the point, and so on for the triangles.
/// let there = distance.pose_derivatives(&Isometry3::identity(), &Point3::origin());
/// assert!(there.gradient.x < -6.0);
/// # Ok::<(), prehend_geometry::surface_distance::SurfaceDistanceError>(())
/// ```
#[derive(Clone, Debug)]
pub struct SurfaceDistance {
    surface: ClosestPoints,
    vertices: Vec<Point3<f64>>,
    faces: Vec<[u32; 3]>,
    cloud: KdTree,
    /// The points of the cloud one near the other, so that a match is a good guess for the next.
    order: Vec<usize>,
    kernel: RobustKernel,
}

/// Why two things have no distance.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SurfaceDistanceError {
    /// A mesh that cannot be searched.
    #[error(transparent)]
    Mesh(#[from] ClosestError),
    /// A cloud that cannot be searched.
    #[error(transparent)]
    Cloud(#[from] CloudError),
    /// No point to be near.
    #[error("the cloud has no points")]
    NoPoints,
    /// A kernel without a scale.
    #[error("the scale of a kernel must be positive and finite, not {0}")]
    RobustKernel(f64),
}

impl SurfaceDistance {
    /// Prepares both searches: of the faces of `mesh`, in its own frame, and of the points `cloud` \[m\].
    ///
    /// # Errors
    /// [`SurfaceDistanceError`] for a mesh without faces, a cloud without points, or coordinates that are not finite.
    pub fn new(mesh: &TriMesh, cloud: &[Point3<f64>]) -> Result<Self, SurfaceDistanceError> {
        if cloud.is_empty() {
            return Err(SurfaceDistanceError::NoPoints);
        }
        let cloud = KdTree::new(cloud)?;
        Ok(Self {
            surface: ClosestPoints::new(mesh)?,
            vertices: mesh.vertices.clone(),
            faces: mesh.faces.clone(),
            order: cloud.order().collect(),
            cloud,
            kernel: RobustKernel::Squared,
        })
    }

    /// The same with twice the loss of `kernel` for each squared distance.
    ///
    /// # Errors
    /// [`SurfaceDistanceError::RobustKernel`] for a scale that is not positive and finite.
    pub fn with_kernel(self, kernel: RobustKernel) -> Result<Self, SurfaceDistanceError> {
        if !kernel.is_valid() {
            return Err(SurfaceDistanceError::RobustKernel(kernel.scale().unwrap_or(f64::NAN)));
        }
        Ok(Self { kernel, ..self })
    }

    /// The distance \[m²\] with the mesh at `t_cloud_mesh`; NaN for a pose that is not finite.
    pub fn value(&self, t_cloud_mesh: &Isometry3<f64>) -> f64 {
        let add = |sum: &mut f64, pair: &Pair, share: f64| *sum += share * self.loss(pair);
        self.sums(t_cloud_mesh, add).iter().sum()
    }

    /// The distance \[m²\] and its derivatives by a left twist of the mesh about `center` \[m\] (in the cloud's frame),
    /// with the mesh at `t_cloud_mesh`.
    pub fn pose_derivatives(
        &self,
        t_cloud_mesh: &Isometry3<f64>,
        center: &Point3<f64>,
    ) -> PoseDerivatives {
        let add = |sum: &mut PoseDerivatives, pair: &Pair, share: f64| {
            sum.add(pair, center, self.kernel, share);
        };
        let sums = self.sums(t_cloud_mesh, add);
        let mut total = PoseDerivatives::default();
        sums.iter().for_each(|sum| total.merge(sum));
        total
    }

    /// The distance \[m²\] with the mesh at `t_cloud_mesh`, and its gradient by each vertex \[m\], in the mesh's frame.
    pub fn vertex_gradient(&self, t_cloud_mesh: &Isometry3<f64>) -> (f64, Vec<Vector3<f64>>) {
        let sums = self.sums(t_cloud_mesh, |rows: &mut Vec<_>, pair, share| {
            // The nearest point of the triangle moves as its corners do, weighted by their barycentric coordinates.
            let offset = pair.offset();
            let pull = offset * (-2.0 * share * self.kernel.weight(offset.norm_squared()));
            rows.push((share * self.loss(pair), pair.face, pair.barycentric, pull));
        });
        let (mut value, mut gradient) = (0.0, vec![Vector3::zeros(); self.vertices.len()]);
        for (loss, face, barycentric, pull) in sums.into_iter().flatten() {
            value += loss;
            let pull = t_cloud_mesh.rotation.inverse() * pull;
            for (&v, b) in self.faces[face as usize].iter().zip(barycentric) {
                gradient[v as usize] += pull * b;
            }
        }
        (value, gradient)
    }

    fn loss(&self, pair: &Pair) -> f64 {
        2.0 * self.kernel.loss(pair.offset().norm_squared())
    }

    /// `add` of every match and its share of the whole, summed over fixed pieces in parallel.
    fn sums<A: Default + Send>(
        &self,
        t_cloud_mesh: &Isometry3<f64>,
        add: impl Fn(&mut A, &Pair, f64) + Sync,
    ) -> Vec<A> {
        let (points, faces) = (self.cloud.points(), &self.faces);
        let t_mesh_cloud = t_cloud_mesh.inverse();
        let pieces =
            |n: usize| (0..n).into_par_iter().step_by(CHUNK).map(move |i| i..n.min(i + CHUNK));
        let of_points = pieces(points.len()).map(|piece| {
            let (mut sum, mut last) = (A::default(), 0);
            for &i in &self.order[piece] {
                let local = t_mesh_cloud * points[i];
                let found = self.surface.closest_with_hint(&local, f64::INFINITY, last);
                let pair = found.map_or(Pair::NOWHERE, |closest| {
                    last = closest.face;
                    Pair::new(self.corners(t_cloud_mesh, closest.face), &closest, points[i])
                });
                add(&mut sum, &pair, 1.0 / points.len() as f64);
            }
            sum
        });
        let of_faces = pieces(faces.len()).map(|piece| {
            let (mut sum, mut last) = (A::default(), None);
            for face in piece {
                let corners = self.corners(t_cloud_mesh, face as u32);
                let found = self.cloud.nearest_to_triangle(corners, f64::INFINITY, last);
                let pair = found.map_or(Pair::NOWHERE, |nearest| {
                    last = Some(nearest.index);
                    let point = points[nearest.index];
                    let foot = Triangle::new(corners, face as u32).closest(&point.coords);
                    Pair::of_foot(corners, face as u32, &foot, point)
                });
                add(&mut sum, &pair, 1.0 / faces.len() as f64);
            }
            sum
        });
        of_points.chain(of_faces).collect()
    }

    /// The corners of a face in the cloud's frame \[m\].
    fn corners(&self, t_cloud_mesh: &Isometry3<f64>, face: u32) -> [Point3<f64>; 3] {
        self.faces[face as usize].map(|v| t_cloud_mesh * self.vertices[v as usize])
    }
}

#[cfg(test)]
mod tests;
