//! Depth points of the hand on its surface: where the hand is in the camera, and how it bends.

use std::sync::Arc;

use nalgebra::{Vector2, Vector6};
use prehend_geometry::robot::RobotSample;
use prehend_render::DepthImage;
use rayon::prelude::*;

use super::Term;
use crate::{Block, Cauchy, Normal, Observation, Robot, State};

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
    robot: Arc<Robot>,
    points: Vec<(Vector2<f64>, f64)>,
    settings: HandDepthSettings,
}

impl HandDepthTerm {
    /// Takes the depth of `observation` near `hand`, the depth image of the hand alone. There may be none: the term
    /// is then zero.
    pub fn new(
        observation: &Observation,
        robot: Arc<Robot>,
        hand: &DepthImage,
        settings: HandDepthSettings,
    ) -> Self {
        let (depth, mask, camera) = (&observation.depth, &observation.mask, &observation.camera);
        let masked = |x: usize, y: usize| mask.get(x, y).unwrap_or(false);
        let at = |x: usize, y: usize| {
            let (measured, known) = (f64::from(depth.get(x, y)?), f64::from(hand.get(x, y)?));
            // Around the mask's outline the object may be what is seen.
            let near =
                [(0, 0), (MARGIN, 0), (0, MARGIN), (2 * MARGIN, MARGIN), (MARGIN, 2 * MARGIN)];
            let of_object = near.iter().any(|(dx, dy)| {
                masked((x + dx).saturating_sub(MARGIN), (y + dy).saturating_sub(MARGIN))
            });
            let of_hand =
                measured > 0.0 && known > 0.0 && (measured - known).abs() < settings.reach;
            (of_hand && !of_object && !masked(x, y))
                .then(|| (camera.unproject(x as f64, y as f64, 1.0).coords.xy(), measured))
        };
        let (width, height) = (depth.width(), depth.height());
        let all: Vec<_> =
            (0..height).flat_map(|y| (0..width).filter_map(move |x| at(x, y))).collect();
        let step = all.len().div_ceil(settings.points.max(1)).max(1);
        Self { robot, points: all.into_iter().step_by(step).collect(), settings }
    }

    /// Each point that is near the hand with what is known of its distance.
    fn samples(&self, state: &State) -> Vec<Option<(nalgebra::Point3<f64>, RobotSample)>> {
        let Ok(hand) = self.robot.articulated(&state.t_cam_hand, &state.joints) else {
            return Vec::new();
        };
        let reach = 2.0 * self.settings.reach;
        let sample = |(ray, depth): &(Vector2<f64>, f64)| {
            let point = state.camera.point(ray, *depth);
            Some((point, hand.sample_motion(&point, reach)?))
        };
        self.points.par_iter().with_min_len(32).map(sample).collect()
    }

    /// Nats of one square metre.
    fn share(&self) -> f64 {
        let count = self.points.len().max(1) as f64;
        (self.settings.effective_points / count).min(1.0) / self.settings.sigma.powi(2)
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

    fn linearise(&self, state: &State, normal: &mut Normal) -> f64 {
        let cauchy = Cauchy { scale: self.settings.outlier };
        let (share, centre) = (self.share(), state.centre());
        let mut value = 0.0;
        for (sample, (ray, depth)) in self.samples(state).iter().zip(&self.points) {
            value += self.loss(sample.as_ref().map(|(_, s)| s.field.distance));
            let Some((point, sample)) = sample else { continue };
            let (distance, n) = (sample.field.distance, sample.field.gradient);
            let turn = (point.coords - centre).cross(&n);
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
