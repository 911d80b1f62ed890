//! Depth points of the hand on its surface: where the hand is in the camera, and how it bends.

use std::sync::Arc;

use nalgebra::{Point3, Vector2};
use prehend_autodiff::lie::twist_row;
use prehend_geometry::robot::RobotSample;
use rayon::prelude::*;

use crate::defaults::settings;
use crate::error::RefineError;
use crate::problem::{Block, Factor, NoiseModel, Rows, State};
use crate::scene::{Hand, PreparedFrame};

settings! {
    /// Settings of [`HandDepthFactor`].
    pub struct HandDepthSettings {
        /// Noise of distances of depth points from the hand \[m\]. EXPERIMENTS: Depth points of the hand near edges left out.
        pub noise: NoiseModel = NoiseModel::cauchy(1e-3, 60.0),
        /// Distance from where the hand is measured to be up to which a depth point is of it \[m\]: beyond, it is of something else.
        pub reach: f64 = 15e-3,
        /// Margin around the object's mask, and beside other edges, in which pixels are not taken for the hand \[px\]: there depth is of both.
        pub margin: usize = 3,
        /// Number of depth points looked at for one that is used, of robots of several bodies: a table may fill the image, and would leave hardly a point to
        /// the hand.
        pub candidates: usize = 8,
    }
}

/// Distances from the depth points on the hand, outside of the object's mask, to the hand's surface.
///
/// The distances determine the hand's pose relative to the object in the same image, whatever errors depth has in common. Touch needs it.
pub struct HandDepthFactor {
    hand: Arc<Hand>,
    points: Vec<DepthPoint>,
    settings: HandDepthSettings,
}

/// A depth point.
struct DepthPoint {
    /// Its column and row \[px\].
    pixel: Vector2<f64>,
    /// Its direction, (x/z, y/z).
    ray: Vector2<f64>,
    /// Its depth as measured \[m\].
    depth: f64,
}

/// Pixels that are looked at together.
const SIDE_BY_SIDE: usize = 16;

impl HandDepthFactor {
    /// Factor of at most `points` points of the depth of `frame` where the hand is, spread evenly over it. There may be none: the cost is then zero.
    ///
    /// # Errors
    /// If the hand is unknown.
    pub fn new(
        frame: &PreparedFrame<'_>,
        points: usize,
        settings: &HandDepthSettings,
    ) -> Result<Self, RefineError> {
        let measured = frame.require_hand("hand-depth")?;
        let robot = &measured.hand;
        let (observation, hand) = (frame.observation(), frame.hand_depth());
        let (depth, camera) = (&observation.depth, &observation.camera);
        let mask = observation.mask.pixels();
        let width = depth.width();
        // Around the mask's outline the object may be what is seen.
        let of_object = |pixel: usize| {
            let near = [0, settings.margin, settings.margin * width];
            near.iter().any(|step| {
                let (before, after) = (pixel.checked_sub(*step), mask.get(pixel + step));
                before.is_some_and(|p| mask[p]) || after.is_some_and(|m| *m)
            })
        };
        let is_of_hand = |pixel: &usize| {
            let (known, measured) = (hand.pixels()[*pixel], depth.pixels()[*pixel]);
            known > 0.0
                && measured > 0.0
                && f64::from(measured - known).abs() < settings.reach
                && !of_object(*pixel)
        };
        let mut of_hand = Vec::new();
        // Most pixels are not of the hand: looked at side by side.
        for (start, known) in (0..).step_by(SIDE_BY_SIDE).zip(hand.pixels().chunks(SIDE_BY_SIDE)) {
            if known.iter().fold(false, |any, known| any | (*known > 0.0)) {
                of_hand.extend((start..start + known.len()).filter(is_of_hand));
            }
        }
        let point = |&pixel: &usize| {
            let (x, y) = ((pixel % width) as f64, (pixel / width) as f64);
            DepthPoint {
                pixel: Vector2::new(x, y),
                ray: camera.unproject(x, y, 1.0).coords.xy(),
                depth: f64::from(depth.pixels()[pixel]),
            }
        };
        let most = points;
        let points = |limit: usize| {
            let step = of_hand.len().div_ceil(limit.max(1)).max(1);
            of_hand.iter().step_by(step).map(point).collect::<Vec<_>>()
        };
        let first = robot.tree.floating_bodies();
        let points = if first.is_empty() {
            points(most)
        } else {
            let posed = robot.posed(&measured.t_cam_hand, &measured.joints)?;
            let body = |DepthPoint { ray, depth, .. }: &DepthPoint| {
                let (link, _) =
                    posed.sample_link(&(ray.push(1.0) * *depth).into(), settings.reach)?;
                Some(first.partition_point(|first| *first <= link))
            };
            let mut of_bodies: Vec<Vec<DepthPoint>> =
                (0..=first.len()).map(|_| Vec::new()).collect();
            for point in points(settings.candidates * most) {
                if let Some(body) = body(&point) {
                    of_bodies[body].push(point);
                }
            }
            let evenly = |points: Vec<DepthPoint>| {
                let step = points.len().div_ceil(most.max(1)).max(1);
                points.into_iter().step_by(step)
            };
            of_bodies.into_iter().flat_map(evenly).collect()
        };
        Ok(Self { hand: Arc::clone(robot), points, settings: settings.clone() })
    }

    /// Each point that is near the hand with what is known of its distance.
    fn samples(&self, state: &State) -> Vec<Option<(Point3<f64>, RobotSample)>> {
        let Ok(hand) = self.hand.articulated(&state.t_cam_hand, &state.joints) else {
            return Vec::new();
        };
        let reach = 2.0 * self.settings.reach;
        let sample = |DepthPoint { ray, depth, .. }: &DepthPoint| {
            let point = state.camera.point(ray, *depth);
            Some((point, hand.distance_with_gradient(&point, reach)?))
        };
        self.points.par_iter().with_min_len(32).map(sample).collect()
    }
}

impl Factor for HandDepthFactor {
    fn name(&self) -> &'static str {
        "hand-depth"
    }

    fn rows(&self, state: &State, rows: &mut Rows<'_>) {
        let weighting = self.settings.noise.weighting(self.points.len());
        for (sample, DepthPoint { pixel, ray, depth }) in
            self.samples(state).iter().zip(&self.points)
        {
            let Some((point, sample)) = sample else {
                // Points out of reach are as bad as those at its end.
                rows.add_constant(weighting.cost(2.0 * self.settings.reach));
                continue;
            };
            let normal = &sample.field.gradient;
            rows.add(sample.field.distance, &weighting, |row| {
                let hand = -twist_row(&(point.coords - state.center()), normal);
                row.block(Block::HandPose, hand.as_slice());
                row.block(Block::Joints(state.joints.len()), sample.joints.as_slice());
                let camera = state.camera.point_jacobian(ray, *depth).tr_mul(normal);
                row.camera(pixel, ray, camera.as_slice());
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
            let (frame, mut state) = fixture(seed);
            state.camera = state.camera.changed(&[2e-3, 1e-3, 1e-3, -1e-3, 2e-3, 1e-3]);
            state.joints.iter_mut().enumerate().for_each(|(i, q)| *q += 0.01 * (i as f64).sin());
            let factor = HandDepthFactor::new(&frame, 500, &HandDepthSettings::default()).unwrap();
            assert!(factor.points.len() > 100);
            for block in [Block::HandPose, Block::Joints(16), Block::Camera] {
                assert_gradient(&factor, &state, block, 1e-7, 0.02);
            }
        }
    }

    #[test]
    fn points_out_of_reach_are_as_bad_as_those_at_its_end() {
        let (frame, state) = fixture(0);
        let settings = HandDepthSettings::default();
        let factor = HandDepthFactor::new(&frame, 500, &settings).unwrap();
        let count = factor.points.len();
        let most = settings.noise.weighting(count).cost(2.0 * settings.reach) * count as f64;
        let aside = |z| {
            let away = [0.0, 0.0, z, 0.0, 0.0, 0.0];
            factor.cost(&state.retract(&[Block::HandPose], &away))
        };
        assert!(aside(0.0) < 0.5 * most);
        for z in [0.5, 2.0] {
            assert!((aside(z) / most - 1.0).abs() < 1e-12, "{} {most}", aside(z));
        }
    }
}
