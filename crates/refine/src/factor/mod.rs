//! The evidence, one kind a file: each factor is a negative log-likelihood of the state, up to a constant.

mod compliant_balance;
mod facing;
mod free_space;
mod hand_depth;
mod patch_sums;
mod penetration;
mod point_to_plane;
mod prior;
mod region;
mod rendering;
mod scales;
mod support;
mod tactile;
mod view;

pub use free_space::{FreeSpaceFactor, FreeSpaceSettings};
pub use hand_depth::{HandDepthFactor, HandDepthSettings};
pub use penetration::{PenetrationFactor, PenetrationSettings};
pub(crate) use point_to_plane::NoiseEstimate;
pub use point_to_plane::{PointToPlaneFactor, PointToPlaneSettings};
pub use prior::{GaussianPrior, PriorSettings};
pub use region::{RegionFactor, RegionSettings};
pub use rendering::{RenderingFactor, RenderingMode, RenderingSettings};
pub use scales::{ErrorGroup, ScaleSettings, Scales};
pub use support::{SupportFactor, SupportSettings};
pub use tactile::{
    BinaryTouchSettings, ContactPatchSettings, ContactSettings, ProximitySettings, TactileFactor,
    TactileSettings, TouchModel,
};
pub use view::ViewFactor;

#[cfg(test)]
pub(crate) mod gradient_check {
    use std::sync::{Arc, LazyLock};

    use nalgebra::{Isometry3, Vector6};
    use prehend_autodiff::check::{compare_gradients, finite_difference_gradient};

    use crate::problem::{Block, Factor, NormalEquations, State, SurfacePatches};
    use crate::scene::{ModelErrorSettings, PreparedFrame, Scene, default_scene};

    static SCENE: LazyLock<Scene> = LazyLock::new(|| default_scene(1).unwrap());

    /// The built-in scene.
    pub(crate) fn scene() -> &'static Scene {
        &SCENE
    }

    /// Its frame.
    pub(crate) fn frame() -> PreparedFrame<'static> {
        let scene = scene();
        PreparedFrame::new(&scene.frame, &scene.object).unwrap()
    }

    /// The frame, and a state a little off its truth.
    pub(crate) fn fixture(seed: usize) -> (PreparedFrame<'static>, State) {
        let frame = frame();
        let state = State::new(&frame, &scene().truth).unwrap();
        let turn = [0.05, -0.08, 0.06, 0.02, -0.03, 0.01];
        let delta = Vector6::from_fn(|k, _| {
            let scale = if k < 3 { 0.05 } else { 1.0 };
            turn[(k + seed) % 6] * scale
        });
        let state = state.retract(&[Block::ObjectPose], delta.as_slice());
        (frame, state)
    }

    /// Steps of a block's parameters that move the surface about as far as a meter would.
    fn scales(block: Block) -> Vec<f64> {
        match block {
            // Radians move the surface by a tenth of what meters do.
            Block::ObjectPose | Block::HandPose => vec![1.0, 1.0, 1.0, 10.0, 10.0, 10.0],
            Block::Joints(count) => vec![10.0; count],
            Block::Camera => vec![2.0, 1.0, 2.0, 2.0, 10.0, 10.0],
            Block::View(_) => [vec![1.0; 3], vec![10.0; 3], scales(Block::Camera)].concat(),
        }
    }

    /// Compares the factor's gradient by `block` with differences of its value over `step`.
    pub(crate) fn assert_gradient(
        factor: &dyn Factor,
        state: &State,
        block: Block,
        step: f64,
        tolerance: f64,
    ) {
        let mut equations = NormalEquations::new(&[block]);
        let value = factor.linearize(state, &mut equations);
        assert!((value - factor.cost(state)).abs() <= 1e-9 * value.abs(), "the two values differ");
        let scales = scales(block);
        let scaled = |x: &[f64]| {
            let x: Vec<f64> = x.iter().zip(&scales).map(|(x, s)| x * s).collect();
            factor.cost(&state.retract(&[block], &x))
        };
        let reference = finite_difference_gradient(scaled, &vec![0.0; scales.len()], step);
        let gradient: Vec<f64> =
            equations.gradient().iter().zip(&scales).map(|(g, s)| g * s).collect();
        let error = compare_gradients(&gradient, &reference);
        assert!(
            error.relative < tolerance && error.cosine > 1.0 - tolerance,
            "{} by {block:?}: {error:?}\n{gradient:?}\n{reference:?}",
            factor.name()
        );
        let eigenvalues = equations.hessian().clone().symmetric_eigenvalues();
        assert!(eigenvalues.min() > -1e-9 * eigenvalues.max(), "the matrix is indefinite");
    }

    /// Where the fixture's object may be off, by tiles of whole pixels in images that are smaller by `unit`.
    pub(crate) fn patches(unit: usize) -> Arc<SurfacePatches> {
        let settings = ModelErrorSettings::default();
        Arc::new(
            SurfacePatches::new(&SCENE.frame, SCENE.truth.translation.z, &settings, unit).unwrap(),
        )
    }

    /// Asserts that by pose and camera `factor` has the derivatives that it has without `patches`, that what these have adds up to what the
    /// object's place has but for a share of `elsewhere`, and that the matrix is not indefinite.
    pub(crate) fn assert_by_patches(
        factor: &dyn Factor,
        state: &State,
        patches: &SurfacePatches,
        elsewhere: f64,
    ) {
        let rigid = [Block::ObjectPose, Block::Camera];
        let mut alone = NormalEquations::new(&rigid);
        let mut all = NormalEquations::with_patches(&rigid, patches.count());
        let (value, same) =
            (factor.linearize(state, &mut alone), factor.linearize(state, &mut all));
        assert!((value / same - 1.0).abs() < 1e-5, "{value} {same}");
        let gradient = all.gradient() - alone.gradient();
        assert!(gradient.norm() < 1e-4 * alone.gradient().norm());
        let hessian = all.hessian() - alone.hessian();
        assert!(hessian.norm() < 1e-4 * alone.hessian().norm());
        let place = alone.gradient().fixed_rows::<3>(0).into_owned();
        let (gradient, hessian) = all.dense();
        let by_patch = (0..patches.count()).map(|k| gradient.fixed_rows::<3>(12 + 3 * k));
        let sum = by_patch.fold(-place, |sum, by_patch| sum + by_patch);
        assert!(sum.norm() <= elsewhere * place.norm(), "{sum:?} of {place:?}");
        let eigenvalues = hessian.symmetric_eigenvalues();
        assert!(eigenvalues.min() > -1e-9 * eigenvalues.max(), "the matrix is indefinite");
    }

    #[test]
    fn a_pose_is_not_changed_by_a_zero_twist() {
        let (_, state) = fixture(0);
        let moved = state.retract(&[Block::ObjectPose], &[0.0; 6]);
        let difference: Isometry3<f64> = moved.t_cam_object.inv_mul(&state.t_cam_object);
        assert!(
            difference.translation.vector.norm() < 1e-15 && difference.rotation.angle() < 1e-15
        );
    }
}
