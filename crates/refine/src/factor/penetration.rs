//! Non-penetration: two solids are not in the same place.

use std::sync::Arc;

use nalgebra::{Point3, Vector6};
use prehend_geometry::robot::{ArticulatedRobot, RobotSample};
use rayon::prelude::*;

use super::Term;
use crate::problem::{Block, Normal, State};
use crate::scene::{Hand, Object};

/// Settings of [`PenetrationTerm`].
#[derive(Clone, Debug, PartialEq)]
pub struct PenetrationSettings {
    /// Standard deviation of the depth to which a patch of [`area`](Self::area) is pressed in \[m\]: the compliance of
    /// skin and pads, and the errors of the models.
    pub sigma: f64,
    /// Area of a patch whose depth is independent of its neighbors' \[m²\].
    pub area: f64,
}

impl Default for PenetrationSettings {
    fn default() -> Self {
        Self { sigma: 5e-4, area: 1e-4 }
    }
}

/// Depths to which samples of the object's surface lie in the hand.
pub struct PenetrationTerm {
    object: Arc<Object>,
    robot: Arc<Hand>,
    settings: PenetrationSettings,
}

impl PenetrationTerm {
    /// A term for `object` in the hand `robot`.
    pub fn new(object: Arc<Object>, robot: Arc<Hand>, settings: PenetrationSettings) -> Self {
        Self { object, robot, settings }
    }

    /// The samples inside the hand, in the camera frame.
    fn inside(&self, state: &State) -> Vec<(Point3<f64>, RobotSample)> {
        let Ok(hand) = self.robot.articulated(&state.t_cam_hand, &state.joints) else {
            return Vec::new();
        };
        let deep = |point: &Point3<f64>, hand: &ArticulatedRobot| {
            let point = state.t_cam_object * point;
            let sample = hand.distance_with_gradient(&point, 0.0)?;
            (sample.field.distance < 0.0).then_some((point, sample))
        };
        let samples = self.object.samples.par_iter().with_min_len(128);
        samples.filter_map(|s| deep(&s.point, &hand)).collect()
    }

    /// Nats of one square meter of depth at one sample.
    fn share(&self) -> f64 {
        let area = self.object.area / self.object.samples.len().max(1) as f64;
        area / self.settings.area / self.settings.sigma.powi(2)
    }
}

impl Term for PenetrationTerm {
    fn name(&self) -> &'static str {
        "penetration"
    }

    fn value(&self, state: &State) -> f64 {
        let depths = self.inside(state);
        0.5 * self.share() * depths.iter().map(|(_, s)| s.field.distance.powi(2)).sum::<f64>()
    }

    fn linearize(&self, state: &State, normal: &mut Normal) -> f64 {
        let (share, center) = (self.share(), state.center());
        let mut value = 0.0;
        for (point, sample) in self.inside(state) {
            let (distance, n) = (sample.field.distance, sample.field.gradient);
            let turn = (point.coords - center).cross(&n);
            let object = Vector6::new(n.x, n.y, n.z, turn.x, turn.y, turn.z);
            let hand = -object;
            let row = [
                (Block::ObjectPose, object.as_slice()),
                (Block::HandPose, hand.as_slice()),
                (Block::Joints(state.joints.len()), sample.joints.as_slice()),
            ];
            normal.add_row(&row, distance, share);
            value += distance * distance;
        }
        0.5 * share * value
    }
}

#[cfg(test)]
mod tests {
    use super::super::gradient_check::{assert_gradient, fixture};
    use super::*;

    #[test]
    fn gradients_match_differences() {
        for seed in 0..3 {
            let (scene, state, _) = fixture(seed);
            let (object, robot) = (Arc::clone(&scene.object), Arc::clone(&scene.robot));
            let term = PenetrationTerm::new(object, robot, PenetrationSettings::default());
            assert!(term.value(&state) > 0.0, "nothing touches");
            for block in [Block::ObjectPose, Block::HandPose, Block::Joints(16)] {
                assert_gradient(&term, &state, block, 1e-7, 1e-3);
            }
        }
    }
}
