//! Depth points of the hand on its surface: where the hand is in the camera, and how it bends.

use std::sync::Arc;

use nalgebra::{Vector2, Vector6};
use prehend_geometry::robot::RobotSample;
use prehend_render::DepthImage;
use rayon::prelude::*;

use super::{Term, share};
use crate::problem::{Block, Cauchy, Normal, State};
use crate::scene::{Hand, Observation};

/// Settings of [`HandDepthTerm`].
#[derive(Clone, Debug, PartialEq)]
pub struct HandDepthSettings {
    /// Depth points used at most, spread evenly over the hand.
    pub points: usize,
    /// Standard deviation of a depth point from the hand \[m\].
    pub sigma: f64,
    /// Distance at which a point counts as an outlier \[m\].
    pub outlier: f64,
    /// How far a depth point may be from where the hand is said to be \[m\]: beyond, it is of something else.
    pub reach: f64,
    /// How many independent measurements the points amount to at most.
    pub effective_points: f64,
}

impl Default for HandDepthSettings {
    fn default() -> Self {
        Self { points: 500, sigma: 1e-3, outlier: 3e-3, reach: 15e-3, effective_points: 60.0 }
    }
}

/// Distances from the depth points on the hand, outside of the object's mask, to the hand's surface.
///
/// What the camera sees of the hand says where it is relative to the object in the same image, which is what touch
/// needs to know, whatever depth's common errors are.
pub struct HandDepthTerm {
    robot: Arc<Hand>,
    points: Vec<(Vector2<f64>, f64)>,
    settings: HandDepthSettings,
}

impl HandDepthTerm {
    /// Takes the depth of `observation` near `hand`, the depth image of the hand alone. There may be none: the term
    /// is then zero.
    pub fn new(
        observation: &Observation,
        robot: Arc<Hand>,
        hand: &DepthImage,
        settings: HandDepthSettings,
    ) -> Self {
        let (depth, camera) = (&observation.depth, &observation.camera);
        let mask = observation.mask.pixels();
        let width = depth.width();
        let on_hand: Vec<usize> = (depth.pixels().iter().zip(hand.pixels()).enumerate())
            .filter(|(_, (measured, known))| {
                **measured > 0.0
                    && **known > 0.0
                    && f64::from(**measured - **known).abs() < settings.reach
            })
            .map(|(pixel, _)| pixel)
            .collect();
        // Around the mask's outline the object may be what is seen.
        let of_object = |pixel: usize| {
            let near = [0, MARGIN, MARGIN * width];
            near.iter().any(|step| {
                let (before, after) = (pixel.checked_sub(*step), mask.get(pixel + step));
                before.is_some_and(|p| mask[p]) || after.is_some_and(|m| *m)
            })
        };
        let of_hand: Vec<usize> = on_hand.into_iter().filter(|p| !of_object(*p)).collect();
        let step = of_hand.len().div_ceil(settings.points.max(1)).max(1);
        let point = |&pixel: &usize| {
            let (x, y) = ((pixel % width) as f64, (pixel / width) as f64);
            (camera.unproject(x, y, 1.0).coords.xy(), f64::from(depth.pixels()[pixel]))
        };
        let points = of_hand.iter().step_by(step).map(point).collect();
        Self { robot, points, settings }
    }

    /// Each point that is near the hand with what is known of its distance.
    fn samples(&self, state: &State) -> Vec<Option<(nalgebra::Point3<f64>, RobotSample)>> {
        let Ok(hand) = self.robot.articulated(&state.t_cam_hand, &state.joints) else {
            return Vec::new();
        };
        let reach = 2.0 * self.settings.reach;
        let sample = |(ray, depth): &(Vector2<f64>, f64)| {
            let point = state.camera.point(ray, *depth);
            Some((point, hand.distance_with_gradient(&point, reach)?))
        };
        self.points.par_iter().with_min_len(32).map(sample).collect()
    }

    /// Nats of one square meter.
    fn share(&self) -> f64 {
        let count = self.points.len().max(1) as f64;
        share(self.settings.effective_points, count, self.settings.sigma)
    }

    /// Loss of a sample; points out of reach are as bad as those at its end.
    fn loss(&self, distance: Option<f64>) -> f64 {
        let cauchy = Cauchy { scale: self.settings.outlier };
        cauchy.loss(distance.unwrap_or(2.0 * self.settings.reach).powi(2))
    }
}

/// Pixels around the object's mask that are not taken for the hand.
const MARGIN: usize = 3;

impl Term for HandDepthTerm {
    fn name(&self) -> &'static str {
        "hand-depth"
    }

    fn value(&self, state: &State) -> f64 {
        let samples = self.samples(state);
        let losses = samples.iter().map(|s| self.loss(s.as_ref().map(|(_, s)| s.field.distance)));
        self.share() * losses.sum::<f64>()
    }

    fn linearize(&self, state: &State, normal: &mut Normal) -> f64 {
        let cauchy = Cauchy { scale: self.settings.outlier };
        let (share, center) = (self.share(), state.center());
        let mut value = 0.0;
        for (sample, (ray, depth)) in self.samples(state).iter().zip(&self.points) {
            value += self.loss(sample.as_ref().map(|(_, s)| s.field.distance));
            let Some((point, sample)) = sample else { continue };
            let (distance, n) = (sample.field.distance, sample.field.gradient);
            let turn = (point.coords - center).cross(&n);
            let hand = -Vector6::new(n.x, n.y, n.z, turn.x, turn.y, turn.z);
            let camera = state.camera.point_jacobian(ray, *depth).tr_mul(&n);
            let weight = share * cauchy.weight(distance * distance);
            let row = [
                (Block::HandPose, hand.as_slice()),
                (Block::Joints(state.joints.len()), sample.joints.as_slice()),
                (Block::Camera, camera.as_slice()),
            ];
            normal.add_row(&row, distance, weight);
        }
        share * value
    }
}

#[cfg(test)]
mod tests {
    use super::super::gradient_check::{assert_gradient, fixture};
    use super::*;

    #[test]
    fn gradients_match_differences() {
        for seed in 0..3 {
            let (scene, mut state, hand) = fixture(seed);
            state.camera = state.camera.changed(&[2e-3, 1e-3, 1e-3, -1e-3, 2e-3]);
            state.joints.iter_mut().enumerate().for_each(|(i, q)| *q += 0.01 * (i as f64).sin());
            let term = HandDepthTerm::new(
                &scene.observation,
                Arc::clone(&scene.robot),
                &hand,
                HandDepthSettings::default(),
            );
            assert!(term.points.len() > 100);
            for block in [Block::HandPose, Block::Joints(16), Block::Camera] {
                assert_gradient(&term, &state, block, 1e-7, 0.02);
            }
        }
    }
}
