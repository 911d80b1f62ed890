//! The stability metric: how far an object is from staying where it is, measured by simulating.

use nalgebra::{Isometry3, Matrix6, Point3, SVector, Vector3, Vector6};
use prehend_autodiff::lie::{cross_matrix, so3_log};
use prehend_autodiff::{Fwd, Scalar};
use rayon::prelude::*;

use crate::contact_frequency::StepError;
use crate::error::SimulationError;
use crate::integrator::Integrator;
use crate::integrator::semi_implicit::SemiImplicitEuler;
use crate::state::State;
use crate::time::TimeSteps;
use crate::world::World;
use crate::world::body_id::BodyId;

/// An initial velocity that a stable object withstands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Perturbation {
    /// Velocity of the center of mass, world frame \[m/s\].
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
    /// Per displacement of the center of mass \[1/m\].
    pub displacement: f64,
    /// Per rotation \[1/rad\].
    pub rotation: f64,
    /// Which states are measured.
    pub averaging: Averaging,
}

impl StabilityWeights {
    /// Relative to free fall under `gravity` \[m/s²\] for `time` \[s\], which velocity and displacement
    /// then score 1 each at its end; rotations count as motion at `radius` \[m\] of the center of mass. Without gravity or time they are
    /// infinite, which [`StabilityLoss`] refuses.
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
pub struct StabilityLoss<I = SemiImplicitEuler> {
    /// What takes the steps.
    pub integrator: I,
    /// The object among its surroundings.
    pub world: World,
    /// States of all bodies; the object's own is replaced.
    pub states: Vec<State>,
    /// The object's body.
    pub object: BodyId,
    /// Length of a rollout.
    pub time_steps: TimeSteps,
    /// Initial velocities.
    pub perturbations: Vec<Perturbation>,
    /// Scales of the residuals.
    pub weights: StabilityWeights,
}

/// A [`StabilityLoss`] with its derivatives by a left twist (translation \[m\], rotation \[rad\]) of the object's pose.
///
/// With the residuals r and their Jacobian J the loss is |r|² and the gradient 2Jᵀr, so the Gauss–Newton step solves
/// JᵀJ δ = −gradient/2. Under leaky smoothing these are the leaky derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StabilityJacobian {
    /// The loss.
    pub value: f64,
    /// Its gradient.
    pub gradient: Vector6<f64>,
    /// JᵀJ.
    pub normal: Matrix6<f64>,
}

/// Fraction of the longest stable step that is used, for semi-implicit Euler 1 of √5 − 1: derivatives of rollouts at the
/// limit grow.
const SAFETY: f64 = 1.0 / 1.236;

impl<I: Integrator> StabilityLoss<I> {
    /// The loss with the object at `pose` (`t_world_model`); dimensionless.
    ///
    /// # Errors
    /// Where the simulation blows up (see [`Self::check`]) or cannot begin; without perturbations, or if a weight is not finite.
    pub fn value(&self, pose: &Isometry3<f64>) -> Result<f64, SimulationError> {
        self.check_settings()?;
        let rollouts: Vec<f64> = self
            .perturbations
            .par_iter()
            .map(|perturbation| {
                let mut states = self.states.clone();
                states[self.object] = self.initial(pose, perturbation)?;
                let mut sum = 0.0;
                self.measure(&self.world, &states, |weight, residual| {
                    sum += weight * residual.norm_squared();
                })?;
                Ok(sum)
            })
            .collect::<Result<_, SimulationError>>()?;
        let value = rollouts.iter().sum::<f64>() / self.count();
        if value.is_finite() { Ok(value) } else { Err(self.blown_up(pose)) }
    }

    /// The loss and its derivatives by a twist of `pose` about the point `center` (world frame).
    ///
    /// # Errors
    /// See [`Self::value`].
    pub fn linearize(
        &self,
        pose: &Isometry3<f64>,
        center: &Point3<f64>,
    ) -> Result<StabilityJacobian, SimulationError> {
        self.check_settings()?;
        let world = self.world.lift::<Fwd<6>>();
        let constants: Vec<State<Fwd<6>>> = self.states.iter().map(State::lift).collect();
        let rollouts: Vec<StabilityJacobian> = self
            .perturbations
            .par_iter()
            .map(|perturbation| {
                let mut states = constants.clone();
                states[self.object] = self.initial(pose, perturbation)?.pose_variables();
                let (mut value, mut gradient, mut normal) =
                    (0.0, Vector6::zeros(), Matrix6::zeros());
                self.measure(&world, &states, |weight, residual| {
                    for r in &residual {
                        let slope = Vector6::from(r.derivative);
                        value += weight * r.value * r.value;
                        gradient += slope * (2.0 * weight * r.value);
                        normal += slope * slope.transpose() * weight;
                    }
                })?;
                Ok(StabilityJacobian { value, gradient, normal })
            })
            .collect::<Result<_, SimulationError>>()?;
        let (mut value, mut gradient, mut normal) = (0.0, Vector6::zeros(), Matrix6::zeros());
        for rollout in &rollouts {
            value += rollout.value;
            gradient += rollout.gradient;
            normal += rollout.normal;
        }
        // A left twist about the center moves the center of mass by δt + δθ × (com − center).
        let com = pose * self.world.bodies[self.object].com();
        let mut chain = Matrix6::identity();
        chain.fixed_view_mut::<3, 3>(0, 3).copy_from(&-cross_matrix(&(com - center)));
        let count = self.count();
        let (gradient, normal) = (chain.tr_mul(&gradient), chain.transpose() * normal * chain);
        let mut numbers = gradient.iter().chain(normal.iter()).chain(std::iter::once(&value));
        if !numbers.all(|x| x.is_finite()) {
            return Err(self.blown_up(pose));
        }
        let (value, gradient, normal) = (value / count, gradient / count, normal / count);
        Ok(StabilityJacobian { value, gradient, normal })
    }

    /// Checks that the time step resolves the contacts with the object at rest at `pose`: for their
    /// [`World::contact_frequency`] ω, dt·ω is at most four fifths of [`Integrator::stability_limit`].
    ///
    /// # Errors
    /// With the longest step that does.
    pub fn check(&self, pose: &Isometry3<f64>) -> Result<(), StepError> {
        let mut states = self.states.clone();
        if let Some(rigid) = self.world.bodies[self.object].rigid() {
            states[self.object] = rigid.at_rest(pose);
        }
        let dt = self.time_steps.dt;
        let check = self.world.check_time_step(&self.integrator, &states, dt / SAFETY);
        check.map_err(|StepError { limit, .. }| StepError { dt, limit: SAFETY * limit })
    }

    fn check_settings(&self) -> Result<(), SimulationError> {
        if self.perturbations.is_empty() {
            return Err(SimulationError::NoPerturbations);
        }
        let StabilityWeights { linear, angular, displacement, rotation, .. } = self.weights;
        let weights = [
            ("StabilityWeights::linear", linear),
            ("StabilityWeights::angular", angular),
            ("StabilityWeights::displacement", displacement),
            ("StabilityWeights::rotation", rotation),
        ];
        match weights.into_iter().find(|(_, value)| !value.is_finite()) {
            Some((setting, value)) => {
                Err(SimulationError::Setting { setting, range: "finite", value })
            }
            None => Ok(()),
        }
    }

    /// The error of rollouts from `pose` whose residuals are too large to be squared.
    fn blown_up(&self, pose: &Isometry3<f64>) -> SimulationError {
        let TimeSteps { dt, steps } = self.time_steps;
        let mut states = self.states.clone();
        if let Some(rigid) = self.world.bodies[self.object].rigid() {
            states[self.object] = rigid.at_rest(pose);
        }
        self.world.not_finite_at(self.object.index(), &states, dt * steps as f64)
    }

    fn count(&self) -> f64 {
        self.perturbations.len().max(1) as f64
    }

    fn initial(
        &self,
        pose: &Isometry3<f64>,
        perturbation: &Perturbation,
    ) -> Result<State, SimulationError> {
        let body = self.world.body(self.object)?;
        let states = self.states.len();
        if states != self.world.joint_places().end {
            return Err(self.world.wrong_count(states));
        }
        let rigid =
            body.rigid().ok_or_else(|| SimulationError::NotFree { body: body.name.clone() })?;
        let Perturbation { linear, angular } = *perturbation;
        Ok(State { linear, angular, ..rigid.at_rest(pose) })
    }

    /// Simulates from `initial` and hands the residuals that count to `visit`, each with its weight: those of the last
    /// step, or of all.
    fn measure<S: Scalar>(
        &self,
        world: &World<S>,
        initial: &[State<S>],
        mut visit: impl FnMut(f64, SVector<S, 12>),
    ) -> Result<(), SimulationError> {
        let (start, steps) = (&initial[self.object], self.time_steps.steps);
        let residual = |states: &[State<S>]| self.residual(start, &states[self.object]);
        let every = self.weights.averaging == Averaging::Mean;
        let weight = 1.0 / steps.max(1) as f64;
        let begun = world.begin(initial, self.time_steps)?;
        let last = world.march(&self.integrator, begun, self.time_steps, |_, states| {
            if every {
                visit(weight, residual(states));
            }
            Ok(())
        })?;
        if !every {
            visit(1.0, residual(&last));
        }
        Ok(())
    }

    /// What the object should not do: velocities, displacement and rotation since the start, scaled.
    fn residual<S: Scalar>(&self, initial: &State<S>, state: &State<S>) -> SVector<S, 12> {
        let w = &self.weights;
        let shift = state.pose.translation.vector - initial.pose.translation.vector;
        let turn = so3_log(&(state.pose.rotation * initial.pose.rotation.inverse()));
        let parts = [
            (shift, w.displacement),
            (turn, w.rotation),
            (state.linear, w.linear),
            (state.angular, w.angular),
        ];
        SVector::from_fn(|i, _| parts[i / 3].0[i % 3].times(parts[i / 3].1))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Matrix3;
    use prehend_autodiff::check::{compare_gradients, finite_difference_gradient};
    use prehend_autodiff::lie::perturb_about;
    use prehend_geometry::DistanceField;

    use super::*;
    use crate::scenes::{ellipsoid, floor, on_ground, penalty};
    use crate::{
        Body, DynContactLaw, GapSmoothing, LawRegistry, LeakSteps, RigidBody, SphereCavity, Surface,
    };

    fn loss_on(
        field: Arc<dyn DistanceField>,
        law: Arc<dyn DynContactLaw>,
        smoothing: GapSmoothing,
        averaging: Averaging,
    ) -> StabilityLoss {
        let inertia = Matrix3::from_diagonal(&Vector3::new(6e-5, 9e-5, 5e-5));
        let rigid = RigidBody::new(0.2, inertia, Point3::new(0.001, -0.002, 0.003)).unwrap();
        let surface = Surface::uniform(&ellipsoid(200, [0.03, 0.025, 0.02]), 6e-3).unwrap();
        let object = Body::free("object", rigid).with_surface(surface);
        let world = on_ground(Vector3::z() * -9.81, field, object, law, smoothing);
        let mut weights = StabilityWeights::relative_to_fall(9.81, 0.02, 0.02);
        weights.averaging = averaging;
        StabilityLoss {
            integrator: SemiImplicitEuler,
            world,
            states: vec![State::at_rest(Isometry3::identity()); 2],
            object: BodyId(1),
            time_steps: TimeSteps { dt: 1e-3, steps: 20 },
            perturbations: Perturbation::rest_and_diagonal(0.01),
            weights,
        }
    }

    fn law() -> Arc<dyn DynContactLaw> {
        Arc::new(penalty(2e7, 5e4, 0.5, 1e-2))
    }

    fn loss(smoothing: GapSmoothing, averaging: Averaging) -> StabilityLoss {
        loss_on(floor(), law(), smoothing, averaging)
    }

    fn pose() -> Isometry3<f64> {
        Isometry3::new(Vector3::new(0.003, -0.002, 0.0195), Vector3::new(0.1, -0.15, 0.4))
    }

    #[test]
    fn gradient_matches_differences() {
        let bowl = Arc::new(SphereCavity { center: Point3::new(0.0, 0.0, 0.06), radius: 0.06 });
        let fields: [Arc<dyn DistanceField>; 2] = [floor(), bowl];
        for (field, averaging) in
            fields.iter().flat_map(|f| [(f, Averaging::Final), (f, Averaging::Mean)])
        {
            let smoothing = GapSmoothing::Softplus { width: 3e-4 };
            let loss = loss_on(Arc::clone(field), law(), smoothing, averaging);
            let (pose, center) = (pose(), Point3::new(0.02, -0.01, 0.05));
            let StabilityJacobian { value, gradient, normal } =
                loss.linearize(&pose, &center).unwrap();
            assert!((value - loss.value(&pose).unwrap()).abs() <= 1e-9 * value && value > 0.0);
            let differences = finite_difference_gradient(
                |x| {
                    let twist = Vector6::from_column_slice(x);
                    loss.value(&perturb_about(&pose, &center.coords, &twist)).unwrap()
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
        let loss = loss(GapSmoothing::Softplus { width: 3e-4 }, Averaging::Final);
        let mut pose = Isometry3::translation(0.0, 0.0, 0.0203);
        let (before, mut damping) = (loss.value(&pose).unwrap(), 1e-3);
        let mut now = before;
        for _ in 0..30 {
            let center = pose * loss.world.bodies[1].com();
            let StabilityJacobian { gradient, normal, .. } =
                loss.linearize(&pose, &center).unwrap();
            let damped = normal + Matrix6::identity() * damping * normal.norm();
            let step = damped.cholesky().unwrap().solve(&(gradient * -0.5));
            let candidate = perturb_about(&pose, &center.coords, &step);
            let value = loss.value(&candidate).unwrap();
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
        let pose = pose();
        let mut loss = loss(GapSmoothing::Hard, Averaging::Final);
        assert_eq!(loss.check(&pose), Ok(()));
        loss.time_steps.dt = 1.0;
        let error = loss.check(&pose).unwrap_err();
        assert!(error.limit > 1e-3 && error.limit < 1.0, "{error}");
        loss.time_steps.dt = 0.999 * error.limit;
        assert_eq!(loss.check(&pose), Ok(()));
    }

    #[test]
    fn a_law_by_name_gives_the_same_loss() {
        let (smoothing, averaging) = (GapSmoothing::Softplus { width: 3e-4 }, Averaging::Mean);
        let law = LawRegistry::default().create("penalty", &[2e7, 5e4, 0.5, 1e-2]).unwrap();
        let by_name = loss_on(floor(), law.into(), smoothing, averaging);
        let expected = loss(smoothing, averaging).linearize(&pose(), &Point3::origin());
        assert_eq!(by_name.linearize(&pose(), &Point3::origin()), expected);
    }

    #[test]
    fn results_are_identical_on_any_number_of_threads() {
        let loss = loss(GapSmoothing::Softplus { width: 3e-4 }, Averaging::Mean);
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| loss.linearize(&pose(), &Point3::origin()))
        };
        assert_eq!(run(1), run(3));
    }

    #[test]
    fn free_fall_scores_one_for_velocity_and_one_for_displacement() {
        let mut loss = loss(GapSmoothing::Hard, Averaging::Final);
        loss.perturbations.truncate(1);
        let high = Isometry3::translation(0.0, 0.0, 1.0);
        let StabilityJacobian { value, gradient, .. } =
            loss.linearize(&high, &Point3::origin()).unwrap();
        // Semi-implicit Euler falls g dt² n(n+1)/2: by (n+1)/n further than ½gt².
        let displacement = 21.0 / 20.0;
        assert!((value - (1.0 + displacement * displacement)).abs() < 1e-12, "{value}");
        assert!(gradient.norm() < 1e-12);
    }

    #[test]
    fn a_leak_changes_the_gradient_and_not_the_value() {
        let high = Isometry3::translation(0.0, 0.0, 0.025);
        let hard = loss(GapSmoothing::Hard, Averaging::Final);
        let steps = LeakSteps::All;
        let leaky = loss(GapSmoothing::Leaky { alpha: 0.1, band: 1e-2, steps }, Averaging::Final);
        assert_eq!(hard.value(&high), leaky.value(&high));
        let center = Point3::origin();
        let gradient = |loss: &StabilityLoss| loss.linearize(&high, &center).unwrap().gradient;
        assert!(gradient(&hard).norm() < 1e-12);
        // Lower would be better.
        assert!(gradient(&leaky).z > 1e-3);
    }

    #[test]
    fn a_loss_of_something_that_cannot_move_is_refused() {
        let mut loss = loss(GapSmoothing::Hard, Averaging::Final);
        loss.object = BodyId(0);
        let error = loss.value(&pose()).unwrap_err();
        assert_eq!(error, SimulationError::NotFree { body: "ground".to_owned() });
    }
}
