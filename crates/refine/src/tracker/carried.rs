//! What earlier frames say of this one.

use nalgebra::{DMatrix, DVector, Isometry3, Matrix6, Vector3, Vector6};

use crate::factor::{Prior, Term};
use crate::problem::{Block, Normal, State};
use crate::scene::CameraCalibrationError;
use crate::strategy::{Factor, RIDGE};

/// Where the parts of a vector of all that a state holds begin: object, hand, joints, camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    joints: usize,
}

/// Twists of the object, then of the hand.
const POSES: usize = 12;

impl Layout {
    pub(super) fn new(joints: usize) -> Self {
        Self { joints }
    }

    pub(super) fn len(self) -> usize {
        POSES + self.joints + CameraCalibrationError::DIMENSION
    }

    /// Its blocks, in order.
    pub(super) fn blocks(self) -> [Block; 4] {
        [Block::ObjectPose, Block::HandPose, Block::Joints(self.joints), Block::Camera]
    }

    /// Where `block` begins.
    pub(super) fn offset(self, block: Block) -> usize {
        match block {
            Block::ObjectPose => 0,
            Block::HandPose => 6,
            Block::Joints(_) => POSES,
            Block::Camera => POSES + self.joints,
            // None of these is carried.
            Block::SurfacePatches(_) => self.len(),
        }
    }
}

/// A Gaussian about a state, with all its correlations: half the squared deviations from it, whitened.
pub(super) struct GaussianPrior {
    mean: State,
    center: Vector3<f64>,
    layout: Layout,
    /// What whitens deviations: inverse of the lower Cholesky factor of the covariance.
    whitener: DMatrix<f64>,
    /// Inverse of the covariance of the object's twist.
    object: Matrix6<f64>,
}

impl GaussianPrior {
    /// About `mean`, whose deviations have that covariance \[m, rad\]; `None` if it is not positive definite.
    pub(super) fn new(mean: State, layout: Layout, covariance: &DMatrix<f64>) -> Option<Self> {
        let whitener = Factor::new(covariance, RIDGE)?.whitener()?;
        let object = covariance.fixed_view::<6, 6>(0, 0).into_owned().try_inverse()?;
        Some(Self { center: mean.center(), mean, layout, whitener, object })
    }

    /// How far the object of `state` is from where it was foreseen, in standard deviations.
    pub(super) fn surprise(&self, state: &State) -> f64 {
        let (off, _) = self.deviation_of(&state.t_cam_object, &self.mean.t_cam_object, state);
        off.dot(&(self.object * off)).max(0.0).sqrt()
    }

    fn deviation_of(
        &self,
        pose: &Isometry3<f64>,
        from: &Isometry3<f64>,
        state: &State,
    ) -> (Vector6<f64>, Matrix6<f64>) {
        Prior::deviation(pose, from, &self.center, &state.center())
    }

    /// Deviations of `state`, whitened, and the derivatives of the object's and the hand's by their twists.
    fn whitened(&self, state: &State) -> (DVector<f64>, Matrix6<f64>, Matrix6<f64>) {
        let (object, by_object) =
            self.deviation_of(&state.t_cam_object, &self.mean.t_cam_object, state);
        let (hand, by_hand) = self.deviation_of(&state.t_cam_hand, &self.mean.t_cam_hand, state);
        let mut all = DVector::zeros(self.layout.len());
        all.fixed_rows_mut::<6>(0).copy_from(&object);
        all.fixed_rows_mut::<6>(6).copy_from(&hand);
        let joints = state.joints.iter().zip(&self.mean.joints).take(self.layout.joints);
        for (k, (now, then)) in joints.enumerate() {
            all[POSES + k] = now - then;
        }
        let camera = state.camera.parameters().into_iter().zip(self.mean.camera.parameters());
        for (k, (now, then)) in camera.enumerate() {
            all[POSES + self.layout.joints + k] = now - then;
        }
        (&self.whitener * all, by_object, by_hand)
    }
}

impl Term for std::sync::Arc<GaussianPrior> {
    fn name(&self) -> &'static str {
        "prior"
    }

    fn value(&self, state: &State) -> f64 {
        0.5 * self.whitened(state).0.norm_squared()
    }

    fn linearize(&self, state: &State, normal: &mut Normal) -> f64 {
        let (residuals, by_object, by_hand) = self.whitened(state);
        let joints = Block::Joints(self.layout.joints);
        let (from, to) = (self.layout.offset(joints), self.layout.offset(Block::Camera));
        for (k, residual) in residuals.iter().enumerate() {
            let row: Vec<f64> = self.whitener.row(k).iter().copied().collect();
            let object = by_object.tr_mul(&Vector6::from_column_slice(&row[..6]));
            let hand = by_hand.tr_mul(&Vector6::from_column_slice(&row[6..POSES]));
            let parts = [
                (Block::ObjectPose, object.as_slice()),
                (Block::HandPose, hand.as_slice()),
                (joints, &row[from..to]),
                (Block::Camera, &row[to..]),
            ];
            normal.add_row(&parts, *residual, 1.0);
        }
        0.5 * residuals.norm_squared()
    }
}

#[cfg(test)]
mod tests {
    use prehend_autodiff::check::{compare_gradients, finite_difference_gradient};

    use super::*;
    use crate::scene::default_scene;

    #[test]
    fn it_is_a_gaussian_with_the_derivatives_it_says() {
        let scene = default_scene(1).unwrap();
        let start = State::new(&scene.observation, &scene.object, &scene.truth).unwrap();
        let layout = Layout::new(16);
        let n = layout.len();
        let mixed = DMatrix::from_fn(n, n, |r, c| ((r * 7 + c * 3) as f64).sin());
        let covariance = (&mixed * mixed.transpose() + DMatrix::identity(n, n)) * 1e-4;
        let carried = GaussianPrior::new(start.clone(), layout, &covariance).unwrap();
        let carried = std::sync::Arc::new(carried);
        assert!(carried.value(&start) < 1e-20 && carried.surprise(&start) < 1e-9);
        let blocks = [Block::ObjectPose, Block::HandPose, Block::Joints(16), Block::Camera];
        let off: Vec<f64> = (0..n).map(|k| 0.02 * (k as f64 * 1.3).cos()).collect();
        // Small deviations are the parameters of the blocks themselves.
        let little: Vec<f64> = off.iter().map(|v| v * 1e-4).collect();
        let x = DVector::from_vec(little.clone());
        let expected = 0.5 * x.dot(&covariance.lu().solve(&x).unwrap());
        let found = carried.value(&start.moved_all(&blocks, &little));
        assert!((found - expected).abs() < 1e-3 * expected, "{found} {expected}");
        let state = start.moved_all(&blocks, &off);
        let mut normal = Normal::new(&blocks);
        let value = carried.linearize(&state, &mut normal);
        assert!((value - carried.value(&state)).abs() < 1e-12 * value);
        let of = |x: &[f64]| carried.value(&state.moved_all(&blocks, x));
        let reference = finite_difference_gradient(of, &vec![0.0; n], 1e-6);
        let found: Vec<f64> = normal.gradient().iter().copied().collect();
        assert!(compare_gradients(&found, &reference).relative < 1e-5);
    }
}
