//! The cheap score of a hypothesis and the cheap steps that lower it.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3, Vector6};
use prehend_autodiff::Quadratic;
use prehend_autodiff::lie::{perturb_about, twist_row};
use prehend_geometry::RobustKernel;

use super::SearchSettings;
use super::distance_lattice::DistanceLattice;
use super::evidence::SearchEvidence;
use crate::scene::Object;

/// An object and what is known of where it is.
pub(super) struct CoarseScorer<'a> {
    pub(super) object: &'a Object,
    pub(super) lattice: &'a DistanceLattice,
    pub(super) evidence: &'a SearchEvidence,
    pub(super) settings: &'a SearchSettings,
}

impl CoarseScorer<'_> {
    /// Where the object is in view with the rotation `rotation` if the mean of what faces the camera is at the mean of
    /// the depth points.
    pub(super) fn centered(&self, rotation: &UnitQuaternion<f64>) -> Isometry3<f64> {
        let points = &self.evidence.points;
        let mean = points.iter().map(|(p, _)| p.coords).sum::<Vector3<f64>>() / points.len() as f64;
        let towards = -mean.normalize();
        let (mut sum, mut weight) = (Vector3::zeros(), f64::MIN_POSITIVE);
        for sample in self.object.samples.iter().step_by(7) {
            // Surface counts by the pixels it fills.
            let facing = (rotation * sample.normal).dot(&towards).max(0.0);
            sum += (rotation * sample.point.coords) * facing;
            weight += facing;
        }
        Isometry3::from_parts((mean - sum / weight).into(), *rotation)
    }

    /// How badly the pose fits: 0 not at all, 1 and more for one that has nothing to do with what is seen. `points` depth points and as
    /// many surface samples are looked at. A radian between normals counts as the scale of distances.
    pub(super) fn score(&self, pose: &Isometry3<f64>, points: usize) -> f64 {
        let loss = |r: f64| (r / self.settings.scale).powi(2).min(1.0);
        let inverse = pose.inverse();
        let distance = |p: &Point3<f64>| self.lattice.sample(&(inverse * p)).0;
        let depth = mean(self.evidence.points.iter().take(points).map(|(p, normal)| {
            let (distance, gradient) = self.lattice.sample(&(inverse * p));
            let mismatch = match *normal == Vector3::zeros() {
                true => 0.0,
                false => (pose.rotation * gradient - normal).norm() * self.settings.scale,
            };
            loss(distance.hypot(mismatch))
        }));
        let samples = &self.object.samples;
        let facing = samples.iter().step_by((samples.len() / (2 * points).max(1)).max(1));
        let sight = mean(facing.filter_map(|sample| {
            let (p, n) = (pose * sample.point, pose.rotation * sample.normal);
            (n.dot(&p.coords) < 0.0).then(|| loss(self.evidence.map.conflict(&p)))
        }));
        let touched = self.evidence.touched.iter();
        let touch = mean(touched.map(|p| loss(distance(p))));
        let stride = self.evidence.outside.len().div_ceil((2 * points).max(1)).max(1);
        let outside = self.evidence.outside.iter().step_by(stride);
        let outside = mean(outside.map(|p| loss(distance(p).min(0.0))));
        depth + sight + touch + outside
    }

    /// `pose` after `steps` robust Gauss–Newton steps of the distances of `points` depth points and the touched
    /// taxels from the surface, and of the hand's points inside it; with the rotation held if `slide`.
    pub(super) fn settle(
        &self,
        pose: &Isometry3<f64>,
        points: usize,
        steps: usize,
        slide: bool,
    ) -> Isometry3<f64> {
        // Radians count by how far they move the surface.
        let turn = if slide { 0.0 } else { 1.0 / self.object.radius };
        let units = Vector6::new(1.0, 1.0, 1.0, turn, turn, turn);
        let mut pose = *pose;
        for _ in 0..steps {
            let center = (pose * self.object.center).coords;
            let equations = self.equations(&pose, &center, points);
            let step =
                equations.in_units(&units).damped_step(self.settings.damping).component_mul(&units);
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
    ) -> Quadratic<6> {
        let kernel = RobustKernel::Cauchy { scale: self.settings.scale };
        let inverse = pose.inverse();
        let mut sum = Quadratic::zeros();
        let mut add = |p: &Point3<f64>, share: f64, inside_only: bool| {
            let (distance, g) = self.lattice.sample(&(inverse * p));
            if inside_only && distance >= 0.0 {
                return;
            }
            // The surface moves with the object: the distance of a fixed point changes the other way.
            let row = twist_row(&(p.coords - center), &-(pose.rotation * g));
            sum.add_row(&row, distance, share * kernel.weight(distance * distance));
        };
        let evidence = self.evidence;
        let used = evidence.points.len().min(points);
        let share = |count: usize| 1.0 / count.max(1) as f64;
        evidence.points[..used].iter().for_each(|(p, _)| add(p, share(used), false));
        let touched = share(evidence.touched.len());
        evidence.touched.iter().for_each(|p| add(p, touched, false));
        let stride = evidence.outside.len().div_ceil(points).max(1);
        let outside = evidence.outside.iter().step_by(stride);
        let weight = share(outside.len());
        outside.for_each(|p| add(p, weight, true));
        sum
    }
}

/// The mean, 0 of nothing.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
    sum / f64::max(count, 1.0)
}
