//! Iterative closest points: aligns a cloud to another or to a mesh.
//!
//! ```
//! use nalgebra::{Isometry3, Vector3};
//! use prehend_geometry::icp::{IcpSettings, MeshTarget, align};
//! use prehend_geometry::{sample::surface_samples, shapes::cuboid};
//!
//! let mesh = cuboid(Vector3::new(0.04, 0.06, 0.1));
//! let seen: Vec<_> = surface_samples(&mesh, 500, 1).iter().map(|s| s.point).collect();
//! let start = Isometry3::new(Vector3::new(2e-3, -1e-3, 1e-3), Vector3::new(0.02, 0.03, -0.05));
//! let found = align(&seen, &MeshTarget::new(&mesh)?, &start, &IcpSettings::default())?;
//! assert!(found.converged && found.t_target_source.translation.vector.norm() < 1e-6);
//! # Ok::<(), prehend_geometry::icp::IcpError>(())
//! ```

mod degeneracy;
mod normal_equations;
mod target;

use nalgebra::{Isometry3, Point3, Vector3, Vector6};
use prehend_autodiff::lie::perturb_about;
use rayon::prelude::*;

pub use self::degeneracy::Degeneracy;
pub use self::normal_equations::{Metric, NormalEquations};
pub use self::target::{CloudTarget, Match, MatchCache, MeshTarget, Target};
use crate::closest::ClosestError;
use crate::cloud::{CloudError, KdTree};
use crate::robust::RobustKernel;

/// Source points whose sums are formed one after the other: sums do not depend on the number of threads.
const CHUNK: usize = 1024;

/// Settings of [`align`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IcpSettings {
    /// Which distance of a match counts.
    pub metric: Metric,
    /// How large residuals are forgiven.
    pub kernel: RobustKernel,
    /// Points farther from the target count for nothing \[m\]; may be infinite.
    pub max_distance: f64,
    /// Steps taken at most; none evaluates the initial pose.
    pub max_iterations: usize,
    /// Converged once a step moves the source's center by no more than this \[m\] …
    pub translation_tolerance: f64,
    /// … and turns it by no more than this \[rad\].
    pub rotation_tolerance: f64,
    /// Eigenvalue of [`Degeneracy`] below which a direction counts as undetermined and no step goes along it.
    pub least_eigenvalue: f64,
}

impl Default for IcpSettings {
    fn default() -> Self {
        Self {
            metric: Metric::PointToPlane,
            kernel: RobustKernel::Squared,
            max_distance: 0.02,
            max_iterations: 50,
            translation_tolerance: 1e-6,
            rotation_tolerance: 1e-5,
            least_eigenvalue: 1e-4,
        }
    }
}

/// Where a source came to rest, and how well.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alignment {
    /// Maps the source's coordinates into the target's frame.
    pub t_target_source: Isometry3<f64>,
    /// Steps taken.
    pub iterations: usize,
    /// Whether the last step was within the tolerances.
    pub converged: bool,
    /// Root mean square residual of the inliers at that pose \[m\].
    pub rms: f64,
    /// Sum of the robust losses of all matches at that pose \[m²\].
    pub cost: f64,
    /// Points within the maximum distance whose weight is not zero.
    pub inliers: usize,
    /// Which motions the matches at that pose determine.
    pub degeneracy: Degeneracy,
}

/// Why an alignment cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum IcpError {
    /// A cloud that cannot be searched.
    #[error(transparent)]
    Cloud(#[from] CloudError),
    /// A mesh that cannot be searched.
    #[error(transparent)]
    Mesh(#[from] ClosestError),
    /// Point-to-plane without planes.
    #[error("point-to-plane needs a target with normals")]
    NoNormals,
    /// No point near the target.
    #[error(
        "none of {points} source points has a match within {max_distance} m after {iteration} steps"
    )]
    NoMatches {
        /// Points of the source.
        points: usize,
        /// The limit \[m\].
        max_distance: f64,
        /// Steps taken until then.
        iteration: usize,
    },
    /// A setting out of range.
    #[error("{name} must not be {value}")]
    Setting {
        /// The field of [`IcpSettings`], or `t_target_source`.
        name: &'static str,
        /// Its value.
        value: f64,
    },
}

/// Aligns the points `source` \[m\] to `target`, from `t_target_source`.
///
/// Each step matches every point with the closest of the target and makes one Gauss–Newton step of the robust
/// least-squares problem, by a left twist about the center of the source. The result is the same to the last bit
/// for any number of threads.
///
/// # Errors
/// [`IcpError`] for bad input, or where no point comes within the maximum distance of the target.
pub fn align(
    source: &[Point3<f64>],
    target: &impl Target,
    t_target_source: &Isometry3<f64>,
    settings: &IcpSettings,
) -> Result<Alignment, IcpError> {
    check(settings, t_target_source)?;
    if settings.metric == Metric::PointToPlane && !target.has_normals() {
        return Err(IcpError::NoNormals);
    }
    let mut problem = Problem::new(source, target, settings)?;
    let mut pose = *t_target_source;
    let (mut iterations, mut converged) = (0, false);
    loop {
        let (equations, degeneracy) = problem.linearize(&pose, iterations)?;
        if converged || iterations == settings.max_iterations {
            return Ok(Alignment {
                t_target_source: pose,
                iterations,
                converged,
                rms: equations.rms(),
                cost: equations.quadratic.value,
                inliers: equations.inliers,
                degeneracy,
            });
        }
        let step = degeneracy.step(&equations, settings.least_eigenvalue);
        pose = perturb_about(&pose, &degeneracy.center.coords, &step);
        pose.rotation.renormalize();
        iterations += 1;
        converged = is_small(&step, settings);
    }
}

struct Problem<'a, T: Target> {
    target: &'a T,
    settings: &'a IcpSettings,
    /// Source points with what the target remembers of them, in an order in which neighbors follow each other.
    points: Vec<(Point3<f64>, T::Memory)>,
    center: Point3<f64>,
    length: f64,
}

impl<'a, T: Target> Problem<'a, T> {
    fn new(
        source: &[Point3<f64>],
        target: &'a T,
        settings: &'a IcpSettings,
    ) -> Result<Self, IcpError> {
        let order = KdTree::new(source)?;
        let count = source.len().max(1) as f64;
        let center = Point3::from(source.iter().map(|p| p.coords).sum::<Vector3<f64>>() / count);
        let square: f64 = source.iter().map(|p| (p - center).norm_squared()).sum();
        let points = order.order().map(|i| (source[i], T::Memory::default())).collect();
        Ok(Self { target, settings, points, center, length: (square / count).sqrt() })
    }

    /// Matches the points at `pose` and sums their equations.
    fn linearize(
        &mut self,
        pose: &Isometry3<f64>,
        iteration: usize,
    ) -> Result<(NormalEquations, Degeneracy), IcpError> {
        let IcpSettings { metric, kernel, max_distance, .. } = *self.settings;
        let (target, center) = (self.target, pose * self.center);
        let rotation = pose.rotation.to_rotation_matrix();
        let of_chunk = |chunk: &mut [(Point3<f64>, T::Memory)]| {
            let mut sums = NormalEquations::new();
            for (point, memory) in chunk {
                let moved = rotation * *point + pose.translation.vector;
                let Some(found) = target.closest(&moved, max_distance, memory) else { continue };
                sums.add(metric, kernel, &moved, &found, &center);
            }
            sums
        };
        let chunks: Vec<_> = self.points.par_chunks_mut(CHUNK).map(of_chunk).collect();
        let mut equations = NormalEquations::new();
        chunks.iter().for_each(|sums| equations.merge(sums));
        if equations.inliers == 0 {
            return Err(IcpError::NoMatches { points: self.points.len(), max_distance, iteration });
        }
        let degeneracy = Degeneracy::new(&equations, center, self.length);
        Ok((equations, degeneracy))
    }
}

fn is_small(step: &Vector6<f64>, settings: &IcpSettings) -> bool {
    step.fixed_rows::<3>(0).norm() <= settings.translation_tolerance
        && step.fixed_rows::<3>(3).norm() <= settings.rotation_tolerance
}

fn check(settings: &IcpSettings, pose: &Isometry3<f64>) -> Result<(), IcpError> {
    let numbers = [
        ("max_distance", settings.max_distance),
        ("translation_tolerance", settings.translation_tolerance),
        ("rotation_tolerance", settings.rotation_tolerance),
        ("least_eigenvalue", settings.least_eigenvalue),
    ];
    if let Some(&(name, value)) = numbers.iter().find(|(_, v)| v.is_nan() || *v < 0.0) {
        return Err(IcpError::Setting { name, value });
    }
    if !settings.kernel.is_valid() {
        let value = settings.kernel.scale().unwrap_or(f64::NAN);
        return Err(IcpError::Setting { name: "kernel", value });
    }
    let mut entries = pose.translation.vector.iter().chain(pose.rotation.coords.iter());
    match entries.find(|x| !x.is_finite()) {
        Some(&value) => Err(IcpError::Setting { name: "t_target_source", value }),
        None => Ok(()),
    }
}
