//! Free space: the object is not where the camera saw through.

use std::sync::Arc;

use nalgebra::{Point3, Vector2, Vector3};
use prehend_render::{Camera, DepthImage};

use super::PointToPlaneSettings;
use super::facing::facing;
use crate::defaults::settings;
use crate::problem::{Factor, NoiseModel, Rows, State};
use crate::scene::{Object, PreparedFrame};

settings! {
    /// Settings of [`FreeSpaceFactor`].
    pub struct FreeSpaceSettings {
        /// Number of samples of the object's surface at most.
        pub samples: usize = 400,
        /// Distance in front of measured depth up to which a sample costs nothing \[m\].
        pub margin: f64 = 3e-3,
        /// Noise of distances beyond that \[m\]. EXPERIMENTS: Weight of free space.
        pub noise: NoiseModel = NoiseModel::cauchy(2e-3, 10.0),
        /// Sine of the inclination to the line of sight below which surface counts less, down to nothing where it looks away.
        pub grazing: f64 = PointToPlaneSettings::default().grazing,
    }
}

/// How far samples of the object's surface lie in front of what the depth image measured on the four pixels about them, each with its bilinear
/// weight, so that the cost does not jump as a sample passes from pixel to pixel.
///
/// The mask is not asked, so that what it misses counts too: background seen beside the hand says that no object is in
/// front of it.
pub struct FreeSpaceFactor {
    object: Arc<Object>,
    camera: Camera,
    depth: Arc<DepthImage>,
    settings: FreeSpaceSettings,
}

/// A sample in front of what was measured on a pixel.
struct InFront {
    /// The pixel's bilinear weight, times how much the sample faces the camera.
    share: f64,
    /// The pixel's column and row.
    pixel: Vector2<f64>,
    /// Depth there as measured \[m\].
    measured: f64,
    /// How far the sample is in front of that, beyond the margin \[m\].
    beyond: f64,
}

impl FreeSpaceFactor {
    /// Factor of the depth image of `frame`, which may be missing everywhere: the cost is then zero.
    pub fn new(frame: &PreparedFrame<'_>, settings: &FreeSpaceSettings) -> Self {
        Self {
            object: Arc::clone(frame.object()),
            camera: frame.observation().camera,
            depth: Arc::clone(frame.depth()),
            settings: settings.clone(),
        }
    }

    /// Where the sample at `place` (camera frame), of which so much looks at the camera and which is seen at `pixel`, is in front of
    /// measured depth.
    fn in_front(
        &self,
        state: &State,
        place: Point3<f64>,
        facing: f64,
        pixel: Vector2<f64>,
    ) -> impl Iterator<Item = InFront> {
        let first = pixel.map(f64::floor);
        let part = pixel - first;
        [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].into_iter().filter_map(move |(i, j)| {
            let (u, v) = (first.x + i, first.y + j);
            if u < 0.0 || v < 0.0 {
                return None;
            }
            let measured = self.depth.get(u as usize, v as usize)?;
            if !measured.is_finite() || measured <= 0.0 {
                return None;
            }
            let measured = f64::from(measured);
            let depth = state.camera.depth_scale * measured + state.camera.depth_bias;
            let beyond = depth - place.z - self.settings.margin;
            let share = facing * (1.0 - (i - part.x).abs()) * (1.0 - (j - part.y).abs());
            (beyond > 0.0 && share > 0.0).then_some(InFront {
                share,
                pixel: Vector2::new(u, v),
                measured,
                beyond,
            })
        })
    }
}

impl Factor for FreeSpaceFactor {
    fn name(&self) -> &'static str {
        "free-space"
    }

    fn rows(&self, state: &State, rows: &mut Rows<'_>) {
        let reprojected = state.camera.reprojected(&state.t_cam_object, &state.center());
        let stride = self.object.sample_stride(self.settings.samples);
        let samples = self.object.samples.iter().step_by(stride);
        let weighting = self.settings.noise.weighting(samples.len());
        for sample in samples {
            let place = state.t_cam_object * sample.point;
            let normal = state.t_cam_object * sample.normal;
            let facing = facing(&normal, &place.coords, self.settings.grazing);
            if facing == 0.0 {
                continue;
            }
            let Some(pixel) = self.camera.project(&(reprojected * sample.point)) else { continue };
            for InFront { share, pixel, measured, beyond } in
                self.in_front(state, place, facing, pixel)
            {
                rows.add(beyond, &weighting.shared(share), |row| {
                    // Shares are taken as they are: at depth's steps their derivative would pull samples sideways.
                    row.object_point(state, &place, &-Vector3::z());
                    let ray = self.camera.ray(pixel.x, pixel.y).xy();
                    row.camera(&pixel, &ray, &[measured, 1.0, 0.0, 0.0, 0.0, 0.0]);
                });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::gradient_check::{assert_gradient, fixture, scene};
    use super::*;
    use crate::problem::Block;

    #[test]
    fn gradients_match_differences() {
        for seed in 0..3 {
            let (frame, state) = fixture(seed);
            // Towards the camera, where there is something to say; the truth's own depth varies from pixel to pixel.
            let state = state.retract(&[Block::ObjectPose], &[0.0, 0.0, -6e-3, 0.0, 0.0, 0.0]);
            let mut observation = frame.observation().clone();
            observation.hand = None;
            observation.depth.pixels_mut().fill(state.center().z as f32 - 0.02);
            let frame = PreparedFrame::new(&observation, frame.object()).unwrap();
            let factor = FreeSpaceFactor::new(&frame, &FreeSpaceSettings::default());
            assert!(factor.cost(&state) > 0.0);
            for block in [Block::ObjectPose, Block::Camera] {
                assert_gradient(&factor, &state, block, 1e-8, 1e-3);
            }
        }
    }

    #[test]
    fn the_cost_does_not_jump_as_samples_pass_from_pixel_to_pixel() {
        let (frame, state) = fixture(0);
        let factor = FreeSpaceFactor::new(&frame, &FreeSpaceSettings::default());
        // Beside what the depth image shows, so that samples pass its edges.
        let moved = |i: i32| {
            let twist = [8e-3 + 1e-6 * f64::from(i), 3e-3, 0.0, 0.0, 0.0, 0.0];
            factor.cost(&state.retract(&[Block::ObjectPose], &twist))
        };
        let costs: Vec<f64> = (0..400).map(moved).collect();
        let jump = costs.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max);
        assert!(costs[0] > 0.5 && jump < 0.02, "{jump} of {} nat", costs[0]);
    }

    #[test]
    fn in_front_is_worse_than_in_place() {
        let (frame, state) = fixture(0);
        let factor = FreeSpaceFactor::new(&frame, &FreeSpaceSettings::default());
        let truth = State { t_cam_object: scene().truth, ..state };
        let front = truth.retract(&[Block::ObjectPose], &[0.0, 0.0, -0.02, 0.0, 0.0, 0.0]);
        assert!(factor.cost(&front) > 3.0 * factor.cost(&truth));
    }

    #[test]
    fn pixels_without_depth_say_nothing() {
        let (frame, state) = fixture(0);
        let mut observation = frame.observation().clone();
        observation.hand = None;
        for nothing in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            observation.depth.pixels_mut().fill(nothing);
            let frame = PreparedFrame::new(&observation, frame.object()).unwrap();
            let factor = FreeSpaceFactor::new(&frame, &FreeSpaceSettings::default());
            assert_eq!(factor.cost(&state), 0.0, "{nothing}");
        }
    }
}
