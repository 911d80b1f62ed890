//! The cheap score of a hypothesis and the cheap steps that lower it.

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, UnitQuaternion, Vector3, Vector6};
use prehend_autodiff::lie::perturb_about;
use prehend_geometry::RobustKernel;

use super::evidence::Evidence;
use super::lattice::DistanceLattice;
use crate::scene::Object;

/// What a mismatch of normals by one radian counts as \[m\].
const NORMAL_LENGTH: f64 = 10e-3;
/// A touched taxel may be this far from the surface, for a contact spreads over those around it \[m\].
const TOUCH_SLACK: f64 = 2e-3;
/// What counts, against the depth points: the object's own surface where it could be seen, …
const SIGHT_WEIGHT: f64 = 1.0;
/// … touched taxels, …
const TOUCH_WEIGHT: f64 = 0.3;
/// … and the hand inside the object.
const OUTSIDE_WEIGHT: f64 = 2.0;

/// An object and what is known of where it is.
pub(super) struct CoarseScorer<'a> {
    pub(super) object: &'a Object,
    pub(super) lattice: &'a DistanceLattice,
    pub(super) evidence: &'a Evidence,
}

impl CoarseScorer<'_> {
    /// Where the object is in view with the rotation `rotation` if the mean of what faces the camera is at the mean of
    /// the depth points.
    pub(super) fn centered(&self, rotation: &UnitQuaternion<f64>) -> Isometry3<f64> {
        let points = &self.evidence.points;
        let mean = points.iter().map(|(p, _)| p.coords).sum::<Vector3<f64>>() / points.len() as f64;
        let towards = -mean.normalize();
        let (mut sum, mut weight) = (Vector3::zeros(), 1e-12);
        for sample in self.object.samples.iter().step_by(7) {
            // Surface counts by the pixels it fills.
            let facing = (rotation * sample.normal).dot(&towards).max(0.0);
            sum += (rotation * sample.point.coords) * facing;
            weight += facing;
        }
        Isometry3::from_parts((mean - sum / weight).into(), *rotation)
    }

    /// How badly the pose fits: 0 not at all, 1 and more for one that has nothing to do with what is seen. Residuals
    /// beyond `scale` \[m\] all count alike. `points` depth points and as many surface samples are looked at.
    pub(super) fn score(&self, pose: &Isometry3<f64>, points: usize, scale: f64) -> f64 {
        let loss = |r: f64| (r / scale).powi(2).min(1.0);
        let inverse = pose.inverse();
        let distance = |p: &Point3<f64>| self.lattice.sample(&(inverse * p)).0;
        let depth = mean(self.evidence.points.iter().take(points).map(|(p, normal)| {
            let (distance, gradient) = self.lattice.sample(&(inverse * p));
            let mismatch = match *normal == Vector3::zeros() {
                true => 0.0,
                false => (pose.rotation * gradient - normal).norm() * NORMAL_LENGTH,
            };
            loss(distance.hypot(mismatch))
        }));
        let samples = &self.object.samples;
        let facing = samples.iter().step_by((samples.len() / (2 * points).max(1)).max(1));
        let sight = mean(facing.filter_map(|sample| {
            let (p, n) = (pose * sample.point, pose.rotation * sample.normal);
            let faces = n.dot(&p.coords) < -0.2 * p.coords.norm();
            faces.then(|| loss(self.evidence.map.conflict(&p)))
        }));
        let touched = self.evidence.touched.iter();
        let touch = mean(touched.map(|p| loss((distance(p).abs() - TOUCH_SLACK).max(0.0))));
        let stride = self.evidence.outside.len().div_ceil((2 * points).max(1)).max(1);
        let outside = self.evidence.outside.iter().step_by(stride);
        let outside = mean(outside.map(|p| loss(distance(p).min(0.0))));
        depth + SIGHT_WEIGHT * sight + TOUCH_WEIGHT * touch + OUTSIDE_WEIGHT * outside
    }

    /// `pose` after `steps` robust Gauss–Newton steps of the distances of `points` depth points and the touched
    /// taxels from the surface, and of the hand's points inside it; with the rotation held if `slide`.
    pub(super) fn settle(
        &self,
        pose: &Isometry3<f64>,
        points: usize,
        scale: f64,
        steps: usize,
        slide: bool,
    ) -> Isometry3<f64> {
        let mut pose = *pose;
        for _ in 0..steps {
            let center = (pose * self.object.center).coords;
            let (gradient, matrix) = self.equations(&pose, &center, points, scale, slide);
            let mut step = Vector6::zeros();
            if slide {
                let matrix: Matrix3<f64> = matrix.fixed_view::<3, 3>(0, 0).into_owned();
                let damping = Matrix3::identity() * (1e-2 * matrix.trace() + f64::MIN_POSITIVE);
                if let Some(factor) = (matrix + damping).cholesky() {
                    let g: Vector3<f64> = gradient.fixed_rows::<3>(0).into_owned();
                    step.fixed_rows_mut::<3>(0).copy_from(&-factor.solve(&g));
                }
            } else {
                // Radians count by how far they move the surface.
                let r = self.object.radius;
                let unit = Vector6::new(1.0, 1.0, 1.0, 1.0 / r, 1.0 / r, 1.0 / r);
                let matrix = Matrix6::from_fn(|i, j| unit[i] * matrix[(i, j)] * unit[j]);
                let damping = Matrix6::identity() * (2e-3 * matrix.trace() + f64::MIN_POSITIVE);
                if let Some(factor) = (matrix + damping).cholesky() {
                    step = -factor.solve(&gradient.component_mul(&unit)).component_mul(&unit);
                }
            }
            if !step.iter().all(|x| x.is_finite()) {
                break;
            }
            pose = perturb_about(&pose, &center, &step);
            pose.rotation.renormalize();
        }
        pose
    }

    fn equations(
        &self,
        pose: &Isometry3<f64>,
        center: &Vector3<f64>,
        points: usize,
        scale: f64,
        slide: bool,
    ) -> (Vector6<f64>, Matrix6<f64>) {
        let kernel = RobustKernel::Cauchy { scale };
        let inverse = pose.inverse();
        let (mut gradient, mut matrix) = (Vector6::zeros(), Matrix6::zeros());
        let mut add = |p: &Point3<f64>, share: f64, inside_only: bool| {
            let (distance, g) = self.lattice.sample(&(inverse * p));
            if inside_only && distance >= 0.0 {
                return;
            }
            // The surface moves with the object: the distance of a fixed point changes the other way.
            let n = -(pose.rotation * g);
            let w = share * kernel.weight(distance * distance);
            let turn = if slide { Vector3::zeros() } else { (p.coords - center).cross(&n) };
            let row = Vector6::new(n.x, n.y, n.z, turn.x, turn.y, turn.z);
            gradient += row * (w * distance);
            for (i, mut column) in matrix.column_iter_mut().enumerate() {
                column += row * (w * row[i]);
            }
        };
        let evidence = self.evidence;
        let used = evidence.points.len().min(points);
        let share = |weight: f64, count: usize| weight / count.max(1) as f64;
        evidence.points[..used].iter().for_each(|(p, _)| add(p, share(1.0, used), false));
        let touched = share(TOUCH_WEIGHT, evidence.touched.len());
        evidence.touched.iter().for_each(|p| add(p, touched, false));
        let outside =
            evidence.outside.iter().step_by(evidence.outside.len().div_ceil(points.max(1)).max(1));
        let weight = share(OUTSIDE_WEIGHT, points.min(evidence.outside.len()));
        outside.for_each(|p| add(p, weight, true));
        (gradient, matrix)
    }
}

/// The mean, 0 of nothing.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
    sum / f64::max(count, 1.0)
}
