//! Physics: an object held in a hand stays where it is. Measured by simulating.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3};
use prehend_autodiff::Quadratic;
use prehend_sim::contact::LeakSteps;
use prehend_sim::{
    Body, ContactBodies, ContactCalibration, Coulomb, GapSmoothing, KelvinVoigt, Law, Model,
    RigidBody, Surface, TimeSteps, rollout::StepError,
};

use super::stability_loss::{StabilityLoss, weights_relative_to_fall};
use crate::defaults::settings;
use crate::error::RefineError;
use crate::problem::{Block, Factor, NormalEquations, State};
use crate::scene::{PreparedFrame, check_gravity};

settings! {
    /// Settings of the stability factor.
    pub struct StabilitySettings {
        /// Nats per unit of ln(1 + L_DP), where L_DP is 1 for an object in free fall.
        pub weight: f64 = 4.0,
        /// Standard deviation of the object's displacement from the initial pose \[m\]: λ = 1/(2σ²).
        pub displacement_sigma: f64 = 0.05,
        /// Depth to which the object's weight presses it in \[m\]; sets the contact stiffness.
        pub penetration: f64 = 1e-3,
        /// Area that is assumed to carry the weight \[m²\]; sets the contact stiffness.
        pub contact_area: f64 = 2e-3,
        /// Damping ratio of the contact.
        pub damping_ratio: f64 = 0.2,
        /// Coefficient of friction.
        pub friction: f64 = 0.5,
        /// Slip speed that regularizes friction \[m/s\].
        pub slip_scale: f64 = 5e-2,
        /// Length of a rollout \[s\].
        pub time: f64 = 10e-3,
        /// Steps of a rollout at least, and at most where stiff contact needs shorter ones.
        pub steps: (usize, usize) = (20, 200),
        /// Speed of the perturbed starts \[m/s\].
        pub perturbation: f64 = 0.01,
        /// Derivative of contacts not yet made, and the distance up to which they are felt \[m\].
        pub leak: (f64, f64) = (0.1, 2e-3),
    }
}

/// Stability loss of a rollout that blew up.
const BLOWN_UP: f64 = f64::MAX;

/// The paper's L_phys = L_DP + λ‖Δt‖².
///
/// L_DP is how fast and how far the object has moved after a short rollout under gravity and penalty
/// contact with the hand, from rest and from two small pushes, relative to free fall. It enters through
/// a logarithm: one centimeter of penetration throws the object out at hundreds of g, and must count as
/// wrong, not as a thousand times more wrong than everything the camera says.
pub struct StabilityFactor {
    stability: StabilityLoss,
    initial_center: Vector3<f64>,
    settings: StabilitySettings,
}

impl StabilityFactor {
    /// Prepares rollouts of the object in the hand of `frame`; displacement is from `initial`.
    ///
    /// # Errors
    /// If gravity or the hand is unknown, gravity is none ([`check_gravity`]), or the object cannot be simulated.
    pub fn new(
        frame: &PreparedFrame<'_>,
        initial: &State,
        settings: StabilitySettings,
    ) -> Result<Self, RefineError> {
        let missing = RefineError::Missing { what: "gravity", factor: "stability" };
        let gravity = frame.observation().gravity.ok_or(missing)?;
        check_gravity(&gravity)
            .map_err(|problem| RefineError::Gravity { factor: "stability", problem })?;
        let hand = frame.require_hand("stability")?;
        let robot = &hand.hand;
        let object = frame.object();
        let fail = |reason: String| RefineError::Object { object: object.name.clone(), reason };
        let inertial = &object.inertial;
        let rigid = RigidBody::new(inertial.mass, inertial.inertia, inertial.center_of_mass)
            .map_err(|e| fail(e.to_string()))?;
        let positions: Vec<Point3<f64>> = object.samples.iter().map(|s| s.point).collect();
        let surface = Surface::uniform(&positions, object.area).map_err(|e| fail(e.to_string()))?;
        let g = gravity.norm();
        let target = ContactCalibration {
            mass: inertial.mass,
            gravity: g,
            penetration: settings.penetration,
            contact_area: settings.contact_area,
        };
        let (stiffness, damping) = (target.stiffness(1.0), target.damping(settings.damping_ratio));
        let friction = Coulomb { friction: settings.friction, slip_scale: settings.slip_scale };
        let law = Law::new(KelvinVoigt { stiffness, damping }, friction)
            .map_err(|e| fail(e.to_string()))?;
        let (alpha, band) = settings.leak;
        let smoothing = GapSmoothing::Leaky { alpha, band, steps: LeakSteps::All };
        let mut model = Model::new(gravity);
        let field = Arc::new(robot.posed(&hand.t_cam_hand, &hand.joints)?);
        // Its field is in the camera's frame already.
        let field = model.add(Body::fixed("hand").with_field(field));
        let samples = model.add(Body::dynamic(&object.name, rigid).with_surface(surface));
        model
            .add_contact(ContactBodies { samples, field }, Arc::new(law), smoothing)
            .map_err(|e| fail(e.to_string()))?;
        let steps = settings.steps.0;
        let stability = StabilityLoss {
            model,
            object: samples,
            rigid,
            time_steps: TimeSteps { dt: settings.time / steps as f64, steps },
            perturbation: settings.perturbation,
            weights: weights_relative_to_fall(g, settings.time, object.radius),
        };
        Ok(Self { stability, initial_center: initial.center(), settings })
    }

    /// The rollouts with steps short enough for the contacts at `pose`.
    ///
    /// Penetration of some millimeters makes contact and friction so stiff that steps which suit a held
    /// object would be unstable, and their derivatives meaningless.
    fn stable(&self, pose: &Isometry3<f64>) -> StabilityLoss {
        let mut stability = self.stability.clone();
        if let Err(StepError { limit, .. }) = stability.check(pose) {
            stability.time_steps = stability.time_steps.refined(limit, self.settings.steps.1);
        }
        stability
    }

    fn displacement(&self, state: &State) -> (Vector3<f64>, f64) {
        let precision = self.settings.displacement_sigma.powi(-2);
        (state.center() - self.initial_center, precision)
    }

    /// Nats of a stability loss.
    fn nats(&self, loss: f64) -> f64 {
        self.settings.weight * loss.ln_1p()
    }
}

impl Factor for StabilityFactor {
    fn name(&self) -> &'static str {
        "stability"
    }

    fn cost(&self, state: &State) -> f64 {
        let pose = &state.t_cam_object;
        let (moved, precision) = self.displacement(state);
        let loss = self.stable(pose).value(pose).ok().filter(|loss| loss.is_finite());
        let loss = loss.unwrap_or(BLOWN_UP);
        self.nats(loss) + 0.5 * precision * moved.norm_squared()
    }

    fn linearize(&self, state: &State, equations: &mut NormalEquations) -> f64 {
        let pose = &state.t_cam_object;
        let center = Point3::from(state.center());
        let (moved, precision) = self.displacement(state);
        // A rollout that blew up has no derivative.
        let is_finite = |model: &Quadratic<6>| {
            let derivatives = model.gradient.iter().chain(&model.hessian);
            (2.0 * model.value).is_finite() && { derivatives }.all(|x| x.is_finite())
        };
        let linearized = self.stable(pose).linearize(pose, &center).ok().filter(is_finite);
        let blown_up = Quadratic { value: 0.5 * BLOWN_UP, ..Quadratic::zeros() };
        let Quadratic { value, gradient, hessian } = linearized.unwrap_or(blown_up);
        let loss = 2.0 * value;
        let slope = self.settings.weight / (1.0 + loss);
        let (mut gradient, mut hessian) = (gradient * (2.0 * slope), hessian * (2.0 * slope));
        for k in 0..3 {
            gradient[k] += precision * moved[k];
            hessian[(k, k)] += precision;
        }
        equations.add(&[Block::ObjectPose], &gradient, &hessian);
        self.nats(loss) + 0.5 * precision * moved.norm_squared()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector6;

    use super::*;
    use crate::factor::gradient_check::{assert_gradient, fixture, scene};

    #[test]
    fn gradient_matches_differences_without_the_leak() {
        // A leak is felt by gradients only, so it is switched off; what remains is the exact derivative
        // of the rollouts, but for contacts that begin within the step.
        for seed in 0..3 {
            let (frame, state) = fixture(seed);
            let settings = StabilitySettings { leak: (0.0, 2e-3), ..StabilitySettings::default() };
            let term = StabilityFactor::new(&frame, &state, settings).unwrap();
            assert_gradient(&term, &state, Block::ObjectPose, 1e-8, 1e-4);
        }
    }

    #[test]
    fn derivatives_are_proportional_to_the_weight() {
        let (frame, state) = fixture(0);
        let [one, three] = [1.0, 3.0].map(|weight| {
            let settings =
                StabilitySettings { weight, displacement_sigma: 1e6, ..Default::default() };
            let mut equations = NormalEquations::new(&[Block::ObjectPose]);
            let term = StabilityFactor::new(&frame, &state, settings).unwrap();
            term.linearize(&state, &mut equations);
            equations
        });
        let gradient = three.gradient() - one.gradient() * 3.0;
        assert!(gradient.norm() < 1e-9 * three.gradient().norm());
        let hessian = three.hessian() - one.hessian() * 3.0;
        assert!(hessian.norm() < 1e-9 * three.hessian().norm());
    }

    #[test]
    fn steps_are_fine_enough_where_the_object_penetrates() {
        let (frame, state) = fixture(0);
        let toward_palm = frame.hand().unwrap().t_cam_hand * -Vector3::x();
        let held = State { t_cam_object: scene().truth, ..state };
        for depth in [0.0, 2e-3, 5e-3] {
            let twist = Vector6::new(toward_palm.x, toward_palm.y, toward_palm.z, 0.0, 0.0, 0.0);
            let pose = held.retract(&[Block::ObjectPose], (twist * depth).as_slice());
            let linearized = |steps| {
                let settings = StabilitySettings { steps, ..StabilitySettings::default() };
                let term = StabilityFactor::new(&frame, &held, settings).unwrap();
                let mut equations = NormalEquations::new(&[Block::ObjectPose]);
                (term.linearize(&pose, &mut equations), equations.gradient().clone())
            };
            let (value, gradient) = linearized(StabilitySettings::default().steps);
            let (fine_value, fine_gradient) = linearized((2000, 2000));
            let cosine = gradient.normalize().dot(&fine_gradient.normalize());
            assert!((value - fine_value).abs() < 0.05 * fine_value, "{value} {fine_value}");
            // First-order integration of a stiff contact: close, not equal. Unstable steps gave −0.35.
            assert!(cosine > 0.9, "{depth} m: {cosine}");
        }
    }

    #[test]
    fn a_held_object_is_more_stable_than_a_penetrating_or_a_falling_one() {
        let (frame, state) = fixture(0);
        let settings = StabilitySettings::default();
        let held = State { t_cam_object: scene().truth, ..state };
        let term = StabilityFactor::new(&frame, &held, settings).unwrap();
        let toward_palm = frame.hand().unwrap().t_cam_hand * Vector3::x() * -1.0;
        let moved = |by: f64| {
            let twist =
                Vector6::new(toward_palm.x, toward_palm.y, toward_palm.z, 0.0, 0.0, 0.0) * by;
            term.cost(&held.retract(&[Block::ObjectPose], twist.as_slice()))
        };
        assert!(term.cost(&held) < moved(5e-3), "penetrating");
        assert!(term.cost(&held) < moved(-0.1), "falling");
    }
}
