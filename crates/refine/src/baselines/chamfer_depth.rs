//! Chamfer distance: the two-way distance between the object's surface and the depth points on it.

use std::sync::Arc;

use nalgebra::{Point3, Vector3};
use prehend_render::{Camera, DepthImage};

use super::matcher::{Matcher, PointPair};
use super::wide;
use crate::defaults::settings;
use crate::error::RefineError;
use crate::problem::{Factor, NoiseModel, Rows, State};
use crate::scene::PreparedFrame;

settings! {
    /// Settings of [`ChamferDepthFactor`].
    pub struct ChamferDepthSettings {
        /// Depth points used at most, spread evenly over the mask.
        pub points: usize = 1500,
        /// Distances of points from the surface \[m\]. The two directions have half of the effective samples each.
        pub noise: NoiseModel = wide(1.5e-3, 10e-3, 200.0),
    }
}

/// The paper's Eq. 2 with P the depth points on the object and T the surface that the camera can see.
///
/// Two departures from its letter, both because the literal form is biased. The second sum runs over
/// the surface that faces the camera and is not hidden by the hand: a hidden triangle has no depth
/// point near it at the true pose. Both distances go through Cauchy's loss: masks leak and edges fly.
pub struct ChamferDepthFactor {
    matcher: Matcher,
    camera: Camera,
    /// Depth of the hand, where it may hide the object.
    hand: Arc<DepthImage>,
    /// Noise of one direction.
    noise: NoiseModel,
}

impl ChamferDepthFactor {
    /// The factor of the masked depth of `frame`.
    ///
    /// # Errors
    /// If no pixel of the mask has a depth.
    pub fn new(
        frame: &PreparedFrame<'_>,
        settings: &ChamferDepthSettings,
    ) -> Result<Self, RefineError> {
        let matcher = Matcher::new(frame, settings.points)?;
        let (camera, hand) = (frame.observation().camera, Arc::clone(frame.hand_depth()));
        let effective_samples = 0.5 * settings.noise.effective_samples;
        let noise = NoiseModel { effective_samples, ..settings.noise };
        Ok(Self { matcher, camera, hand, noise })
    }

    /// True of a surface point of the object that the camera sees, as far as facing and the hand decide.
    fn sees(&self, point: &Point3<f64>, normal: &Vector3<f64>) -> bool {
        // Grazing surface is where depth cameras return nothing.
        if normal.dot(&point.coords) > -0.2 * point.coords.norm() {
            return false;
        }
        let Some(pixel) = self.camera.project(point) else { return false };
        let (u, v) = (pixel.x.round(), pixel.y.round());
        if u < 0.0 || v < 0.0 {
            return false;
        }
        let Some(hand) = self.hand.get(u as usize, v as usize) else { return false };
        hand == 0.0 || f64::from(hand) > point.z
    }
}

impl Factor for ChamferDepthFactor {
    fn name(&self) -> &'static str {
        "chamfer-depth"
    }

    fn rows(&self, state: &State, rows: &mut Rows<'_>) {
        let to_mesh = self.matcher.to_surface(state);
        let to_cloud = self.matcher.to_cloud(state, |point, normal| self.sees(point, normal));
        if to_cloud.is_empty() {
            // A pose that shows the camera nothing, whose mean distance would be nothing's: as if all of the object were as far
            // from the depth points as it is large.
            let cost = self.noise.weighting(1).cost(2.0 * self.matcher.object.radius);
            rows.add_constant(self.noise.effective_samples * cost);
        }
        for pairs in [to_mesh, to_cloud] {
            let weighting = self.noise.weighting(pairs.len());
            for PointPair { surface, cloud, .. } in pairs {
                let offset = cloud - surface;
                let distance = offset.norm();
                rows.add(distance, &weighting, |row| {
                    // The matched surface point slides along the surface as the object moves, so only motion along the offset
                    // changes the distance.
                    if distance > 1e-12 {
                        row.object_point(state, &surface, &(-offset / distance));
                    }
                });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::factor::gradient_check::{assert_gradient, fixture, scene};
    use crate::problem::Block;

    fn factor(frame: &PreparedFrame<'_>) -> ChamferDepthFactor {
        ChamferDepthFactor::new(frame, &ChamferDepthSettings::default()).unwrap()
    }

    #[test]
    fn gradient_matches_differences() {
        for seed in 0..3 {
            let (frame, state) = fixture(seed);
            // So short a step that hardly any point changes its match or its visibility.
            assert_gradient(&factor(&frame), &state, Block::ObjectPose, 1e-8, 2e-3);
        }
    }

    #[test]
    fn the_truth_is_near_the_minimum() {
        let (frame, state) = fixture(0);
        let factor = factor(&frame);
        let truth = State { t_cam_object: scene().truth, ..state.clone() };
        assert!(factor.cost(&truth) < 0.3 * factor.cost(&state));
    }

    #[test]
    fn each_depth_point_is_matched_with_its_nearest_surface_point() {
        let (frame, state) = fixture(0);
        let factor = factor(&frame);
        let pairs = factor.matcher.to_surface(&state);
        assert!(pairs.len() == factor.matcher.cloud.points().len() && pairs.len() > 100);
        for PointPair { surface, cloud, .. } in pairs {
            let local = state.t_cam_object.inverse() * cloud;
            let (distance, _) = factor.matcher.object.surface.signed_distance(&local);
            assert!(((cloud - surface).norm() - distance.abs()).abs() < 1e-12);
        }
    }

    #[test]
    fn leaving_the_view_never_pays() {
        let (frame, state) = fixture(0);
        let factor = factor(&frame);
        let aside = |x: f64| {
            factor.cost(&state.retract(&[Block::ObjectPose], &[x, 0.0, 0.0, 0.0, 0.0, 0.0]))
        };
        assert!(aside(1.0) > aside(0.2) && aside(0.2) > aside(0.05));
    }

    #[test]
    fn no_depth_is_an_error() {
        let scene = scene();
        let mut observation = scene.frame.clone();
        observation.depth.pixels_mut().fill(0.0);
        let frame = PreparedFrame::new(&observation, &scene.object).unwrap();
        let factor = ChamferDepthFactor::new(&frame, &ChamferDepthSettings::default());
        assert!(matches!(factor, Err(RefineError::NoDepth)));
    }
}
