//! Priors of the pose and of the calibrations.

use nalgebra::{DMatrix, DVector, Isometry3, Matrix6, Point3, UnitQuaternion, Vector3, Vector6};
use prehend_autodiff::lie::{cross_matrix, so3_left_jacobian_inverse, so3_log};
use prehend_geometry::RobustKernel;

use super::{ErrorGroup, Scales};
use crate::defaults::settings;
use crate::error::RefineError;
use crate::problem::{Block, CAUCHY_WIDTH, Factor, NoiseModel, RIDGE, Rows, ScaledCholesky, State};
use crate::scene::{HandMeasurement, prismatic_joints};

settings! {
    /// Stated accuracies: standard deviations of what a [`State`] holds from what it begins with. All are positive; what is known exactly has a
    /// tiny one.
    pub struct PriorSettings {
        // An initial pose that is good to some centimeters and some tens of degrees, and a robot of common accuracy.
        /// Standard deviation of the object's center in each direction \[m\]. Errors of the initial pose may be outliers (Cauchy's kernel).
        pub object_translation: f64 = 0.03,
        /// Standard deviation of the object's rotation about each axis \[rad\].
        pub object_rotation: f64 = 0.4,
        /// Probability that the initial rotation is off by half a turn about an axis of the model, or transposed, as where files differ in their conventions.
        /// EXPERIMENTS: Probability of another rotation convention.
        pub object_turned: f64 = 0.02,
        /// Standard deviation of the hand's translation at the object's place, in each direction \[m\].
        pub hand_translation: f64 = 2.1e-3,
        /// Standard deviation of the hand's rotation about each axis \[rad\].
        pub hand_rotation: f64 = 7e-3,
        /// Standard deviation of each position of a revolute joint \[rad\].
        pub joints: f64 = 0.014,
        /// Standard deviation of each position of a prismatic joint \[m\].
        pub prismatic_joints: f64 = 1e-3,
        /// Standard deviations of joints of which they are known, in the order of the joints: beyond the end of the list and where there is none, as of
        /// revolute ones.
        #[serde(skip)]
        pub known_joints: Vec<Option<f64>> = Vec::new(),
        /// Standard deviation of the depth scale, as a part of depth.
        pub depth_scale: f64 = 4e-3,
        /// Standard deviation of the depth bias \[m\].
        pub depth_bias: f64 = 1e-3,
        /// Standard deviation of the principal point, across and down \[focal lengths\].
        pub principal_point: f64 = 1.7e-3,
        /// Standard deviation of the focal length, as a part of it: also that of the model's size, which images tell no better.
        pub focal_scale: f64 = 4e-3,
        /// Standard deviation of half of what the two focal lengths differ by, as a part of them.
        pub aspect: f64 = 2e-3,
        /// Standard deviation of another camera's place beside the first, at the object's place, in each direction \[m\].
        pub view_translation: f64 = 2e-3,
        /// Standard deviation of its rotation about each axis \[rad\].
        pub view_rotation: f64 = 4e-3,
    }
}

impl PriorSettings {
    /// Standard deviations of the parameters of `block`, in their order.
    pub(crate) fn sigmas(&self, block: Block) -> Vec<f64> {
        match block {
            Block::ObjectPose => [[self.object_translation; 3], [self.object_rotation; 3]].concat(),
            Block::HandPose => [[self.hand_translation; 3], [self.hand_rotation; 3]].concat(),
            Block::Joints(count) => (0..count)
                .map(|k| self.known_joints.get(k).copied().flatten().unwrap_or(self.joints))
                .collect(),
            Block::Camera => vec![
                self.depth_scale,
                self.depth_bias,
                self.principal_point,
                self.principal_point,
                self.focal_scale,
                self.aspect,
            ],
            Block::View(_) => {
                let pose = [[self.view_translation; 3], [self.view_rotation; 3]].concat();
                [pose, self.sigmas(Block::Camera)].concat()
            }
        }
    }

    /// The scale of each parameter of `state`.
    pub(crate) fn scales(state: &State, scales: &Scales) -> Vec<f64> {
        let of = |block: Block| {
            let scale = ErrorGroup::of(block).map_or(1.0, |group| scales.get(group));
            std::iter::repeat_n(scale, block.dimension())
        };
        state.blocks().into_iter().flat_map(of).collect()
    }

    /// Settings with the standard deviations that are stated of the pose and joints of `hand`.
    pub(crate) fn of_hand(&self, hand: Option<&HandMeasurement>) -> Self {
        let mut prior = self.clone();
        let Some(hand) = hand else { return prior };
        let [translation, rotation] = hand.pose_sigmas;
        prior.hand_translation = translation.unwrap_or(prior.hand_translation);
        prior.hand_rotation = rotation.unwrap_or(prior.hand_rotation);
        let said =
            if hand.joint_sigmas.is_empty() { &self.known_joints } else { &hand.joint_sigmas };
        let sigma = |(joint, slides): (usize, bool)| {
            let said = said.get(joint).copied().flatten();
            said.or_else(|| slides.then_some(self.prismatic_joints))
        };
        prior.known_joints =
            prismatic_joints(&hand.hand.tree).into_iter().enumerate().map(sigma).collect();
        prior
    }

    /// Standard deviations of all parameters of `state`.
    pub(crate) fn all_sigmas(&self, state: &State) -> DVector<f64> {
        DVector::from_vec(state.blocks().into_iter().flat_map(|of| self.sigmas(of)).collect())
    }
}

/// A Gaussian about a state: ½‖W d‖² of the deviations d from it, with W the inverse of the lower Cholesky factor of their
/// covariance. Deviations of poses are displacement of the point at the object's center, and rotation vector.
pub struct GaussianPrior {
    mean: State,
    center: Vector3<f64>,
    /// Square root W of the information, lower triangular.
    whitener: DMatrix<f64>,
    /// Inverse of the covariance of the object's deviation.
    object_information: Matrix6<f64>,
    /// Whether the object's displacement and rotation may be outliers (Cauchy's kernel).
    has_outliers: bool,
    /// Other rotations that the object may have in place of that of the mean, and what each costs \[nat\].
    others: Vec<UnitQuaternion<f64>>,
    cost_of_others: f64,
}

impl GaussianPrior {
    /// Independent deviations from `mean`, as large as `settings` state.
    ///
    /// # Errors
    /// If a standard deviation is not a positive number.
    pub fn independent(mean: State, settings: &PriorSettings) -> Result<Self, RefineError> {
        Self::scaled(mean, settings, &Scales::default())
    }

    /// Independent deviations from `mean`, larger than `settings` state by `scales`.
    ///
    /// # Errors
    /// If a standard deviation is not a positive number.
    pub(crate) fn scaled(
        mean: State,
        settings: &PriorSettings,
        scales: &Scales,
    ) -> Result<Self, RefineError> {
        let scale = DVector::from_vec(PriorSettings::scales(&mean, scales));
        let sigmas = settings.all_sigmas(&mean).component_mul(&scale);
        if let Some(wrong) = sigmas.iter().find(|v| v.is_nan() || **v <= 0.0) {
            let problem = format!("a standard deviation of {wrong} is not positive");
            return Err(RefineError::Setting { name: "prior", problem });
        }
        let information = sigmas.fixed_rows::<6>(0).map(|sigma| sigma.powi(-2));
        let whitener = DMatrix::from_diagonal(&sigmas.map(f64::recip));
        let prior = Self::new(mean, whitener, Matrix6::from_diagonal(&information));
        Ok(prior.with_outliers())
    }

    /// Correlated deviations from `mean`, in the order of its [`blocks`](State::blocks), of this covariance \[m, rad\]; `None` if it is not positive definite.
    pub(crate) fn correlated(mean: State, covariance: &DMatrix<f64>) -> Option<Self> {
        let whitener = ScaledCholesky::new(covariance, RIDGE)?.whitener()?;
        let information = covariance.fixed_view::<6, 6>(0, 0).into_owned().try_inverse()?;
        Some(Self::new(mean, whitener, information))
    }

    fn new(mean: State, whitener: DMatrix<f64>, object_information: Matrix6<f64>) -> Self {
        Self {
            center: mean.center(),
            mean,
            whitener,
            object_information,
            has_outliers: false,
            others: Vec::new(),
            cost_of_others: 0.0,
        }
    }

    /// A mixture: with this `probability`, the object has one of the rotations `others` in place of that of the mean. Where components overlap, the nearest
    /// one counts (max-mixture, Olson and Agarwal, 2013).
    pub(crate) fn with_others(self, others: Vec<UnitQuaternion<f64>>, probability: f64) -> Self {
        let each = probability / others.len() as f64;
        Self { others, cost_of_others: ((1.0 - probability) / each).ln(), ..self }
    }

    /// Where the object is in the component of the mixture that is nearest to `state`, and what that costs \[nat\].
    fn component(&self, state: &State) -> (Isometry3<f64>, f64) {
        let mean = &self.mean.t_cam_object;
        let angle =
            |rotation: &UnitQuaternion<f64>| rotation.angle_to(&state.t_cam_object.rotation);
        let other = self.others.iter().min_by(|a, b| angle(a).total_cmp(&angle(b)));
        match other.filter(|other| angle(other) < angle(&mean.rotation)) {
            Some(other) => (self.mean.rotated_to(other), self.cost_of_others),
            None => (*mean, 0.0),
        }
    }

    /// With outliers of the object's pose: of an object whose deviations are independent of the rest.
    pub(crate) fn with_outliers(self) -> Self {
        Self { has_outliers: true, ..self }
    }

    /// Weights of the object's whitened displacement and rotation, and what their costs are beyond those with these weights \[nat\].
    fn object_weights(&self, residuals: [f64; 6]) -> ([f64; 6], f64) {
        if !self.has_outliers {
            return ([1.0; 6], 0.0);
        }
        let kernel = RobustKernel::Cauchy { scale: CAUCHY_WIDTH };
        let (mut weights, mut beyond) = ([1.0; 6], 0.0);
        for part in [0..3, 3..6] {
            let squared: f64 = residuals[part.clone()].iter().map(|r| r * r).sum();
            let weight = kernel.weight(squared);
            weights[part].fill(weight);
            beyond += kernel.loss(squared) - 0.5 * weight * squared;
        }
        (weights, beyond)
    }

    /// Mahalanobis distance of the object of `state` from the mean.
    pub(crate) fn innovation(&self, state: &State) -> f64 {
        let (off, _) = self.deviation(&state.t_cam_object, &self.mean.t_cam_object, state);
        off.dot(&(self.object_information * off)).max(0.0).sqrt()
    }

    /// How far `pose` has been moved from `from`, as (displacement of the point that was at the object's center, rotation
    /// vector), and the derivatives by a left twist of `pose` about the center of `state`.
    fn deviation(
        &self,
        pose: &Isometry3<f64>,
        from: &Isometry3<f64>,
        state: &State,
    ) -> (Vector6<f64>, Matrix6<f64>) {
        let motion = pose * from.inverse();
        let place = (motion * Point3::from(self.center)).coords;
        let turn = so3_log(&motion.rotation);
        let mut deviation = Vector6::zeros();
        deviation.fixed_rows_mut::<3>(0).copy_from(&(place - self.center));
        deviation.fixed_rows_mut::<3>(3).copy_from(&turn);
        let mut jacobian = Matrix6::identity();
        let arm = place - state.center();
        jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&-cross_matrix(&arm));
        jacobian.fixed_view_mut::<3, 3>(3, 3).copy_from(&so3_left_jacobian_inverse(&turn));
        (deviation, jacobian)
    }
}

impl Factor for GaussianPrior {
    fn name(&self) -> &'static str {
        "prior"
    }

    fn rows(&self, state: &State, rows: &mut Rows<'_>) {
        let (expected, cost) = self.component(state);
        rows.add_constant(cost);
        let (object, by_object) = self.deviation(&state.t_cam_object, &expected, state);
        let (_, by_hand) = self.deviation(&state.t_cam_hand, &self.mean.t_cam_hand, state);
        let calibrations = state.calibration_deviation(&self.mean);
        let all = object.iter().chain(&calibrations).copied();
        let whitened = &self.whitener * DVector::from_iterator(self.whitener.ncols(), all);
        let unit = NoiseModel::gaussian(1.0).weighting(1);
        let (weights, beyond) = self.object_weights(std::array::from_fn(|k| whitened[k]));
        rows.add_constant(beyond);
        let blocks = self.mean.blocks();
        for (k, residual) in whitened.iter().enumerate() {
            let weighting = weights.get(k).map_or(unit, |weight| unit.shared(*weight));
            rows.add(*residual, &weighting, |row| {
                let all: Vec<f64> = self.whitener.row(k).iter().copied().collect();
                let mut rest = &all[..];
                for &block in &blocks {
                    let (own, others) = rest.split_at(block.dimension());
                    rest = others;
                    // Most deviations are independent of those of other blocks.
                    if own.iter().all(|weight| *weight == 0.0) {
                        continue;
                    }
                    let by_pose = match block {
                        Block::ObjectPose => &by_object,
                        Block::HandPose => &by_hand,
                        Block::Joints(_) | Block::Camera | Block::View(_) => {
                            row.block(block, own);
                            continue;
                        }
                    };
                    row.block(block, by_pose.tr_mul(&Vector6::from_column_slice(own)).as_slice());
                }
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use prehend_autodiff::check::{compare_gradients, finite_difference_gradient};

    use super::super::gradient_check::{assert_gradient, fixture};
    use super::*;
    use crate::problem::NormalEquations;

    fn settings() -> PriorSettings {
        PriorSettings {
            object_translation: 0.02,
            object_rotation: 0.2,
            hand_translation: 2e-3,
            hand_rotation: 7e-3,
            joints: 0.014,
            depth_scale: 5e-3,
            depth_bias: 1e-3,
            principal_point: 2e-3,
            focal_scale: 4e-3,
            aspect: 2e-3,
            ..PriorSettings::default()
        }
    }

    #[test]
    fn gradients_match_differences_also_at_the_mean() {
        let (_, start) = fixture(0);
        let prior = GaussianPrior::independent(start.clone(), &settings()).unwrap();
        assert!(prior.cost(&start) < 1e-20);
        let blocks = [Block::ObjectPose, Block::HandPose, Block::Joints(16), Block::Camera];
        let all = |scale: f64| -> Vec<f64> {
            let count: usize = blocks.iter().map(|b| b.dimension()).sum();
            (0..count).map(|i| scale * (i as f64 * 1.7).sin()).collect()
        };
        for scale in [1e-3, 0.1] {
            let state = start.retract(&blocks, &all(scale));
            for block in blocks {
                assert_gradient(&prior, &state, block, 1e-6, 1e-5);
            }
        }
    }

    #[test]
    fn a_mixture_is_the_component_that_is_nearest_and_its_cost() {
        let (_, start) = fixture(0);
        let half = start.t_cam_object.rotation
            * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::PI);
        let one = GaussianPrior::independent(start.clone(), &settings()).unwrap();
        let mixed = GaussianPrior::independent(start.clone(), &settings()).unwrap();
        let mixed = mixed.with_others(vec![half], 0.2);
        let turned = State { t_cam_object: start.rotated_to(&half), ..start.clone() };
        assert!((turned.center() - start.center()).norm() < 1e-15);
        assert!((mixed.cost(&turned) - 4f64.ln()).abs() < 1e-9);
        let off = [0.01, -0.02, 0.005, 0.2, 0.1, -0.3];
        let near = start.retract(&[Block::ObjectPose], &off);
        assert_eq!(mixed.cost(&near), one.cost(&near));
        for scale in [1e-3, 1.0] {
            let state = turned.retract(&[Block::ObjectPose], &off.map(|v| v * scale));
            assert_gradient(&mixed, &state, Block::ObjectPose, 1e-6, 1e-5);
        }
    }

    #[test]
    fn deviations_must_be_positive() {
        let (_, start) = fixture(0);
        let none = PriorSettings { joints: 0.0, ..settings() };
        assert!(GaussianPrior::independent(start, &none).is_err());
    }

    #[test]
    fn independent_deviations_are_those_of_a_diagonal_covariance() {
        let (_, start) = fixture(0);
        let variances = settings().all_sigmas(&start).map(|sigma| sigma.powi(2));
        let covariance = DMatrix::from_diagonal(&variances);
        let full = GaussianPrior::correlated(start.clone(), &covariance).unwrap();
        let full = full.with_outliers();
        let diagonal = GaussianPrior::independent(start.clone(), &settings()).unwrap();
        let off: Vec<f64> = (0..variances.len()).map(|k| 0.01 * (k as f64 * 1.3).cos()).collect();
        let state = start.retract(&start.blocks(), &off);
        let mut equations = [0, 1].map(|_| NormalEquations::new(&start.blocks()));
        let costs = [
            full.linearize(&state, &mut equations[0]),
            diagonal.linearize(&state, &mut equations[1]),
        ];
        assert!((costs[0] / costs[1] - 1.0).abs() < 1e-8);
        let difference = equations[0].hessian() - equations[1].hessian();
        assert!(difference.amax() < 1e-7 * equations[1].hessian().amax());
        assert!((full.innovation(&state) / diagonal.innovation(&state) - 1.0).abs() < 1e-8);
    }

    #[test]
    fn correlated_deviations_have_their_covariance_and_derivatives() {
        let (_, start) = fixture(0);
        let n = settings().all_sigmas(&start).len();
        let mixed = DMatrix::from_fn(n, n, |r, c| ((r * 7 + c * 3) as f64).sin());
        let covariance = (&mixed * mixed.transpose() + DMatrix::identity(n, n)) * 1e-4;
        let prior = GaussianPrior::correlated(start.clone(), &covariance).unwrap();
        assert!(prior.cost(&start) < 1e-20 && prior.innovation(&start) < 1e-9);
        let blocks = start.blocks();
        let off: Vec<f64> = (0..n).map(|k| 0.02 * (k as f64 * 1.3).cos()).collect();
        // Small deviations are the parameters of the blocks themselves.
        let little: Vec<f64> = off.iter().map(|v| v * 1e-4).collect();
        let x = DVector::from_vec(little.clone());
        let expected = 0.5 * x.dot(&covariance.lu().solve(&x).unwrap());
        let found = prior.cost(&start.retract(&blocks, &little));
        assert!((found - expected).abs() < 1e-3 * expected, "{found} {expected}");
        let state = start.retract(&blocks, &off);
        let mut equations = NormalEquations::new(&blocks);
        let cost = prior.linearize(&state, &mut equations);
        assert!((cost - prior.cost(&state)).abs() < 1e-12 * cost);
        let of = |x: &[f64]| prior.cost(&state.retract(&blocks, x));
        let reference = finite_difference_gradient(of, &vec![0.0; n], 1e-6);
        let found: Vec<f64> = equations.gradient().iter().copied().collect();
        assert!(compare_gradients(&found, &reference).relative < 1e-5);
    }
}
