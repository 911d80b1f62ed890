//! Non-penetration: two solids are not in the same place.

use std::sync::Arc;

use nalgebra::Point3;
use prehend_geometry::robot::{ArticulatedRobot, RobotSample};
use rayon::prelude::*;

use crate::defaults::settings;
use crate::error::RefineError;
use crate::problem::{Block, Factor, NoiseModel, Rows, State, Weighting};
use crate::scene::{Hand, Object, PreparedFrame};

settings! {
    /// Settings of [`PenetrationFactor`].
    pub struct PenetrationSettings {
        /// Standard deviation of the depth to which a patch of [`area`](Self::area) is pressed in \[m\]: the compliance of
        /// skin and pads, and the errors of the models.
        pub sigma: f64 = 5e-4,
        /// Area of a patch whose depth is independent of its neighbors' \[m²\].
        pub area: f64 = 1e-4,
    }
}

/// Depths to which samples of the object's surface lie in the hand.
pub struct PenetrationFactor {
    object: Arc<Object>,
    hand: Arc<Hand>,
    /// Weighting of one sample.
    weighting: Weighting,
}

impl PenetrationFactor {
    /// Factor of the object and the hand of `frame`.
    ///
    /// # Errors
    /// If the hand is unknown.
    pub fn new(
        frame: &PreparedFrame<'_>,
        settings: &PenetrationSettings,
    ) -> Result<Self, RefineError> {
        let hand = &frame.require_hand("penetration")?.hand;
        let (object, hand) = (Arc::clone(frame.object()), Arc::clone(hand));
        let area = object.area / object.samples.len().max(1) as f64;
        let patch = NoiseModel::gaussian(settings.sigma).weighting(1);
        let weighting = patch.shared(area / settings.area);
        Ok(Self { object, hand, weighting })
    }

    /// The samples inside the hand, in the camera frame.
    fn inside(&self, state: &State) -> Vec<(Point3<f64>, RobotSample)> {
        let Ok(hand) = self.hand.articulated(&state.t_cam_hand, &state.joints) else {
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
}

impl Factor for PenetrationFactor {
    fn name(&self) -> &'static str {
        "penetration"
    }

    fn rows(&self, state: &State, rows: &mut Rows<'_>) {
        for (point, sample) in self.inside(state) {
            rows.add(sample.field.distance, &self.weighting, |row| {
                row.relative_point(state, &point, &sample.field.gradient);
                row.block(Block::Joints(state.joints.len()), sample.joints.as_slice());
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::gradient_check::{assert_gradient, fixture};
    use super::*;

    #[test]
    fn gradients_match_differences() {
        for seed in 0..3 {
            let (frame, state) = fixture(seed);
            let factor = PenetrationFactor::new(&frame, &PenetrationSettings::default()).unwrap();
            assert!(factor.cost(&state) > 0.0, "nothing touches");
            for block in [Block::ObjectPose, Block::HandPose, Block::Joints(16)] {
                assert_gradient(&factor, &state, block, 1e-7, 1e-3);
            }
        }
    }
}
