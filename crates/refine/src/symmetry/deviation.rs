//! Deviation of a surface from itself, turned.

use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};
use prehend_autodiff::Quadratic;
use prehend_geometry::closest::{ClosestError, ClosestPoints};
use prehend_geometry::sample::surface_samples;
use prehend_geometry::{SurfaceSample, TriMesh};

use super::paint::Paint;
use crate::defaults::settings;

settings! {
    /// Tolerances of symmetries.
    pub struct SymmetrySettings {
        /// Largest distance of the surface from where the symmetry has it, as a fraction of the diameter.
        pub tolerance: f64 = 0.025,
        /// The fraction of the surface that may lie farther off: dents and tabs of real objects.
        pub exempt: f64 = 0.01,
        /// Largest difference of the surface's mean color (0..=1, each patch blurred to the size of the tolerance), root
        /// mean square; `None` looks at the shape alone.
        pub color_tolerance: Option<f64> = None,
        /// Points of the surface that are compared.
        pub samples: usize = 1000,
    }
}

/// A surface, prepared for comparing it with itself.
pub(super) struct SampledSurface {
    surface: ClosestPoints,
    /// Points of the surface relative to its centroid, each with its unit normal.
    samples: Vec<(Vector3<f64>, Vector3<f64>)>,
    pub(super) center: Point3<f64>,
    /// Second moments of the surface about its centroid, per area \[m²\].
    moments: Matrix3<f64>,
    /// Largest distance of a point \[m\], and number of those that may lie farther.
    pub(super) tolerance: f64,
    exempt: usize,
    paint: Option<Paint>,
}

impl SampledSurface {
    pub(super) fn new(mesh: &TriMesh, settings: &SymmetrySettings) -> Result<Self, ClosestError> {
        let surface = ClosestPoints::new(mesh)?;
        let samples = surface_samples(mesh, settings.samples.max(1), 0);
        let (center, moments) = moments(mesh);
        let place = |s: &SurfaceSample| (s.point - center, s.normal);
        // Twice the largest distance from the centroid is the diameter of what is symmetric at all.
        let radius = mesh.vertices.iter().map(|v| (v - center).norm()).fold(0.0, f64::max);
        let tolerance = settings.tolerance * 2.0 * radius;
        let paint = settings.color_tolerance.and_then(|most| Paint::new(mesh, tolerance, most));
        let exempt = (settings.exempt * samples.len() as f64) as usize;
        let samples = samples.iter().map(place).collect();
        Ok(Self { surface, samples, center, moments, tolerance, exempt, paint })
    }

    /// Directions of the principal axes of the surface's second moments.
    pub(super) fn principal_axes(&self) -> Matrix3<f64> {
        self.moments.symmetric_eigen().eigenvectors
    }

    /// True of a `turn` that is a symmetry.
    pub(super) fn is_symmetric(&self, turn: &UnitQuaternion<f64>) -> bool {
        self.fits(turn, 1.0)
    }

    /// True if the surface is off by no more than `slack` tolerances.
    pub(super) fn fits(&self, turn: &UnitQuaternion<f64>, slack: f64) -> bool {
        let reach = slack * self.tolerance;
        let matrix = turn.to_rotation_matrix();
        let far = |(x, _): &&(Vector3<f64>, Vector3<f64>)| {
            self.surface.closest(&(self.center + matrix * x), reach).is_none()
        };
        self.samples.iter().filter(far).nth(self.exempt).is_none()
            && self.paint.as_ref().is_none_or(|paint| paint.fits(&self.center, &matrix))
    }

    /// The rotation nearest to `turn` at which every `stride`-th sample lies on the surface best, in the least-squares
    /// sense of point to plane; and their root-mean-square distance there \[m\].
    pub(super) fn drawn(
        &self,
        mut turn: UnitQuaternion<f64>,
        stride: usize,
        iterations: usize,
    ) -> (UnitQuaternion<f64>, f64) {
        let mut rms = f64::INFINITY;
        for _ in 0..iterations {
            let matrix = turn.to_rotation_matrix();
            let (equations, sum, count) = self.normal_equations(&matrix, stride);
            rms = (sum / f64::from(count.max(1))).sqrt();
            // Directions that the shape leaves free (the spin of a cylinder) must stay where they are.
            let step = equations.damped_step(3e-3);
            let length = step.norm();
            turn = UnitQuaternion::from_scaled_axis(step * (0.3 / length).min(1.0)) * turn;
            if length < 1e-4 {
                break;
            }
        }
        (turn, rms)
    }

    /// Point to plane by a rotation on the left, the sum of squared distances and the number of samples.
    fn normal_equations(&self, turn: &Rotation3<f64>, stride: usize) -> (Quadratic<3>, f64, u32) {
        let mut equations = Quadratic::zeros();
        let (mut sum, mut count) = (0.0, 0);
        for (x, normal) in self.samples.iter().step_by(stride) {
            let (arm, normal) = (turn * x, turn * normal);
            let Some(closest) = self.surface.closest(&(self.center + arm), f64::INFINITY) else {
                continue;
            };
            let residual = (self.center + arm - closest.point).dot(&normal);
            equations.add_row(&arm.cross(&normal), residual, 1.0);
            sum += closest.distance_squared();
            count += 1;
        }
        (equations, sum, count)
    }

    /// Change of the second moments by `turn`, relative to themselves.
    pub(super) fn moments_moved(&self, turn: &UnitQuaternion<f64>) -> f64 {
        let turn = turn.to_rotation_matrix();
        let moved = turn.matrix() * self.moments * turn.matrix().transpose();
        (moved - self.moments).norm() / self.moments.norm().max(f64::MIN_POSITIVE)
    }
}

/// Centroid \[m\] and second moments about it, per area \[m²\], of a surface.
fn moments(mesh: &TriMesh) -> (Point3<f64>, Matrix3<f64>) {
    let (mut area, mut first, mut second) = (0.0, Vector3::zeros(), Matrix3::zeros());
    for face in 0..mesh.faces.len() {
        let weight = 0.5 * mesh.area_vector(face).norm();
        let corners = mesh.triangle(face).map(|c| c.coords);
        let sum: Vector3<f64> = corners.iter().sum();
        area += weight;
        first += sum * (weight / 3.0);
        // ∫ x xᵀ over a triangle: area / 12 (Σ c cᵀ + (Σ c)(Σ c)ᵀ).
        let squares: Matrix3<f64> = corners.iter().map(|c| c * c.transpose()).sum();
        second += (squares + sum * sum.transpose()) * (weight / 12.0);
    }
    let area = f64::max(area, f64::MIN_POSITIVE);
    let center = first / area;
    (center.into(), second / area - center * center.transpose())
}
