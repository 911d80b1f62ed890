//! The evidence: each term is a negative log-likelihood of the state, up to a constant.

mod depth;
mod physics;
mod rendering;
mod tactile;

pub(crate) use depth::back_project;
pub use depth::{DepthSettings, DepthTerm};
pub use physics::{PhysicsSettings, PhysicsTerm};
pub use rendering::{RenderingSettings, RenderingTerm};
pub use tactile::{TactileSettings, TactileTerm};

use crate::{Block, Normal, State};

/// One kind of evidence about a [`State`].
///
/// Values are in nats (squared residuals over twice their variance), so that a decrease of one term
/// can be weighed against a decrease of another.
pub trait Term: Send + Sync {
    /// A short name for reports.
    fn name(&self) -> &'static str;

    /// The blocks that the term has derivatives for; it is constant in, or not differentiable by, others.
    fn blocks(&self) -> &'static [Block];

    /// The term at `state`. Cheap: candidate steps are judged by it.
    fn value(&self, state: &State) -> f64;

    /// The term at `state`; adds its gradient and Gauss–Newton Hessian to `normal`.
    fn linearise(&self, state: &State, normal: &mut Normal) -> f64;

    /// Solves in closed form for nuisance parameters of `state` that only this term sees.
    fn refresh(&self, _state: &mut State) {}
}

#[cfg(test)]
mod gradient_check {
    use std::sync::{Arc, LazyLock};

    use nalgebra::{Isometry3, Vector6};
    use prehend_autodiff::check::{compare_gradients, finite_difference_gradient};

    use super::*;
    use crate::refine::hand_depth;
    use crate::synth::{Scene, default_scene};

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
        state = state.moved(Block::ObjectPose, &delta);
        (scene, state, hand)
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
        let value = term.linearise(state, &mut normal);
        assert!((value - term.value(state)).abs() <= 1e-9 * value.abs(), "the two values differ");
        let along = |x: &[f64]| term.value(&state.moved(block, &Vector6::from_column_slice(x)));
        // Radians move the surface by a tenth of what metres do.
        let scale = Vector6::new(1.0, 1.0, 1.0, 10.0, 10.0, 10.0);
        let scaled = |x: &[f64]| {
            let x: Vec<f64> = x.iter().zip(scale.iter()).map(|(x, s)| x * s).collect();
            along(&x)
        };
        let reference = finite_difference_gradient(scaled, &[0.0; 6], step);
        let gradient: Vec<f64> =
            normal.gradient().iter().zip(scale.iter()).map(|(g, s)| g * s).collect();
        let error = compare_gradients(&gradient, &reference);
        assert!(
            error.relative < tolerance && error.cosine > 1.0 - tolerance,
            "{}: {error:?}\n{gradient:?}\n{reference:?}",
            term.name()
        );
        let eigenvalues = normal.hessian().clone().symmetric_eigenvalues();
        assert!(eigenvalues.min() > -1e-9 * eigenvalues.max(), "the matrix is indefinite");
    }

    #[test]
    fn a_pose_is_not_changed_by_a_zero_twist() {
        let (_, state, _) = fixture(0);
        let moved = state.moved(Block::ObjectPose, &Vector6::zeros());
        let difference: Isometry3<f64> = moved.t_cam_object.inv_mul(&state.t_cam_object);
        assert!(
            difference.translation.vector.norm() < 1e-15 && difference.rotation.angle() < 1e-15
        );
    }
}
