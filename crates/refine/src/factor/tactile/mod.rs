//! Touch: taxels that feel force touch the object, inactive taxels are not inside it.

mod contacts;

use std::sync::Arc;

use nalgebra::{Point3, Vector3};
use prehend_geometry::hand::Taxel;
use prehend_geometry::robot::ArticulatedRobot;

pub use self::contacts::ContactSettings;
use self::contacts::contacts;
use crate::error::RefineError;
use crate::problem::{Block, Factor, NoiseModel, Rows, State, Weighting};
use crate::scene::{Frame, Hand, Object};

/// What taxels that feel force say.
#[derive(Clone, Debug, PartialEq)]
pub enum TouchModel {
    /// Nothing: they are as good as dead.
    Nothing,
    /// Each that it is near the surface, as in the paper. A contact spreads over the taxels around it, so that a touched taxel may be
    /// a few millimeters away, and one contact lights up a whole patch.
    Taxels(NoiseModel),
    /// Neighbors together that the skin touches the surface at their center of force.
    Contacts(ContactSettings),
}

/// Settings of [`TactileFactor`].
#[derive(Clone, Debug, PartialEq)]
pub struct TactileSettings {
    /// Force above which a taxel counts as touched, the paper's γ \[N\].
    pub contact_threshold: f64,
    /// What touched taxels say.
    pub touch: TouchModel,
    /// Depths of inactive taxels inside the object \[m\]; the dead ones are outliers.
    pub no_contact: NoiseModel,
}

impl Default for TactileSettings {
    fn default() -> Self {
        Self {
            contact_threshold: 0.1,
            touch: TouchModel::Taxels(NoiseModel::cauchy(3e-3, 10e-3, 8.0)),
            no_contact: NoiseModel::cauchy(1e-3, 10e-3, f64::INFINITY),
        }
    }
}

impl TactileSettings {
    /// With kernels `factor` times as wide.
    pub(crate) fn widened(mut self, factor: f64) -> Self {
        self.no_contact = self.no_contact.widened(factor);
        match &mut self.touch {
            TouchModel::Nothing => {}
            TouchModel::Taxels(noise) => *noise = noise.widened(factor),
            TouchModel::Contacts(contacts) => contacts.kernel_width *= factor,
        }
        self
    }
}

/// A point of a link whose distance from the object is known.
struct Probe {
    link: usize,
    /// In link coordinates \[m\].
    position: Point3<f64>,
    /// Whether it is on the surface; else it is not inside.
    touched: bool,
    weighting: Weighting,
}

/// The paper's distance between the mesh and the taxels in contact, or that of whole contacts ([`TouchModel`]), and the evidence of the
/// other taxels.
///
/// What is touched is drawn to the surface from either side; inactive taxels are pushed out of it, which the
/// paper leaves unused. Both have Cauchy's kernel, because some taxels are dead and some report false forces.
pub struct TactileFactor {
    object: Arc<Object>,
    hand: Arc<Hand>,
    probes: Vec<Probe>,
}

/// Where a probe is.
struct Measured {
    /// From the surface, positive outside \[m\].
    distance: f64,
    /// Outward direction (camera frame).
    outward: Vector3<f64>,
    /// The probe (camera frame).
    point: Point3<f64>,
}

impl TactileFactor {
    /// Of the taxels of `frame`.
    ///
    /// # Errors
    /// If the hand is unknown, or its forces are not one a taxel.
    pub fn new(frame: &Frame<'_>, settings: &TactileSettings) -> Result<Self, RefineError> {
        let (hand, measured) = frame.require_hand("tactile")?;
        hand.check_forces(&measured.forces)?;
        let links = hand.taxels.iter().map(|taxel| hand.link_of(taxel));
        let links = links.collect::<Result<Vec<usize>, _>>()?;
        let probes = probes(hand, &links, &measured.forces, settings);
        Ok(Self { object: Arc::clone(frame.object()), hand: Arc::clone(hand), probes })
    }

    /// Distances of what is touched from the object's surface, positive outside \[m\]; of none for a hand that cannot be posed.
    pub(crate) fn touched_distances(&self, state: &State) -> Vec<f64> {
        let Ok(hand) = self.hand.articulated(&state.t_cam_hand, &state.joints) else {
            return Vec::new();
        };
        let touched = self.probes.iter().filter(|probe| probe.touched);
        let measured = touched.filter_map(|probe| self.measure(state, &hand, probe));
        measured.map(|measured| measured.distance).collect()
    }

    /// Where `probe` is, if that costs anything.
    fn measure(&self, state: &State, hand: &ArticulatedRobot, probe: &Probe) -> Option<Measured> {
        let point = hand.posed().t_world_links()[probe.link] * probe.position;
        let local = state.t_cam_object.inverse_transform_point(&point);
        // Far outside everything an inactive taxel costs nothing, and no exact distance is needed.
        if !probe.touched && (local - self.object.center).norm() > self.object.radius {
            return None;
        }
        let (distance, closest) = self.object.surface.signed_distance(&local);
        if !probe.touched && distance >= 0.0 {
            return None;
        }
        let along = (local - closest.point) * distance.signum();
        let outward =
            along.try_normalize(1e-12).map_or_else(Vector3::zeros, |n| state.t_cam_object * n);
        Some(Measured { distance, outward, point })
    }
}

/// What taxels on `links` that feel `forces` say of where they are.
fn probes(
    hand: &Hand,
    links: &[usize],
    forces: &[Vector3<f64>],
    settings: &TactileSettings,
) -> Vec<Probe> {
    let is_touched = |force: &Vector3<f64>| force.norm() > settings.contact_threshold;
    // A force that is not a number is no silence.
    let is_inactive = |force: &Vector3<f64>| force.norm() <= settings.contact_threshold;
    let all = || hand.taxels.iter().zip(links).zip(forces);
    let probe = |(taxel, link): (&Taxel, &usize), touched, weighting| Probe {
        link: *link,
        position: taxel.position,
        touched,
        weighting,
    };
    let mut probes: Vec<Probe> = match &settings.touch {
        TouchModel::Nothing => Vec::new(),
        TouchModel::Taxels(noise) => {
            let touched = all().filter(|(_, force)| is_touched(force));
            let weighting = noise.weighting(touched.clone().count());
            touched.map(|(taxel, _)| probe(taxel, true, weighting)).collect()
        }
        TouchModel::Contacts(contact) => {
            contacts(hand, links, forces, settings.contact_threshold, contact)
        }
    };
    let inactive = all().filter(|(_, force)| is_inactive(force));
    let weighting = settings.no_contact.weighting(inactive.clone().count());
    probes.extend(inactive.map(|(taxel, _)| probe(taxel, false, weighting)));
    probes
}

impl Factor for TactileFactor {
    fn name(&self) -> &'static str {
        "tactile"
    }

    /// A hand that cannot be posed costs nothing.
    fn rows(&self, state: &State, rows: &mut Rows<'_>) {
        let Ok(hand) = self.hand.articulated(&state.t_cam_hand, &state.joints) else { return };
        let mut joints = vec![0.0; state.joints.len()];
        for probe in &self.probes {
            let Some(measured) = self.measure(state, &hand, probe) else { continue };
            let Measured { distance, outward, point } = measured;
            rows.add(distance, &probe.weighting, |row| {
                // The taxel moves with the hand.
                row.relative_point(state, &point, &-outward);
                joints.fill(0.0);
                for (joint, velocity) in hand.point_jacobian(probe.link, &point) {
                    joints[joint] += outward.dot(&velocity);
                }
                row.block(Block::Joints(joints.len()), &joints);
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::gradient_check::{assert_gradient, fixture, scene};
    use super::*;
    use crate::scene::{HandMeasurement, Observation};

    #[test]
    fn gradients_match_differences() {
        let default = TactileSettings::default();
        let contacts = TouchModel::Contacts(ContactSettings::default());
        for touch in [default.touch.clone(), contacts] {
            let settings = TactileSettings { touch, ..default.clone() };
            for seed in 0..3 {
                let (frame, state) = fixture(seed);
                let factor = TactileFactor::new(&frame, &settings).unwrap();
                for block in [Block::ObjectPose, Block::HandPose, Block::Joints(16)] {
                    assert_gradient(&factor, &state, block, 1e-7, 1e-4);
                }
            }
        }
    }

    #[test]
    fn forces_of_which_nothing_is_known_say_nothing() {
        let scene = scene();
        let mut observation = scene.observation.clone();
        let taxels = TactileSettings::default();
        let touch = TouchModel::Contacts(ContactSettings::default());
        let contacts = TactileSettings { touch, ..taxels.clone() };
        let probes = |observation: &Observation, settings: &TactileSettings| {
            let frame = Frame::new(observation, &scene.object, Some(&scene.hand)).unwrap();
            TactileFactor::new(&frame, settings).unwrap().probes.len()
        };
        let all = probes(&observation, &taxels);
        fn forces(observation: &mut Observation) -> &mut [Vector3<f64>] {
            &mut observation.hand.as_mut().unwrap().forces
        }
        forces(&mut observation)[7] = HandMeasurement::UNKNOWN_FORCE;
        assert_eq!(probes(&observation, &taxels), all - 1);
        forces(&mut observation).fill(HandMeasurement::UNKNOWN_FORCE);
        assert_eq!([&taxels, &contacts].map(|settings| probes(&observation, settings)), [0, 0]);
    }

    #[test]
    fn forces_must_fit_the_skin() {
        let scene = scene();
        let mut observation = scene.observation.clone();
        let settings = TactileSettings::default();
        if let Some(hand) = &mut observation.hand {
            hand.forces.pop();
        }
        let frame = Frame::new(&observation, &scene.object, Some(&scene.hand)).unwrap();
        let error = TactileFactor::new(&frame, &settings).err().unwrap().to_string();
        assert_eq!(error, "367 taxel forces were given for 368 taxels");
        observation.hand = None;
        let frame = Frame::new(&observation, &scene.object, Some(&scene.hand)).unwrap();
        let refused = TactileFactor::new(&frame, &settings);
        assert!(matches!(refused, Err(RefineError::Missing { .. })));
    }
}
