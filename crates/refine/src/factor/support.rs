//! Support: forces of the hand within friction cones hold the object.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Point3, Unit, Vector3, Vector6};
use prehend_geometry::robot::{ArticulatedRobot, RobotSample};
use rayon::prelude::*;

use super::compliant_balance::{CompliantBalance, Support};
use crate::defaults::settings;
use crate::error::RefineError;
use crate::problem::{Block, Factor, NormalEquations, State};
use crate::scene::{Hand, Object, PreparedFrame};

settings! {
    /// Settings of [`SupportFactor`].
    pub struct SupportSettings {
        /// Standard deviation of what is left unbalanced, as a share of all that acts on the object. EXPERIMENTS: Support factor.
        pub sigma: f64 = 0.2,
        /// Coefficient of friction: a generous one, since only what no forces could hold is evidence.
        pub friction: f64 = 1.0,
        /// Distance from the hand up to which the surface may yet touch it, the less the farther \[m\]: errors of models and joints.
        pub reach: f64 = 5e-3,
        /// Number of samples of the object's surface at most.
        pub samples: usize = 500,
        /// Contact area that bears half of what it would if it did not yield \[m²\].
        pub area: f64 = 1e-5,
        /// Share of the felt forces that certainly acts: taxels' gains are off, and the rest may be more, never less.
        pub felt: f64 = 0.5,
        /// Force of a taxel at which it is believed half \[N\]: those that ring false feel less.
        pub felt_force: f64 = 0.5,
    }
}

impl SupportSettings {
    fn check(&self) -> Result<(), RefineError> {
        let positive = [self.sigma, self.reach, self.area].iter().all(|v| *v > 0.0);
        let not_negative =
            [self.friction, self.felt, self.felt_force].iter().all(|v| *v >= 0.0 && v.is_finite());
        if positive && not_negative {
            return Ok(());
        }
        let problem = format!(
            "{self:?}: deviation, reach and area have to be positive, friction and forces not negative"
        );
        Err(RefineError::Setting { name: "support", problem })
    }
}

/// Whether forces of the hand, where it is near the object, could balance weight and felt forces.
///
/// Felt forces are lower bounds of the contact forces; contacts off the skin are not measured, and may bear any force
/// within their friction cones. So the factor does not judge the grasp's strength. It only penalizes states in which no contact
/// opposes the object's weight or the fingers' pressure.
pub struct SupportFactor {
    object: Arc<Object>,
    robot: Arc<Hand>,
    gravity: Vector3<f64>,
    felt: Vec<Push>,
    /// Weight and felt forces together \[N\].
    size: f64,
    settings: SupportSettings,
}

/// A force on the object, in the frame of the link that exerts it.
struct Push {
    link: usize,
    position: Point3<f64>,
    force: Vector3<f64>,
}

/// A sample of the object that may touch the hand, in the camera frame.
struct NearPoint {
    point: Point3<f64>,
    sample: RobotSample,
    support: Support,
    /// Relative change of its compliance by the distance \[1/m\].
    stiffening: f64,
}

/// The balance of a state.
struct Held {
    hand: ArticulatedRobot,
    /// Center of mass, in the camera frame.
    mass_center: Point3<f64>,
    near: Vec<NearPoint>,
    balance: CompliantBalance,
}

impl SupportFactor {
    /// Factor of the object in the hand of `frame`.
    ///
    /// # Errors
    /// If gravity or the hand is unknown, the hand has a skin and its forces are not one a taxel, or a setting is out of range.
    pub fn new(frame: &PreparedFrame<'_>, settings: &SupportSettings) -> Result<Self, RefineError> {
        settings.check()?;
        let missing = RefineError::Missing { what: "gravity", factor: "support" };
        let gravity = frame.observation().gravity.ok_or(missing)?;
        let hand = frame.require_hand("support")?;
        let (object, robot) = (Arc::clone(frame.object()), Arc::clone(&hand.hand));
        let settings = settings.clone();
        if !hand.forces.is_empty() {
            robot.check_forces(&hand.forces)?;
        }
        let mut felt = Vec::new();
        for (taxel, force) in robot.taxels.iter().zip(&hand.forces) {
            let strength = force.norm();
            if !(strength > 0.0 && strength.is_finite()) {
                continue;
            }
            let link = robot.link_of(taxel)?;
            let trust = 1.0 / (1.0 + (settings.felt_force / strength).powi(2));
            let force = -force * (trust * settings.felt);
            felt.push(Push { link, position: taxel.position, force });
        }
        let weight = object.inertial.mass * gravity.norm();
        let size = weight + felt.iter().map(|f| f.force.norm()).sum::<f64>();
        Ok(Self { object, robot, gravity, felt, size, settings })
    }

    /// Balance of contact forces on the object at `state`; `None` of a hand that cannot be posed.
    fn held(&self, state: &State) -> Option<Held> {
        let hand = self.robot.articulated(&state.t_cam_hand, &state.joints).ok()?;
        let mass_center = state.t_cam_object * self.object.inertial.center_of_mass;
        // Samples follow each other over the surface.
        let stride = self.object.sample_stride(self.settings.samples);
        let samples = self.object.samples.par_iter().step_by(stride).with_min_len(128);
        let near: Vec<NearPoint> = samples
            .filter_map(|sample| {
                let point = state.t_cam_object * sample.point;
                self.near(point, state.t_cam_object * -sample.normal, &hand)
            })
            .collect();
        let weight = self.gravity * self.object.inertial.mass;
        let zero = Vector3::zeros();
        let load = self.felt.iter().fold(self.wrench(&zero, &weight), |load, felt| {
            let t_cam_link = hand.posed().t_world_links()[felt.link];
            let arm = t_cam_link * felt.position - mass_center;
            load + self.wrench(&arm, &(t_cam_link * felt.force))
        });
        let supports: Vec<Support> = near.iter().map(|near| near.support).collect();
        let length = self.object.radius;
        let balance = CompliantBalance::find(&supports, &mass_center, length, &load);
        Some(Held { hand, mass_center, near, balance })
    }

    /// A sample at `point` whose surface is pushed along `inward`, if it is near the hand and faces it.
    fn near(
        &self,
        point: Point3<f64>,
        inward: Vector3<f64>,
        hand: &ArticulatedRobot,
    ) -> Option<NearPoint> {
        let reach = self.settings.reach;
        let sample = hand.distance_with_gradient(&point, reach)?;
        let apart = (sample.field.distance / reach).max(0.0);
        let left = 1.0 - apart * apart;
        if inward.dot(&sample.field.gradient) <= 0.0 || left <= 0.0 {
            return None;
        }
        let normal = Unit::try_new(inward, 0.0)?;
        let friction = self.settings.friction;
        let stride = self.object.sample_stride(self.settings.samples);
        let area = self.object.area * stride as f64 / self.object.samples.len() as f64;
        let compliance = self.settings.area / (area * left * left);
        let stiffening = 4.0 * apart / (left * reach);
        let support = Support { position: point, normal, friction, compliance };
        Some(NearPoint { point, sample, support, stiffening })
    }

    /// Force and torque over the object's radius \[N\].
    fn wrench(&self, arm: &Vector3<f64>, force: &Vector3<f64>) -> Vector6<f64> {
        joined(force, &self.torque(arm, force))
    }

    /// Torque over the object's radius \[N\].
    fn torque(&self, arm: &Vector3<f64>, force: &Vector3<f64>) -> Vector3<f64> {
        arm.cross(force) / self.object.radius
    }

    /// Nats of half a squared newton; none where nothing acts.
    fn nats(&self) -> f64 {
        if self.size > 0.0 { (self.size * self.settings.sigma).powi(-2) } else { 0.0 }
    }
}

fn joined(force: &Vector3<f64>, torque: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(force.x, force.y, force.z, torque.x, torque.y, torque.z)
}

/// Velocities of a point at `arm` from the center of a unit twist's motion, and the twist's rotation, one twist after the other.
fn twists(arm: &Vector3<f64>) -> [(Vector3<f64>, Vector3<f64>); 6] {
    std::array::from_fn(|k| match k {
        0..3 => (Vector3::ith(k, 1.0), Vector3::zeros()),
        _ => {
            let turn = Vector3::ith(k - 3, 1.0);
            (turn.cross(arm), turn)
        }
    })
}

impl Factor for SupportFactor {
    fn name(&self) -> &'static str {
        "support"
    }

    fn cost(&self, state: &State) -> f64 {
        self.held(state).map_or(0.0, |held| self.nats() * held.balance.value)
    }

    fn linearize(&self, state: &State, equations: &mut NormalEquations) -> f64 {
        let Some(held) = self.held(state) else { return 0.0 };
        let blocks = [Block::ObjectPose, Block::HandPose, Block::Joints(state.joints.len())];
        let (jacobian, yielding) = self.derivatives(&held, state);
        let (balance, nats) = (held.balance, self.nats());
        let gradient = (jacobian.tr_mul(&balance.residual) - yielding) * nats;
        let hessian = jacobian.tr_mul(&(balance.residual_jacobian * &jacobian)) * nats;
        equations.add(&blocks, &gradient, &hessian);
        nats * balance.value
    }
}

impl SupportFactor {
    /// Derivatives of what is left unbalanced if each force keeps its pull: it turns with the object, and its support bears the
    /// less, the more it yields. Beside it, what that changes in the residual's square and not in the value: forces
    /// that are less cost less.
    fn derivatives(&self, held: &Held, state: &State) -> (DMatrix<f64>, DVector<f64>) {
        let (center, mass_center) = (state.center(), held.mass_center);
        // Where the derivatives by the hand's pose and by its joints begin.
        let hand = Block::ObjectPose.dimension();
        let joints = hand + Block::HandPose.dimension();
        let parameters = joints + state.joints.len();
        let mut jacobian = DMatrix::zeros(6, parameters);
        let mut yielding = DVector::zeros(parameters);
        for (near, force) in held.near.iter().zip(&held.balance.forces) {
            if *force == Vector3::zeros() {
                continue;
            }
            let arm = near.point - mass_center;
            let (torque, wrench) = (self.torque(&arm, force), self.wrench(&arm, force));
            let cost = 0.5 * near.support.compliance * force.norm_squared();
            let mut add = |k: usize, distance: f64, turned: Vector6<f64>| {
                let relative = near.stiffening * distance;
                yielding[k] += cost * relative;
                let mut column = jacobian.column_mut(k);
                column += turned - wrench * relative;
            };
            for (k, (velocity, turn)) in twists(&(near.point.coords - center)).iter().enumerate() {
                let distance = near.sample.field.gradient.dot(velocity);
                add(k, distance, joined(&turn.cross(force), &turn.cross(&torque)));
                add(hand + k, -distance, Vector6::zeros());
            }
            for (k, distance) in near.sample.joints.iter().enumerate() {
                add(joints + k, *distance, Vector6::zeros());
            }
        }
        for felt in &self.felt {
            let t_cam_link = held.hand.posed().t_world_links()[felt.link];
            let (point, force) = (t_cam_link * felt.position, t_cam_link * felt.force);
            let arm = point - mass_center;
            // By how fast its point goes away from the center of mass, and how fast it turns.
            let mut add = |k: usize, velocity: Vector3<f64>, turning: Vector3<f64>| {
                let torque = self.torque(&velocity, &force) + self.torque(&arm, &turning);
                let mut column = jacobian.column_mut(k);
                column += joined(&turning, &torque);
            };
            for (k, (velocity, _)) in twists(&(mass_center.coords - center)).iter().enumerate() {
                add(k, -velocity, Vector3::zeros());
            }
            for (k, (velocity, turn)) in twists(&(point.coords - center)).iter().enumerate() {
                add(hand + k, *velocity, turn.cross(&force));
            }
            let end = point + force;
            let tail = held.hand.point_jacobian(felt.link, &point);
            let head = held.hand.point_jacobian(felt.link, &end);
            for ((k, velocity), (_, of_head)) in tail.zip(head) {
                add(joints + k, velocity, of_head - velocity);
            }
        }
        (jacobian, yielding)
    }
}

#[cfg(test)]
mod tests {
    use super::super::gradient_check::{assert_gradient, fixture, scene};
    use super::*;
    use crate::scene::Frame;

    fn factor(frame: &PreparedFrame<'_>) -> SupportFactor {
        SupportFactor::new(frame, &SupportSettings::default()).unwrap()
    }

    /// Factor of the built-in scene, with another observation.
    fn seen(observation: &Frame) -> SupportFactor {
        let scene = scene();
        factor(&PreparedFrame::new(observation, &scene.object).unwrap())
    }

    #[test]
    fn gradients_match_differences() {
        for seed in 0..3 {
            let (frame, state) = fixture(seed);
            let term = factor(&frame);
            assert!(term.cost(&state) > 0.0);
            for block in [Block::ObjectPose, Block::HandPose, Block::Joints(16)] {
                assert_gradient(&term, &state, block, 1e-7, 1e-3);
            }
        }
    }

    #[test]
    fn a_held_object_costs_nothing_and_one_beside_the_hand_does() {
        let (frame, state) = fixture(0);
        let term = factor(&frame);
        let held = State { t_cam_object: scene().truth, ..state };
        let free = held.retract(&[Block::ObjectPose], &[0.0, 0.0, -0.3, 0.0, 0.0, 0.0]);
        let (held, free) = (term.cost(&held), term.cost(&free));
        // All that acts is left: half a square over that of the deviation.
        let all = 0.5 * SupportSettings::default().sigma.powi(-2);
        assert!(held < 0.1 * all && free > 0.1 * all, "{held} {free} {all}");
    }

    #[test]
    fn samples_stand_for_the_whole_surface() {
        let (frame, state) = fixture(0);
        let held = State { t_cam_object: scene().truth, ..state };
        // What the object touches is a share of its area, however many samples are looked at.
        let touched = |samples| {
            let settings = SupportSettings { samples, ..SupportSettings::default() };
            let factor = SupportFactor::new(&frame, &settings).unwrap();
            let near = factor.held(&held).unwrap().near;
            let pads = near.iter().map(|near| settings.area / near.support.compliance);
            pads.sum::<f64>() / factor.object.area
        };
        let [all, half] = [usize::MAX, scene().object.samples.len() / 2].map(touched);
        assert!(all > 1e-3 && all < 0.5 && (half / all - 1.0).abs() < 0.2, "{all} {half}");
    }

    #[test]
    fn what_a_finger_feels_pushes_the_object_away_from_it() {
        let scene = scene();
        let mut observation = scene.frame.clone();
        let taxel = &scene.hand.taxels[100];
        let forces = &mut observation.hand.as_mut().unwrap().forces;
        forces.fill(Vector3::zeros());
        // The object presses into the skin with 2 N: half of that, and as much as so strong a taxel is believed.
        forces[100] = -2.0 * taxel.normal;
        let [push] = &seen(&observation).felt[..] else { panic!("not one force") };
        assert!((push.force - taxel.normal * (4.0 / 4.25)).norm() < 1e-12, "{}", push.force);
    }

    #[test]
    fn where_nothing_acts_nothing_is_said() {
        let (_, state) = fixture(0);
        let scene = scene();
        let mut observation = scene.frame.clone();
        observation.gravity = Some(Vector3::zeros());
        let forces = &mut observation.hand.as_mut().unwrap().forces;
        forces.fill(Vector3::repeat(f64::NAN));
        let frame = PreparedFrame::new(&observation, &scene.object).unwrap();
        let settings = SupportSettings::default();
        let factor = SupportFactor::new(&frame, &settings).unwrap();
        let mut equations = NormalEquations::new(&[Block::ObjectPose]);
        assert_eq!((factor.cost(&state), factor.linearize(&state, &mut equations)), (0.0, 0.0));
        assert_eq!(equations.gradient().norm(), 0.0);
        for wrong in [
            SupportSettings { reach: 0.0, ..settings.clone() },
            SupportSettings { area: f64::NAN, ..settings.clone() },
            SupportSettings { friction: -1.0, ..settings },
        ] {
            let refused = SupportFactor::new(&frame, &wrong);
            assert!(matches!(refused, Err(RefineError::Setting { name: "support", .. })));
        }
    }

    #[test]
    fn gravity_and_the_hand_are_needed() {
        let scene = scene();
        let refused = |change: fn(&mut Frame)| {
            let mut observation = scene.frame.clone();
            change(&mut observation);
            let frame = PreparedFrame::new(&observation, &scene.object).unwrap();
            let factor = SupportFactor::new(&frame, &SupportSettings::default());
            factor.err().unwrap().to_string()
        };
        assert!(refused(|o| o.gravity = None).contains("gravity"));
        assert!(refused(|o| o.hand = None).contains("hand"));
        let short = |o: &mut Frame| o.hand.as_mut().unwrap().forces.truncate(5);
        assert_eq!(refused(short), "5 taxel forces were given for 368 taxels");
    }
}
