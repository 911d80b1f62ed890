//! The evidence: each term is a negative log-likelihood of the state, up to a constant.

mod depth;
mod free_space;
mod hand_depth;
mod patch_sums;
mod patches;
mod penetration;
mod physics;
mod point_to_plane;
mod prior;
mod rendering;
mod support;
mod tactile;

pub(crate) use depth::back_project;
pub use depth::{DepthSettings, DepthTerm};
pub use free_space::{FreeSpaceSettings, FreeSpaceTerm};
pub use hand_depth::{HandDepthSettings, HandDepthTerm};
pub use patches::ModelErrorSettings;
pub(crate) use patches::SurfacePatches;
pub use penetration::{PenetrationSettings, PenetrationTerm};
pub use physics::{PhysicsSettings, PhysicsTerm};
pub use point_to_plane::{NoiseEstimate, PointToPlaneSettings, PointToPlaneTerm};
pub use prior::{Prior, PriorSettings};
pub(crate) use rendering::Segmented;
pub use rendering::{RenderingSettings, RenderingTerm};
pub use support::{SupportSettings, SupportTerm};
pub use tactile::{ContactSettings, TactileSettings, TactileTerm, TouchModel};

use prehend_render::Light;

use crate::problem::{Block, Normal, State};

/// One kind of evidence about a [`State`].
///
/// Values are in nats (squared residuals over twice their variance), so that a decrease of one term
/// can be weighed against a decrease of another.
pub trait Term: Send + Sync {
    /// A short name for reports.
    fn name(&self) -> &'static str;

    /// The term at `state`. Cheap: candidate steps are judged by it.
    fn value(&self, state: &State) -> f64;

    /// The term at `state`; adds its gradient and Gauss–Newton Hessian by the requested blocks to `normal`.
    ///
    /// Blocks that it is constant in, or not differentiable by, are left as they are.
    fn linearize(&self, state: &State, normal: &mut Normal) -> f64;

    /// Whether the term may change with `block`, so that room is needed for derivatives by it.
    fn depends_on(&self, block: Block) -> bool {
        !matches!(block, Block::SurfacePatches(_))
    }

    /// The light that suits the term best at `state`, solved for in closed form, if it sees any. No other term does, so it is
    /// part of what the term costs.
    fn light(&self, _state: &State) -> Option<Light> {
        None
    }
}

/// Nats of half a squared residual of one of `count` measurements of deviation `sigma` that amount to at most `effective`
/// independent ones.
fn share(effective: f64, count: f64, sigma: f64) -> f64 {
    (effective / count).min(1.0) / sigma.powi(2)
}

#[cfg(test)]
mod gradient_check {
    use std::sync::{Arc, LazyLock};

    use nalgebra::{Isometry3, Vector6};
    use prehend_autodiff::check::{compare_gradients, finite_difference_gradient};

    use super::*;
    use crate::refine::hand_depth;
    use crate::scene::{Scene, default_scene};

    static SCENE: LazyLock<Scene> = LazyLock::new(|| default_scene(1).unwrap());

    /// The scene, a state a little off its truth, and the hand's depth image.
    pub(super) fn fixture(seed: usize) -> (&'static Scene, State, Arc<prehend_render::DepthImage>) {
        let scene = &*SCENE;
        let hand = Arc::new(hand_depth(&scene.observation, Some(&scene.robot)));
        let mut state = State::new(&scene.observation, &scene.object, &scene.truth).unwrap();
        let turn = [0.05, -0.08, 0.06, 0.02, -0.03, 0.01];
        let delta = Vector6::from_fn(|k, _| {
            let scale = if k < 3 { 0.05 } else { 1.0 };
            turn[(k + seed) % 6] * scale
        });
        state = state.moved(Block::ObjectPose, delta.as_slice());
        (scene, state, hand)
    }

    /// Steps of a block's parameters that move the surface about as far as a meter would.
    fn scales(block: Block) -> Vec<f64> {
        match block {
            // Radians move the surface by a tenth of what meters do.
            Block::ObjectPose | Block::HandPose => vec![1.0, 1.0, 1.0, 10.0, 10.0, 10.0],
            Block::Joints(count) => vec![10.0; count],
            Block::Camera => vec![2.0, 1.0, 2.0, 2.0, 10.0],
            Block::SurfacePatches(count) => vec![1.0; 3 * count],
        }
    }

    /// Compares the term's gradient by `block` with differences of its value over `step`.
    pub(super) fn assert_gradient(
        term: &dyn Term,
        state: &State,
        block: Block,
        step: f64,
        tolerance: f64,
    ) {
        let mut normal = Normal::new(&[block]);
        let value = term.linearize(state, &mut normal);
        assert!((value - term.value(state)).abs() <= 1e-9 * value.abs(), "the two values differ");
        let scales = scales(block);
        let scaled = |x: &[f64]| {
            let x: Vec<f64> = x.iter().zip(&scales).map(|(x, s)| x * s).collect();
            term.value(&state.moved(block, &x))
        };
        let reference = finite_difference_gradient(scaled, &vec![0.0; scales.len()], step);
        let gradient: Vec<f64> =
            normal.gradient().iter().zip(&scales).map(|(g, s)| g * s).collect();
        let error = compare_gradients(&gradient, &reference);
        assert!(
            error.relative < tolerance && error.cosine > 1.0 - tolerance,
            "{} by {block:?}: {error:?}\n{gradient:?}\n{reference:?}",
            term.name()
        );
        let eigenvalues = normal.hessian().clone().symmetric_eigenvalues();
        assert!(eigenvalues.min() > -1e-9 * eigenvalues.max(), "the matrix is indefinite");
    }

    /// Where the fixture's object may be off, by tiles of whole pixels in images that are smaller by `unit`.
    pub(super) fn patches(unit: usize) -> Arc<SurfacePatches> {
        let settings = ModelErrorSettings::default();
        Arc::new(
            SurfacePatches::new(&SCENE.observation, SCENE.truth.translation.z, &settings, unit)
                .unwrap(),
        )
    }

    /// Asserts that by pose and camera `term` has the derivatives that it has without `patches`, that what these have adds up to what the
    /// object's place has but for a share of `elsewhere`, and that the matrix is not indefinite.
    pub(super) fn assert_by_patches(
        term: &dyn Term,
        state: &State,
        patches: &SurfacePatches,
        elsewhere: f64,
    ) {
        let rigid = [Block::ObjectPose, Block::Camera];
        let mut alone = Normal::new(&rigid);
        let mut all = Normal::new(&[rigid[0], rigid[1], Block::SurfacePatches(patches.count())]);
        let (value, same) = (term.linearize(state, &mut alone), term.linearize(state, &mut all));
        assert!((value / same - 1.0).abs() < 1e-5, "{value} {same}");
        let gradient = all.gradient().rows(0, 11) - alone.gradient();
        assert!(gradient.norm() < 1e-4 * alone.gradient().norm());
        let hessian = all.hessian().view((0, 0), (11, 11)) - alone.hessian();
        assert!(hessian.norm() < 1e-4 * alone.hessian().norm());
        let place = alone.gradient().fixed_rows::<3>(0).into_owned();
        let by_patch = (0..patches.count()).map(|k| all.gradient().fixed_rows::<3>(11 + 3 * k));
        let sum = by_patch.fold(-place, |sum, by_patch| sum + by_patch);
        assert!(sum.norm() <= elsewhere * place.norm(), "{sum:?} of {place:?}");
        let eigenvalues = all.hessian().clone().symmetric_eigenvalues();
        assert!(eigenvalues.min() > -1e-9 * eigenvalues.max(), "the matrix is indefinite");
    }

    #[test]
    fn a_pose_is_not_changed_by_a_zero_twist() {
        let (_, state, _) = fixture(0);
        let moved = state.moved(Block::ObjectPose, &[0.0; 6]);
        let difference: Isometry3<f64> = moved.t_cam_object.inv_mul(&state.t_cam_object);
        assert!(
            difference.translation.vector.norm() < 1e-15 && difference.rotation.angle() < 1e-15
        );
    }
}
