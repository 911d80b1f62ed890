//! The stability metric: how far an object is from staying where it is, measured by simulating.

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Vector3, Vector6};
use prehend_autodiff::lie::{cross_matrix, so3_left_jacobian_inverse, so3_log};
use prehend_geometry::DistanceField;
use rayon::prelude::*;

use crate::body::{RigidBody, SurfacePoint};
use crate::contact::law::LocalLaw;
use crate::contact::onset::Onset;
use crate::contact::stiffness::{StepError, check_time_step};
use crate::contact::wrench::contact_wrench_jacobian;
use crate::integrator::Vector12;
use crate::rollout::{Matrix12x6, Simulation};
use crate::state::State;

/// An initial velocity that a stable object withstands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Perturbation {
    /// Velocity of the centre of mass, world frame \[m/s\].
    pub linear: Vector3<f64>,
    /// Angular velocity, world frame \[rad/s\].
    pub angular: Vector3<f64>,
}

impl Perturbation {
    /// Rest, and ±`speed` \[m/s\] along (1, 1, 1): the metric of Grasp'D with `speed` = 0.01.
    pub fn rest_and_diagonal(speed: f64) -> Vec<Self> {
        [0.0, speed, -speed]
            .map(|s| Self { linear: Vector3::repeat(s), angular: Vector3::zeros() })
            .to_vec()
    }
}

/// Which states of a rollout are measured.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Averaging {
    /// The last one.
    Final,
    /// The mean of the squares over all steps.
    Mean,
}

/// Scales that make the residuals of [`StabilityLoss`] dimensionless; zero leaves one out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StabilityWeights {
    /// Per linear velocity \[s/m\].
    pub linear: f64,
    /// Per angular velocity \[s/rad\].
    pub angular: f64,
    /// Per displacement of the centre of mass \[1/m\].
    pub displacement: f64,
    /// Per rotation \[1/rad\].
    pub rotation: f64,
    /// Which states are measured.
    pub averaging: Averaging,
}

impl StabilityWeights {
    /// Relative to free fall under `gravity` \[m/s²\] for `time` \[s\], which velocity and displacement
    /// then score 1 each at its end; rotations count as motion at `radius` \[m\] of the centre of mass.
    pub fn relative_to_fall(gravity: f64, time: f64, radius: f64) -> Self {
        let (linear, displacement) = (1.0 / (gravity * time), 2.0 / (gravity * time * time));
        Self {
            linear,
            angular: linear * radius,
            displacement,
            rotation: displacement * radius,
            averaging: Averaging::Final,
        }
    }
}

/// Simulated stability of a free object: the mean over `perturbations` of the squared residuals (linear
/// and angular velocity, displacement and rotation from the start) of a rollout from the given pose
/// under gravity and contacts. It is L_DP of the physics term.
#[derive(Clone, Debug)]
pub struct StabilityLoss<L> {
    /// The object.
    pub body: RigidBody,
    /// Its surface samples.
    pub points: Vec<SurfacePoint>,
    /// Gravity, world frame \[m/s²\].
    pub gravity: Vector3<f64>,
    /// Contact law.
    pub law: L,
    /// How contact begins.
    pub onset: Onset,
    /// Time step \[s\].
    pub dt: f64,
    /// Steps of a rollout.
    pub steps: usize,
    /// Initial velocities.
    pub perturbations: Vec<Perturbation>,
    /// Scales of the residuals.
    pub weights: StabilityWeights,
}

/// Sum over one rollout of |r|², Jᵀr and JᵀJ.
type Sums = (f64, Vector6<f64>, Matrix6<f64>);

impl<L: LocalLaw> StabilityLoss<L> {
    /// The loss at `pose` (`t_world_model`) against the fixed `field` (world frame); dimensionless.
    /// Not finite where the simulation blows up: see [`Self::check`].
    pub fn value(&self, pose: &Isometry3<f64>, field: &dyn DistanceField) -> f64 {
        let rollouts: Vec<f64> = self
            .perturbations
            .par_iter()
            .map(|perturbation| {
                let initial = self.initial(pose, perturbation);
                let states = self.simulation().rollout(&initial, field, self.steps);
                let squares = self
                    .measured(&states)
                    .map(|(state, weight)| weight * self.residual(&initial, state).norm_squared());
                squares.sum()
            })
            .collect();
        rollouts.iter().sum::<f64>() / self.count()
    }

    /// The loss, its gradient and JᵀJ by a left twist (translation \[m\], rotation \[rad\]) of `pose` about
    /// the point `center` (world frame).
    ///
    /// With the residuals r and their Jacobian J the loss is |r|² and the gradient 2Jᵀr, so the
    /// Gauss–Newton step solves JᵀJ δ = −gradient/2. Under a leaky onset these are the leaky derivatives.
    pub fn linearise(
        &self,
        pose: &Isometry3<f64>,
        field: &dyn DistanceField,
        center: &Point3<f64>,
    ) -> (f64, Vector6<f64>, Matrix6<f64>) {
        let rollouts: Vec<Sums> = self
            .perturbations
            .par_iter()
            .map(|perturbation| {
                let initial = self.initial(pose, perturbation);
                let simulation = self.simulation();
                let states = simulation.rollout_with_sensitivities(&initial, field, self.steps);
                let mut sums = (0.0, Vector6::zeros(), Matrix6::zeros());
                for ((state, sensitivity), weight) in self.measured(&states) {
                    let residual = self.residual(&initial, state);
                    let jacobian = self.residual_jacobian(&initial, state, sensitivity);
                    sums.0 += weight * residual.norm_squared();
                    sums.1 += jacobian.tr_mul(&residual) * weight;
                    sums.2 += jacobian.tr_mul(&jacobian) * weight;
                }
                sums
            })
            .collect();
        let mut total = (0.0, Vector6::zeros(), Matrix6::zeros());
        for (value, gradient, normal) in &rollouts {
            total.0 += value;
            total.1 += gradient;
            total.2 += normal;
        }
        // A left twist about the centre moves the centre of mass by δt + δθ × (com − center).
        let com = pose * self.body.com();
        let mut chain = Matrix6::identity();
        chain.fixed_view_mut::<3, 3>(0, 3).copy_from(&-cross_matrix(&(com - center)));
        let count = self.count();
        let gradient = chain.tr_mul(&total.1) * (2.0 / count);
        (total.0 / count, gradient, chain.transpose() * total.2 * chain / count)
    }

    /// Whether `dt` resolves the contacts at `pose`, at rest.
    ///
    /// # Errors
    /// With the longest step that does: see [`check_time_step`].
    pub fn check(&self, pose: &Isometry3<f64>, field: &dyn DistanceField) -> Result<(), StepError> {
        let state = State::at_rest(&self.body, pose);
        let contact =
            contact_wrench_jacobian(&self.law, self.onset, self.points.iter(), &state, field);
        check_time_step(&self.body, &state.pose.rotation, &contact, self.dt)
    }

    fn count(&self) -> f64 {
        self.perturbations.len().max(1) as f64
    }

    fn simulation(&self) -> Simulation<'_, L> {
        Simulation {
            body: &self.body,
            points: &self.points,
            gravity: self.gravity,
            law: &self.law,
            onset: self.onset,
            dt: self.dt,
        }
    }

    fn initial(&self, pose: &Isometry3<f64>, perturbation: &Perturbation) -> State {
        let Perturbation { linear, angular } = *perturbation;
        State { linear, angular, ..State::at_rest(&self.body, pose) }
    }

    /// The states that count, in the order of time, each with its weight: the last one, or the mean of all.
    fn measured<'s, T>(&self, states: &'s [T]) -> impl Iterator<Item = (&'s T, f64)> {
        let count = match self.weights.averaging {
            Averaging::Final => 1,
            Averaging::Mean => self.steps.max(1),
        };
        let weight = 1.0 / count as f64;
        states.iter().rev().take(count).rev().map(move |state| (state, weight))
    }

    /// What the object should not do: velocities, displacement and rotation since the start, scaled.
    fn residual(&self, initial: &State, state: &State) -> Vector12 {
        let w = &self.weights;
        let shift = state.pose.translation.vector - initial.pose.translation.vector;
        let turn = so3_log(&(state.pose.rotation * initial.pose.rotation.inverse()));
        let mut residual = Vector12::zeros();
        residual.fixed_rows_mut::<3>(0).copy_from(&(shift * w.displacement));
        residual.fixed_rows_mut::<3>(3).copy_from(&(turn * w.rotation));
        residual.fixed_rows_mut::<3>(6).copy_from(&(state.linear * w.linear));
        residual.fixed_rows_mut::<3>(9).copy_from(&(state.angular * w.angular));
        residual
    }

    /// Derivative of [`Self::residual`] by the initial twist about the centre of mass.
    fn residual_jacobian(
        &self,
        initial: &State,
        state: &State,
        sensitivity: &Matrix12x6,
    ) -> Matrix12x6 {
        let w = &self.weights;
        let turned = state.pose.rotation * initial.pose.rotation.inverse();
        let mut jacobian = *sensitivity;
        // The start moves as well: by δt, and exp(log) = R R₀⁻¹ by R's turn less R₀'s, carried along.
        let mut shift = jacobian.fixed_view_mut::<3, 3>(0, 0);
        shift -= Matrix3::identity();
        let mut turn = jacobian.fixed_view_mut::<3, 3>(3, 3);
        turn -= turned.to_rotation_matrix().matrix();
        let log = so3_left_jacobian_inverse(&so3_log(&turned));
        let rotation = log * jacobian.fixed_rows::<3>(3) * w.rotation;
        jacobian.fixed_rows_mut::<3>(3).copy_from(&rotation);
        for (row, scale) in [(0, w.displacement), (6, w.linear), (9, w.angular)] {
            jacobian.fixed_rows_mut::<3>(row).scale_mut(scale);
        }
        jacobian
    }
}

#[cfg(test)]
mod tests {
    use prehend_autodiff::check::{compare_gradients, finite_difference_gradient};
    use prehend_autodiff::lie::perturb_about;

    use super::*;
    use crate::fields::{HalfSpace, SphereCavity};
    use crate::{LawRegistry, LeakSteps, Penalty};

    fn loss(onset: Onset, averaging: Averaging) -> StabilityLoss<Penalty> {
        let inertia = Matrix3::from_diagonal(&Vector3::new(6e-5, 9e-5, 5e-5));
        let body = RigidBody::new(0.2, inertia, Point3::new(0.001, -0.002, 0.003)).unwrap();
        let (points, areas): (Vec<_>, Vec<_>) = (0..200)
            .map(|i| {
                let (t, z) = (2.4 * f64::from(i), 1.0 - (f64::from(i) + 0.5) / 100.0);
                let r = (1.0 - z * z).sqrt();
                (Point3::new(0.03 * r * t.cos(), 0.025 * r * t.sin(), 0.02 * z), 3e-5)
            })
            .unzip();
        let points = body.surface_points(&points, &areas).unwrap();
        let mut weights = StabilityWeights::relative_to_fall(9.81, 0.02, 0.02);
        weights.averaging = averaging;
        StabilityLoss {
            body,
            points,
            gravity: Vector3::new(0.0, 0.0, -9.81),
            law: Penalty::new(2e7, 5e4, 0.5, 1e-2).unwrap(),
            onset,
            dt: 1e-3,
            steps: 20,
            perturbations: Perturbation::rest_and_diagonal(0.01),
            weights,
        }
    }

    fn pose() -> Isometry3<f64> {
        Isometry3::new(Vector3::new(0.003, -0.002, 0.0195), Vector3::new(0.1, -0.15, 0.4))
    }

    #[test]
    fn gradient_matches_differences() {
        let bowl = SphereCavity { center: Point3::new(0.0, 0.0, 0.06), radius: 0.06 };
        let fields: [&dyn DistanceField; 2] = [&HalfSpace::floor(), &bowl];
        for (field, averaging) in
            fields.into_iter().flat_map(|f| [(f, Averaging::Final), (f, Averaging::Mean)])
        {
            let loss = loss(Onset::Softplus { width: 3e-4 }, averaging);
            let (pose, center) = (pose(), Point3::new(0.02, -0.01, 0.05));
            let (value, gradient, normal) = loss.linearise(&pose, field, &center);
            assert!((value - loss.value(&pose, field)).abs() <= 1e-9 * value && value > 0.0);
            let differences = finite_difference_gradient(
                |x| {
                    let twist = Vector6::from_column_slice(x);
                    loss.value(&perturb_about(&pose, &center.coords, &twist), field)
                },
                &[0.0; 6],
                2e-6,
            );
            let error = compare_gradients(gradient.as_slice(), &differences);
            assert!(error.relative < 1e-6, "{averaging:?} {error:?}");
            assert!((normal - normal.transpose()).norm() <= 1e-12 * normal.norm());
            assert!(normal.symmetric_eigenvalues().min() >= -1e-9 * normal.norm());
        }
    }

    #[test]
    fn damped_gauss_newton_steps_settle_a_hovering_object() {
        let loss = loss(Onset::Softplus { width: 3e-4 }, Averaging::Final);
        let floor = HalfSpace::floor();
        let mut pose = Isometry3::translation(0.0, 0.0, 0.0203);
        let (before, mut damping) = (loss.value(&pose, &floor), 1e-3);
        let mut now = before;
        for _ in 0..30 {
            let center = pose * loss.body.com();
            let (_, gradient, normal) = loss.linearise(&pose, &floor, &center);
            let damped = normal + Matrix6::identity() * damping * normal.norm();
            let step = damped.cholesky().unwrap().solve(&(gradient * -0.5));
            let candidate = perturb_about(&pose, &center.coords, &step);
            let value = loss.value(&candidate, &floor);
            if value < now {
                (pose, now, damping) = (candidate, value, 0.3 * damping);
            } else {
                damping *= 4.0;
            }
        }
        assert!(now < 0.1 * before, "{before} {now}");
    }

    #[test]
    fn too_long_a_step_is_refused_with_one_that_passes() {
        let (floor, pose) = (HalfSpace::floor(), pose());
        let mut loss = loss(Onset::Hard, Averaging::Final);
        assert_eq!(loss.check(&pose, &floor), Ok(()));
        loss.dt = 1.0;
        let error = loss.check(&pose, &floor).unwrap_err();
        assert!(error.limit > 1e-3 && error.limit < 1.0, "{error}");
        loss.dt = 0.999 * error.limit;
        assert_eq!(loss.check(&pose, &floor), Ok(()));
    }

    #[test]
    fn a_law_by_name_gives_the_same_loss() {
        let named = loss(Onset::Softplus { width: 3e-4 }, Averaging::Mean);
        let law =
            LawRegistry::default().create("penalty", &[2e7, 5e4, 0.5, 1e-2]).unwrap().unwrap();
        let StabilityLoss {
            body, points, gravity, onset, dt, steps, perturbations, weights, ..
        } = named.clone();
        let boxed =
            StabilityLoss { body, points, gravity, law, onset, dt, steps, perturbations, weights };
        let (floor, center) = (HalfSpace::floor(), Point3::origin());
        let expected = named.linearise(&pose(), &floor, &center);
        assert_eq!(boxed.linearise(&pose(), &floor, &center), expected);
    }

    #[test]
    fn results_are_identical_on_any_number_of_threads() {
        let loss = loss(Onset::Softplus { width: 3e-4 }, Averaging::Mean);
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| loss.linearise(&pose(), &HalfSpace::floor(), &Point3::origin()))
        };
        assert_eq!(run(1), run(3));
    }

    #[test]
    fn free_fall_scores_one_for_velocity_and_one_for_displacement() {
        let mut loss = loss(Onset::Hard, Averaging::Final);
        loss.perturbations.truncate(1);
        let high = Isometry3::translation(0.0, 0.0, 1.0);
        let (value, gradient, _) = loss.linearise(&high, &HalfSpace::floor(), &Point3::origin());
        // Semi-implicit Euler falls g dt² n(n+1)/2: by (n+1)/n further than ½gt².
        let displacement = 21.0 / 20.0;
        assert!((value - (1.0 + displacement * displacement)).abs() < 1e-12, "{value}");
        assert_eq!(gradient, Vector6::zeros());
    }

    #[test]
    fn a_leak_changes_the_gradient_and_not_the_value() {
        let high = Isometry3::translation(0.0, 0.0, 0.025);
        let floor = HalfSpace::floor();
        let hard = loss(Onset::Hard, Averaging::Final);
        let steps = LeakSteps::All;
        let leaky = loss(Onset::Leaky { alpha: 0.1, band: 1e-2, steps }, Averaging::Final);
        assert_eq!(hard.value(&high, &floor), leaky.value(&high, &floor));
        let center = Point3::origin();
        assert_eq!(hard.linearise(&high, &floor, &center).1, Vector6::zeros());
        // Lower would be better.
        assert!(leaky.linearise(&high, &floor, &center).1.z > 0.0);
    }
}
