//! The paper's stability metric: how far an object is from staying where it is, measured by simulating.

use nalgebra::{Isometry3, Matrix6, Point3, SVector, Vector3, Vector6};
use prehend_autodiff::lie::{cross_matrix, so3_log};
use prehend_autodiff::{Fwd, Quadratic, Scalar};
use prehend_sim::prelude::*;
use prehend_sim::rollout::StepError;
use rayon::prelude::*;

/// Scales of displacement \[1/m\], rotation \[1/rad\], linear velocity \[s/m\] and angular velocity \[s/rad\] that make the residuals of
/// [`StabilityLoss`] dimensionless: relative to free fall under `gravity` \[m/s²\] for `time` \[s\], at whose end velocity and displacement score 1
/// each; rotations count as motion at `radius` \[m\] of the center of mass.
pub(super) fn weights_relative_to_fall(gravity: f64, time: f64, radius: f64) -> [f64; 4] {
    let (linear, displacement) = (1.0 / (gravity * time), 2.0 / (gravity * time * time));
    [displacement, displacement * radius, linear, linear * radius]
}

/// Simulated stability of a free object: the mean over three starts of the squared residuals (linear
/// and angular velocity, displacement and rotation from the start) at the end of a rollout from the given pose
/// under gravity and contacts. It is L_DP of the physics term.
///
/// The starts are those of Grasp'D: rest, and ±`perturbation` along (1, 1, 1).
#[derive(Clone, Debug)]
pub(super) struct StabilityLoss {
    /// The object among its surroundings.
    pub(super) model: Model,
    /// The object's body.
    pub(super) object: BodyId,
    /// Its mass properties.
    pub(super) rigid: RigidBody,
    /// Length of a rollout.
    pub(super) time_steps: TimeSteps,
    /// Speed of the perturbed starts along each axis \[m/s\].
    pub(super) perturbation: f64,
    /// Scales of the residuals ([`weights_relative_to_fall`]).
    pub(super) weights: [f64; 4],
}

/// Fraction of the longest stable step that is used, for semi-implicit Euler 1 of √5 − 1: derivatives of rollouts at the
/// limit grow.
const SAFETY: f64 = 1.0 / 1.236;

/// Starts of rollouts.
const STARTS: usize = 3;

impl StabilityLoss {
    /// The loss with the object at `pose` (`t_world_model`); dimensionless, infinite where residuals are too large to be squared.
    ///
    /// # Errors
    /// Where the simulation blows up (see [`Self::check`]) or cannot begin.
    pub(super) fn value(&self, pose: &Isometry3<f64>) -> Result<f64, SimulationError> {
        let rollout = |start: &BodyState| Ok(self.residual(&self.model, start)?.norm_squared());
        let rollouts: Vec<f64> =
            self.starts(pose).par_iter().map(rollout).collect::<Result<_, SimulationError>>()?;
        Ok(rollouts.iter().sum::<f64>() / STARTS as f64)
    }

    /// The loss and its derivatives by a left twist (translation \[m\], rotation \[rad\]) of `pose` about the point `center` (model
    /// frame); the loss is twice the value of the residuals' model. Under leaky smoothing these are the leaky derivatives.
    ///
    /// # Errors
    /// See [`Self::value`].
    pub(super) fn linearize(
        &self,
        pose: &Isometry3<f64>,
        center: &Point3<f64>,
    ) -> Result<Quadratic<6>, SimulationError> {
        let model = self.model.cast::<Fwd<6>>();
        let rollouts: Vec<SVector<Fwd<6>, 12>> = self
            .starts(pose)
            .par_iter()
            .map(|start| self.residual(&model, &start.pose_variables()))
            .collect::<Result<_, SimulationError>>()?;
        let mut sum = Quadratic::zeros();
        for residual in &rollouts {
            let mut rollout = Quadratic::zeros();
            for r in residual {
                rollout.add_row(&Vector6::from(r.derivative), r.value, 1.0);
            }
            sum += &rollout;
        }
        // A left twist about the center moves the center of mass by δt + δθ × (com − center).
        let com = pose * self.rigid.com();
        let mut chain = Matrix6::identity();
        chain.fixed_view_mut::<3, 3>(0, 3).copy_from(&-cross_matrix(&(com - center)));
        let count = STARTS as f64;
        Ok(Quadratic {
            value: sum.value / count,
            gradient: chain.tr_mul(&sum.gradient) / count,
            hessian: chain.transpose() * sum.hessian * chain / count,
        })
    }

    /// Checks that the time step resolves the contacts with the object at rest at `pose`: for their
    /// [`Model::contact_frequency`] ω, dt·ω is at most four fifths of [`Integrator::stability_limit`](prehend_sim::Integrator::stability_limit).
    ///
    /// # Errors
    /// With the longest step that does.
    pub(super) fn check(&self, pose: &Isometry3<f64>) -> Result<(), StepError> {
        let states = self.states(&self.model, self.rigid.at_rest(pose));
        let dt = self.time_steps.dt;
        let check = self.model.check_time_step(&SemiImplicitEuler, &states, dt / SAFETY);
        check.map_err(|StepError { limit, .. }| StepError { dt, limit: SAFETY * limit })
    }

    /// The object's states from which rollouts begin.
    fn starts(&self, pose: &Isometry3<f64>) -> [BodyState; STARTS] {
        let start =
            |speed: f64| BodyState { linear: Vector3::repeat(speed), ..self.rigid.at_rest(pose) };
        [0.0, self.perturbation, -self.perturbation].map(start)
    }

    /// The states of all bodies, the object in one of its own.
    fn states<S: Scalar>(&self, model: &Model<S>, object: BodyState<S>) -> State<S> {
        let mut states = model.neutral_state();
        states[self.object] = object;
        states
    }

    /// Displacement and rotation of the object since the start and its velocities, at the end of a rollout, scaled.
    fn residual<S: Scalar>(
        &self,
        model: &Model<S>,
        start: &BodyState<S>,
    ) -> Result<SVector<S, 12>, SimulationError> {
        let go_on = |_: Step, _: &mut Model<S>, _: &mut State<S>| ();
        let initial = self.states(model, *start);
        let end =
            model.simulate_controlled(&SemiImplicitEuler, &initial, self.time_steps, go_on)?;
        let state = &end.states[self.object];
        let shift = state.pose.translation.vector - start.pose.translation.vector;
        let turn = so3_log(&(state.pose.rotation * start.pose.rotation.inverse()));
        let parts = [shift, turn, state.linear, state.angular];
        Ok(SVector::from_fn(|i, _| parts[i / 3][i % 3].times(self.weights[i / 3])))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Matrix3;
    use prehend_autodiff::check::{compare_gradients, finite_difference_gradient};
    use prehend_autodiff::lie::perturb_about;
    use prehend_geometry::DistanceField;
    use prehend_sim::contact::LeakSteps;
    use prehend_sim::fields::{HalfSpace, SphereCavity};
    use prehend_sim::{Body, ContactBodies, Coulomb, GapSmoothing, KelvinVoigt, Law, Surface};

    use super::*;

    /// `count` points spread over an ellipsoid with half axes `axes` \[m\].
    fn ellipsoid(count: usize, axes: [f64; 3]) -> Vec<Point3<f64>> {
        let point = |i: usize| {
            let (t, z) = (2.4 * i as f64, 1.0 - (2 * i + 1) as f64 / count as f64);
            let r = (1.0 - z * z).sqrt();
            Point3::new(axes[0] * r * t.cos(), axes[1] * r * t.sin(), axes[2] * z)
        };
        (0..count).map(point).collect()
    }

    fn loss_on(field: Arc<dyn DistanceField>, smoothing: GapSmoothing) -> StabilityLoss {
        let inertia = Matrix3::from_diagonal(&Vector3::new(6e-5, 9e-5, 5e-5));
        let rigid = RigidBody::new(0.2, inertia, Point3::new(0.001, -0.002, 0.003)).unwrap();
        let surface = Surface::uniform(&ellipsoid(200, [0.03, 0.025, 0.02]), 6e-3).unwrap();
        let mut model = Model::new(Vector3::z() * -9.81);
        let field = model.add(Body::fixed("ground").with_field(field));
        let object = model.add(Body::dynamic("object", rigid).with_surface(surface));
        let spring = KelvinVoigt { stiffness: 2e7, damping: 5e4 };
        let law = Law::new(spring, Coulomb { friction: 0.5, slip_scale: 1e-2 }).unwrap();
        let bodies = ContactBodies { samples: object, field };
        model.add_contact(bodies, Arc::new(law), smoothing).unwrap();
        StabilityLoss {
            model,
            object,
            rigid,
            time_steps: TimeSteps { dt: 1e-3, steps: 20 },
            perturbation: 0.01,
            weights: weights_relative_to_fall(9.81, 0.02, 0.02),
        }
    }

    fn loss(smoothing: GapSmoothing) -> StabilityLoss {
        loss_on(Arc::new(HalfSpace::floor()), smoothing)
    }

    fn pose() -> Isometry3<f64> {
        Isometry3::new(Vector3::new(0.003, -0.002, 0.0195), Vector3::new(0.1, -0.15, 0.4))
    }

    #[test]
    fn gradient_matches_differences() {
        let bowl = Arc::new(SphereCavity { center: Point3::new(0.0, 0.0, 0.06), radius: 0.06 });
        let fields: [Arc<dyn DistanceField>; 2] = [Arc::new(HalfSpace::floor()), bowl];
        for field in fields {
            let loss = loss_on(field, GapSmoothing::Softplus { width: 3e-4 });
            let (pose, center) = (pose(), Point3::new(0.02, -0.01, 0.05));
            let Quadratic { value, gradient, hessian: normal } =
                loss.linearize(&pose, &center).unwrap();
            let (value, gradient) = (2.0 * value, 2.0 * gradient);
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
            assert!(error.relative < 1e-6, "{error:?}");
            assert!((normal - normal.transpose()).norm() <= 1e-12 * normal.norm());
            assert!(normal.symmetric_eigenvalues().min() >= -1e-9 * normal.norm());
        }
    }

    #[test]
    fn damped_gauss_newton_steps_settle_a_hovering_object() {
        let loss = loss(GapSmoothing::Softplus { width: 3e-4 });
        let mut pose = Isometry3::translation(0.0, 0.0, 0.0203);
        let (before, mut damping) = (loss.value(&pose).unwrap(), 1e-3);
        let mut now = before;
        for _ in 0..30 {
            let center = pose * loss.rigid.com();
            let Quadratic { gradient, hessian: normal, .. } =
                loss.linearize(&pose, &center).unwrap();
            let damped = normal + Matrix6::identity() * damping * normal.norm();
            let step = damped.cholesky().unwrap().solve(&-gradient);
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
        let mut loss = loss(GapSmoothing::Hard);
        assert_eq!(loss.check(&pose), Ok(()));
        loss.time_steps.dt = 1.0;
        let error = loss.check(&pose).unwrap_err();
        assert!(error.limit > 1e-3 && error.limit < 1.0, "{error}");
        loss.time_steps.dt = 0.999 * error.limit;
        assert_eq!(loss.check(&pose), Ok(()));
    }

    #[test]
    fn results_are_identical_on_any_number_of_threads() {
        let loss = loss(GapSmoothing::Softplus { width: 3e-4 });
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| loss.linearize(&pose(), &Point3::origin()))
        };
        assert_eq!(run(1), run(3));
    }

    #[test]
    fn free_fall_scores_one_for_velocity_and_one_for_displacement() {
        let mut loss = loss(GapSmoothing::Hard);
        loss.perturbation = 0.0;
        let high = Isometry3::translation(0.0, 0.0, 1.0);
        let Quadratic { value, gradient, .. } = loss.linearize(&high, &Point3::origin()).unwrap();
        // Semi-implicit Euler falls g dt² n(n+1)/2: by (n+1)/n further than ½gt².
        let displacement = 21.0 / 20.0;
        assert!((2.0 * value - (1.0 + displacement * displacement)).abs() < 1e-12, "{value}");
        assert!(gradient.norm() < 1e-12);
    }

    #[test]
    fn a_leak_changes_the_gradient_and_not_the_value() {
        let high = Isometry3::translation(0.0, 0.0, 0.025);
        let hard = loss(GapSmoothing::Hard);
        let steps = LeakSteps::All;
        let leaky = loss(GapSmoothing::Leaky { alpha: 0.1, band: 1e-2, steps });
        assert_eq!(hard.value(&high), leaky.value(&high));
        let center = Point3::origin();
        let gradient = |loss: &StabilityLoss| loss.linearize(&high, &center).unwrap().gradient;
        assert!(gradient(&hard).norm() < 1e-12);
        // Lower would be better.
        assert!(gradient(&leaky).z > 1e-3);
    }
}
