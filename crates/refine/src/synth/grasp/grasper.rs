//! Makes grasps: closes the hand around the object, and keeps what holds.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3};
use prehend_geometry::sample::surface_samples;
use prehend_geometry::{ClosestPoints, SolidUnion, SplitMix64};
use prehend_sim::{Coulomb, DynContactLaw, KelvinVoigt, Law, RigidBody};

use super::drive::levers;
use super::placement::Placement;
use super::preshape::Preshape;
use super::self_collision::SelfCollision;
use super::settings::GraspSettings;
use super::simulation::GraspSimulation;
use super::trajectory::GraspSnapshot;
use crate::data::ContactModel;
use crate::error::RefineError;
use crate::scene::{Hand, Object};
use crate::synth::error::SynthError;
use crate::synth::pose_noise::random_direction;

/// An object at rest in a hand.
#[derive(Clone, Debug, PartialEq)]
pub struct Grasp {
    /// Joint positions in the order of the robot's joint names \[rad; m\].
    pub joints: Vec<f64>,
    /// Object coordinates → hand base coordinates \[m\].
    pub t_hand_object: Isometry3<f64>,
    /// Force at which fingers stop \[N\].
    pub grip: f64,
    /// Links that touch the object, by their number in the robot.
    pub links: Vec<usize>,
    /// Area of the object's surface within 5 mm of the hand \[cm²\].
    pub contact_area: f64,
    /// Volume that hand and object share \[cm³\].
    pub intersection_volume: f64,
    /// Distance that the object moved while gravity pulled in several directions \[m\].
    pub drift: f64,
    /// By what angle it turned then \[rad\].
    pub turn: f64,
}

/// Makes grasps of one object by one hand: all of both that stays the same.
pub struct Grasper<'a> {
    pub(super) robot: &'a Hand,
    pub(super) settings: GraspSettings,
    pub(super) preshape: Preshape,
    pub(super) body: RigidBody,
    /// Samples of its surface, object frame \[m\], and the area that each stands for \[m²\].
    pub(super) samples: Vec<Point3<f64>>,
    pub(super) area: f64,
    pub(super) law: Arc<dyn DynContactLaw>,
    /// Law with softer friction, for steps that cannot be solved otherwise.
    pub(super) soft_law: Arc<dyn DynContactLaw>,
    /// For each link the screws of the joints that move it.
    pub(super) paths: Vec<Vec<usize>>,
    pub(super) limits: Vec<(f64, f64)>,
    /// Mean lever of the links that a joint moves \[m\]; 1 for those that slide.
    pub(super) levers: Vec<f64>,
    pub(super) self_collision: SelfCollision,
    /// Links of the taxels.
    pub(super) taxel_links: Vec<usize>,
    placement: Placement,
    contact: ContactModel,
}

/// Links that push with less than this do not count as touching \[N\].
const TOUCHING: f64 = 0.05;
/// Hand and object are at rest below this part of the joints' speeds, and below these speeds of the object \[m/s, rad/s\].
const STILL: (f64, f64, f64) = (0.03, 2e-3, 0.05);
/// Factor on these speeds of the object when time is up.
const CREEPING: f64 = 5.0;
/// For so long \[s\].
const STILL_TIME: f64 = 0.1;
/// By how much friction is softened where a step cannot be solved otherwise.
const SOFTER: f64 = 20.0;
/// Samples of an object's surface, at least and at most.
const SAMPLES: (f64, f64) = (2e3, 4e4);

impl<'a> Grasper<'a> {
    /// Prepares grasps of `object` by `robot`.
    ///
    /// # Errors
    /// If a setting is out of its range, nothing closes, a taxel is on no link, or the object cannot be simulated.
    pub fn new(
        robot: &'a Hand,
        object: &Object,
        settings: &GraspSettings,
    ) -> Result<Self, SynthError> {
        settings.check()?;
        let preshape = Preshape::of(robot)?;
        let inertial = &object.inertial;
        let body = RigidBody::new(inertial.mass, inertial.inertia, inertial.center_of_mass);
        let body = body.map_err(|reason| RefineError::Object {
            object: object.name.clone(),
            reason: reason.to_string(),
        })?;
        let count = (object.area / settings.sample_spacing.powi(2)).clamp(SAMPLES.0, SAMPLES.1);
        let solid = object.mesh.cleaned().0;
        let samples = surface_samples(&solid, count as usize, 0);
        let area = object.area / samples.len().max(1) as f64;
        let samples = samples.iter().map(|s| s.point).collect();
        // Backward Euler damps what is faster than its step: contacts need no damping of their own.
        let spring = KelvinVoigt { stiffness: settings.stiffness, damping: 0.0 };
        let law = |slip_scale| -> Result<Arc<dyn DynContactLaw>, SynthError> {
            let friction = Coulomb { friction: settings.friction, slip_scale };
            Ok(Arc::new(Law::new(spring, friction).map_err(SynthError::refused)?))
        };
        let paths = robot.tree.paths();
        let open = robot.tree.forward_kinematics(&preshape.open);
        Ok(Self {
            robot,
            settings: settings.clone(),
            body,
            samples,
            area,
            law: law(settings.slip_speed)?,
            soft_law: law(SOFTER * settings.slip_speed)?,
            limits: robot.tree.joint_limits(),
            levers: levers(robot, &preshape, &paths),
            self_collision: SelfCollision::new(robot, &paths, &open),
            taxel_links: robot.taxels.iter().map(|t| robot.link_of(t)).collect::<Result<_, _>>()?,
            placement: Placement::new(object),
            contact: ContactModel::new(&object.mesh),
            preshape,
            paths,
        })
    }

    /// The grasp that comes of `seed`, the same on every call and whatever the number of threads.
    ///
    /// # Errors
    /// The reason that there is none.
    pub fn grasp(&self, seed: u64) -> Result<Grasp, SynthError> {
        let mut random = SplitMix64::new(seed);
        let settings = &self.settings;
        let (joints, t_hand_object) = self.placement.draw(self, &mut random)?;
        let weight = self.body.mass() * settings.gravity;
        let mut pace = |_: &f64| 1.0 + settings.speed_spread * (2.0 * random.uniform() - 1.0);
        let pace: Vec<f64> = self.preshape.speed.iter().map(&mut pace).collect();
        let grip = settings.grip + settings.grip_per_weight * weight;
        let mut simulation = GraspSimulation::new(self, &joints, &t_hand_object, grip)?;
        simulation.pace = pace;
        self.close(&mut simulation)?;
        self.check_links(&simulation)?;
        let (drift, turn) = self.hold(&mut simulation, &mut random)?;
        self.check_rest(&simulation, 1.0)?;
        let links = self.check_links(&simulation)?;
        let (contact_area, intersection_volume) = self.measure(&simulation)?;
        Ok(Grasp {
            t_hand_object: simulation.t_hand_object(),
            joints: simulation.joints,
            grip,
            links,
            contact_area,
            intersection_volume,
            drift,
            turn,
        })
    }

    /// `steps` moments of the first grasp of the seeds from `first_seed` on that holds through a
    /// [`trajectory`](Self::trajectory).
    ///
    /// # Errors
    /// [`SynthError::Refused`] if none of `tries` seeds leads to one.
    pub fn sequence(
        &self,
        first_seed: u64,
        tries: u64,
        steps: usize,
    ) -> Result<Vec<GraspSnapshot>, SynthError> {
        self.first_that_holds(first_seed, tries, |grasp, seed| self.trajectory(grasp, seed, steps))
    }

    /// Result of `moments` for the first grasp of the seeds from `first_seed` on for which it has one.
    pub(super) fn first_that_holds(
        &self,
        first_seed: u64,
        tries: u64,
        moments: impl Fn(&Grasp, u64) -> Result<Vec<GraspSnapshot>, SynthError>,
    ) -> Result<Vec<GraspSnapshot>, SynthError> {
        let mut last = None;
        for seed in (0..tries).map(|k| first_seed.wrapping_add(k)) {
            match self.grasp(seed).and_then(|grasp| moments(&grasp, seed)) {
                Ok(moments) => return Ok(moments),
                Err(error) => last = Some(error),
            }
        }
        let last = last.map_or_else(String::new, |error| format!("; the last: {error}"));
        Err(SynthError::Refused(format!("no grasp after {tries} tries{last}")))
    }

    /// Closes the hand around the floating object, until all is at rest or nearly so when time is up: some fingers go on
    /// creeping, and whether the object is held will be seen.
    fn close(&self, simulation: &mut GraspSimulation<'_>) -> Result<(), SynthError> {
        let steps = |time: f64| (time / self.settings.time_step).ceil() as usize;
        let mut still = 0;
        for _ in 0..steps(self.settings.closing_time) {
            let change = simulation.close(None)?;
            let (speed, spin) = simulation.speed();
            let slowest = |speed: &f64| STILL.0 * speed.abs() * self.settings.time_step;
            let rests = change.iter().zip(&self.preshape.speed).all(|(c, s)| c.abs() <= slowest(s))
                && speed < STILL.1
                && spin < STILL.2;
            still = if rests { still + 1 } else { 0 };
            if still >= steps(STILL_TIME) {
                return Ok(());
            }
        }
        self.check_rest(simulation, CREEPING)
    }

    /// Refuses an object that moves faster than this many times what counts as still.
    fn check_rest(&self, simulation: &GraspSimulation<'_>, times: f64) -> Result<(), SynthError> {
        let (speed, spin) = simulation.speed();
        let rests = speed < times * STILL.1 && spin < times * STILL.2;
        let error = "hand and object did not come to rest";
        if rests { Ok(()) } else { Err(SynthError::Refused(error.into())) }
    }

    /// Lets gravity pull in several directions; how far the object moves and turns at most.
    fn hold(
        &self,
        simulation: &mut GraspSimulation<'_>,
        random: &mut SplitMix64,
    ) -> Result<(f64, f64), SynthError> {
        let start = simulation.t_hand_object();
        let (mut drift, mut turn) = (0.0, 0.0);
        for _ in 0..self.settings.hold_directions {
            let gravity = random_direction(random) * self.settings.gravity;
            let steps = (self.settings.hold_time / self.settings.time_step).ceil() as usize;
            for _ in 0..steps {
                simulation.close(Some(gravity))?;
                let (distance, angle) = self.moved(&start, &simulation.t_hand_object())?;
                drift = distance.max(drift);
                turn = angle.max(turn);
            }
        }
        Ok((drift, turn))
    }

    /// Distance and angle of the object between two poses, unless it has slipped.
    pub(super) fn moved(
        &self,
        from: &Isometry3<f64>,
        to: &Isometry3<f64>,
    ) -> Result<(f64, f64), SynthError> {
        let center: Point3<f64> = *self.body.com();
        let (distance, angle) =
            ((to * center - from * center).norm(), from.rotation.angle_to(&to.rotation));
        let stays = distance <= self.settings.slip_distance && angle <= self.settings.slip_angle;
        if stays {
            return Ok((distance, angle));
        }
        let (distance, angle) = (distance * 1e3, angle.to_degrees());
        Err(SynthError::Refused(format!("the object slipped by {distance:.1} mm and {angle:.1}°")))
    }

    /// Links that touch, if they are enough.
    fn check_links(&self, simulation: &GraspSimulation<'_>) -> Result<Vec<usize>, SynthError> {
        let mut forces = vec![0.0; simulation.poses.len()];
        for touch in simulation.touches() {
            forces[touch.link] += touch.force.norm();
        }
        let links: Vec<usize> = (0..forces.len()).filter(|&l| forces[l] > TOUCHING).collect();
        if links.len() < self.settings.links {
            return Err(SynthError::Refused(format!("{} links touch the object", links.len())));
        }
        Ok(links)
    }

    /// Contact area \[cm²\] and shared volume \[cm³\], within their bounds.
    fn measure(&self, simulation: &GraspSimulation<'_>) -> Result<(f64, f64), SynthError> {
        let t_hand_object = &simulation.t_hand_object();
        let hand = self.robot.posed(&Isometry3::identity(), &simulation.joints)?;
        let hand = SolidUnion::new(&hand.mesh_parts())?;
        let volume = self.contact.intersection_volume_cm3(t_hand_object, &hand)?;
        if volume > self.settings.intersection_volume {
            let error = format!("hand and object share {volume:.2} cm³");
            return Err(SynthError::Refused(error));
        }
        let surface = ClosestPoints::new(&hand.mesh())?;
        let area = self.contact.contact_area_cm2(t_hand_object, &surface);
        let (least, most) = self.settings.contact_area;
        if !(least..=most).contains(&area) {
            return Err(SynthError::Refused(format!("the contact area is {area:.1} cm²")));
        }
        Ok((area, volume))
    }
}
