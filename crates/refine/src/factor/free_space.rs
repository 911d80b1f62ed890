//! Free space: the object is not where the camera saw through.

use std::sync::Arc;

use nalgebra::{Vector2, Vector3};
use prehend_autodiff::lie::twist_row;
use prehend_render::{Camera, DepthImage};

use super::facing::Facing;
use crate::problem::{Block, Factor, NoiseModel, Row, Rows, State};
use crate::scene::{Frame, Object};

/// Settings of [`FreeSpaceFactor`].
#[derive(Clone, Debug, PartialEq)]
pub struct FreeSpaceSettings {
    /// Samples of the object's surface used at most.
    pub samples: usize,
    /// How far in front of measured depth a sample may be and cost nothing \[m\].
    pub margin: f64,
    /// How far beyond that it is \[m\].
    pub noise: NoiseModel,
}

impl Default for FreeSpaceSettings {
    fn default() -> Self {
        Self { samples: 400, margin: 3e-3, noise: NoiseModel::cauchy(2e-3, 5e-3, 10.0) }
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

/// A pixel near a sample that is in front of what was measured there.
struct InFront {
    /// The pixel's bilinear weight, and its derivative by the place in the image \[1/px\].
    weight: f64,
    slope: Vector2<f64>,
    /// Depth there as measured \[m\].
    measured: f64,
    /// How far the sample is in front of that, beyond the margin \[m\].
    beyond: f64,
}

impl FreeSpaceFactor {
    /// Of the depth image of `frame`, which may be missing everywhere: the cost is then zero.
    pub fn new(frame: &Frame<'_>, settings: &FreeSpaceSettings) -> Self {
        Self {
            object: Arc::clone(frame.object()),
            camera: frame.observation().camera,
            depth: Arc::clone(frame.depth()),
            settings: settings.clone(),
        }
    }

    /// The pixels where a sample of depth `z` \[m\], seen at `pixel`, is in front of measured depth.
    fn in_front(
        &self,
        state: &State,
        z: f64,
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
            let beyond = depth - z - self.settings.margin;
            let (x, y) = (1.0 - (i - part.x).abs(), 1.0 - (j - part.y).abs());
            let slope = Vector2::new((2.0 * i - 1.0) * y, (2.0 * j - 1.0) * x);
            (beyond > 0.0).then_some(InFront { weight: x * y, slope, measured, beyond })
        })
    }

    /// One of so many samples is taken.
    fn stride(&self) -> usize {
        self.object.samples.len().div_ceil(self.settings.samples.max(1)).max(1)
    }
}

impl Factor for FreeSpaceFactor {
    fn name(&self) -> &'static str {
        "free-space"
    }

    fn rows(&self, state: &State, rows: &mut Rows<'_>) {
        let center = state.center();
        let reprojected = state.camera.reprojected(&state.t_cam_object, &center);
        let by_shift = state.camera.reprojected_jacobian(&center);
        let samples = self.object.samples.iter().step_by(self.stride());
        let weighting = self.settings.noise.weighting(samples.len());
        for sample in samples {
            let place = state.t_cam_object * sample.point;
            let facing = Facing::new(&(state.t_cam_object * sample.normal), &place.coords);
            if facing.share == 0.0 {
                continue;
            }
            let seen = reprojected * sample.point;
            let Some(pixel) = self.camera.project(&seen) else { continue };
            for InFront { weight, slope, measured, beyond } in self.in_front(state, place.z, pixel)
            {
                let by_beyond = |row: &mut Row<'_>| {
                    row.object_point(state, &place, &-Vector3::z());
                    row.block(Block::Camera, &[measured, 1.0, 0.0, 0.0, 0.0]);
                };
                let by_share = |row: &mut Row<'_>| {
                    let by_seen =
                        self.camera.project_jacobian(&seen).tr_mul(&(slope * facing.share));
                    let by_shift = by_shift.tr_mul(&by_seen);
                    let arm = place.coords - center;
                    let mut twist = twist_row(&arm, &(facing.by_place * weight));
                    let mut place = twist.fixed_rows_mut::<3>(0);
                    place += by_shift.fixed_rows::<3>(0);
                    let mut rotation = twist.fixed_rows_mut::<3>(3);
                    rotation += arm.cross(&by_seen) + facing.by_rotation * weight;
                    row.block(Block::ObjectPose, twist.as_slice());
                    row.block(Block::Camera, &by_shift.as_slice()[3..]);
                };
                rows.add_share(weight * facing.share, beyond, &weighting, by_beyond, by_share);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::gradient_check::{assert_gradient, fixture, scene};
    use super::*;

    #[test]
    fn gradients_match_differences() {
        for seed in 0..3 {
            let (frame, state) = fixture(seed);
            // Towards the camera, where there is something to say.
            let state = state.retract(&[Block::ObjectPose], &[0.0, 0.0, -6e-3, 0.0, 0.0, 0.0]);
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
}
