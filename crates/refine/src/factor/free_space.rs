//! Free space: the object is not where the camera saw through.

use std::sync::Arc;

use nalgebra::{SVector, Vector3};
use prehend_render::{Camera, DepthImage};

use super::{Term, share};
use crate::problem::{Block, Cauchy, Normal, State};
use crate::scene::Object;

/// Settings of [`FreeSpaceTerm`].
#[derive(Clone, Debug, PartialEq)]
pub struct FreeSpaceSettings {
    /// Samples of the object's surface used at most.
    pub samples: usize,
    /// How far in front of measured depth a sample may be and say nothing \[m\].
    pub margin: f64,
    /// Standard deviation of how far beyond that it is \[m\].
    pub sigma: f64,
    /// Distance at which a sample counts as an outlier \[m\].
    pub outlier: f64,
    /// How many independent measurements all samples amount to.
    pub effective_samples: f64,
}

impl Default for FreeSpaceSettings {
    fn default() -> Self {
        Self { samples: 400, margin: 3e-3, sigma: 2e-3, outlier: 5e-3, effective_samples: 10.0 }
    }
}

/// How far samples of the object's surface lie in front of what the depth image measured on their pixels.
///
/// The mask is not asked, so that what it misses speaks too: background seen beside the hand says that no object is in
/// front of it.
pub struct FreeSpaceTerm {
    object: Arc<Object>,
    camera: Camera,
    depth: Arc<DepthImage>,
    settings: FreeSpaceSettings,
}

impl FreeSpaceTerm {
    /// A term for a `depth` image of `camera`, which may be missing everywhere: the term is then zero.
    pub fn new(
        camera: Camera,
        depth: Arc<DepthImage>,
        object: Arc<Object>,
        settings: FreeSpaceSettings,
    ) -> Self {
        Self { object, camera, depth, settings }
    }

    /// Calls `f` with the place of each sample (camera frame) and how far it is in front of measured depth \[m\].
    fn in_front(&self, state: &State, mut f: impl FnMut(&Vector3<f64>, &Vector3<f64>, f64)) {
        let apparent = state.camera.apparent(&state.t_cam_object, &state.center());
        for sample in self.object.samples.iter().step_by(self.stride()) {
            let normal = state.t_cam_object * sample.normal;
            let point = (state.t_cam_object * sample.point).coords;
            if normal.dot(&point) >= 0.0 {
                continue;
            }
            let Some(pixel) = self.camera.project(&(apparent * sample.point)) else { continue };
            let (u, v) = (pixel.x.round(), pixel.y.round());
            if u < 0.0 || v < 0.0 {
                continue;
            }
            let Some(measured) = self.depth.get(u as usize, v as usize) else { continue };
            if !measured.is_finite() || measured <= 0.0 {
                continue;
            }
            let measured = f64::from(measured);
            let true_depth = state.camera.depth_scale * measured + state.camera.depth_bias;
            let beyond = true_depth - point.z - self.settings.margin;
            if beyond > 0.0 {
                f(&point, &Vector3::new(measured, 1.0, 0.0), beyond);
            }
        }
    }

    /// One of so many samples is taken.
    fn stride(&self) -> usize {
        self.object.samples.len().div_ceil(self.settings.samples.max(1)).max(1)
    }

    /// Nats of one square meter.
    fn share(&self) -> f64 {
        let count = self.object.samples.len().div_ceil(self.stride()).max(1) as f64;
        share(self.settings.effective_samples, count, self.settings.sigma)
    }
}

impl Term for FreeSpaceTerm {
    fn name(&self) -> &'static str {
        "free-space"
    }

    fn value(&self, state: &State) -> f64 {
        let cauchy = Cauchy { scale: self.settings.outlier };
        let mut value = 0.0;
        self.in_front(state, |_, _, beyond| value += cauchy.loss(beyond * beyond));
        self.share() * value
    }

    fn linearize(&self, state: &State, normal: &mut Normal) -> f64 {
        let cauchy = Cauchy { scale: self.settings.outlier };
        let (share, center) = (self.share(), state.center());
        let mut value = 0.0;
        self.in_front(state, |point, depth, beyond| {
            value += cauchy.loss(beyond * beyond);
            // Which pixel a sample falls on is taken as it is: depth's steps have no derivative.
            let turn = (point - center).cross(&Vector3::z());
            let object = [0.0, 0.0, -1.0, -turn.x, -turn.y, -turn.z];
            let mut camera = SVector::<f64, 5>::zeros();
            camera.fixed_rows_mut::<2>(0).copy_from(&depth.xy());
            let row = [(Block::ObjectPose, object.as_slice()), (Block::Camera, camera.as_slice())];
            normal.add_row(&row, beyond, share * cauchy.weight(beyond * beyond));
        });
        share * value
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector6;

    use super::super::gradient_check::{assert_gradient, fixture};
    use super::*;

    fn term(depth: DepthImage) -> FreeSpaceTerm {
        let (scene, _, _) = fixture(0);
        let (camera, object) = (scene.observation.camera, Arc::clone(&scene.object));
        FreeSpaceTerm::new(camera, Arc::new(depth), object, FreeSpaceSettings::default())
    }

    #[test]
    fn gradients_match_differences() {
        for seed in 0..3 {
            let (scene, state, _) = fixture(seed);
            // Towards the camera, where there is something to say; the truth's own depth varies from pixel to pixel.
            let towards = Vector6::new(0.0, 0.0, -6e-3, 0.0, 0.0, 0.0);
            let state = state.moved(Block::ObjectPose, towards.as_slice());
            let mut depth = scene.observation.depth.clone();
            depth.pixels_mut().fill(state.center().z as f32 - 0.02);
            let term = term(depth);
            assert!(term.value(&state) > 0.0);
            for block in [Block::ObjectPose, Block::Camera] {
                assert_gradient(&term, &state, block, 1e-8, 1e-3);
            }
        }
    }

    #[test]
    fn in_front_is_worse_than_in_place() {
        let (scene, state, _) = fixture(0);
        let term = term(scene.observation.depth.clone());
        let truth = State { t_cam_object: scene.truth, ..state };
        let front = truth.moved(Block::ObjectPose, &[0.0, 0.0, -0.02, 0.0, 0.0, 0.0]);
        assert!(term.value(&front) > 3.0 * term.value(&truth));
    }
}
