//! Mesh-to-tactile: taxels that feel force touch the object, quiet taxels do not reach into it.

mod contacts;

use std::sync::Arc;

use nalgebra::{Point3, Vector3, Vector6};
use prehend_geometry::hand::Taxel;
use prehend_geometry::robot::ArticulatedRobot;

pub use self::contacts::ContactSettings;
use self::contacts::contacts;
use super::{Term, share};
use crate::error::RefineError;
use crate::problem::{Block, Cauchy, Normal, State};
use crate::scene::{Hand, Object, Observation};

/// What taxels that feel force say.
#[derive(Clone, Debug, PartialEq)]
pub enum TouchModel {
    /// Nothing: they are as good as dead.
    Nothing,
    /// Each that it is near the surface, as in the paper.
    Taxels {
        /// Standard deviation of a touched taxel from the object's surface \[m\]: a contact spreads over
        /// the taxels around it, so a touched taxel may itself be a few millimeters away.
        sigma: f64,
        /// How many independent measurements they amount to at most: one contact lights up a whole patch.
        effective: f64,
        /// Distance at which one counts as an outlier (a false one) \[m\].
        outlier: f64,
    },
    /// Neighbors together that the skin touches the surface at their center of force.
    Contacts(ContactSettings),
}

/// Settings of the mesh-to-tactile term.
#[derive(Clone, Debug, PartialEq)]
pub struct TactileSettings {
    /// Force above which a taxel counts as touched, the paper's γ \[N\].
    pub contact_threshold: f64,
    /// What touched taxels say.
    pub felt: TouchModel,
    /// Standard deviation of how deep a quiet taxel may lie inside the object \[m\].
    pub no_contact_sigma: f64,
    /// Depth at which a quiet taxel counts as an outlier (a dead one) \[m\].
    pub quiet_outlier: f64,
}

impl Default for TactileSettings {
    fn default() -> Self {
        Self {
            contact_threshold: 0.1,
            felt: TouchModel::Taxels { sigma: 3e-3, effective: 8.0, outlier: 10e-3 },
            no_contact_sigma: 1e-3,
            quiet_outlier: 10e-3,
        }
    }
}

impl TactileSettings {
    /// With outliers only from `factor` times their limits on.
    pub(crate) fn forgiving(mut self, factor: f64) -> Self {
        self.quiet_outlier *= factor;
        match &mut self.felt {
            TouchModel::Nothing => {}
            TouchModel::Taxels { outlier, .. } => *outlier *= factor,
            TouchModel::Contacts(contacts) => contacts.outlier *= factor,
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
    /// Nats of half a square meter.
    weight: f64,
    /// Distance at which it counts as an outlier \[m\].
    outlier: f64,
}

impl Probe {
    fn cauchy(&self) -> Cauchy {
        Cauchy { scale: self.outlier }
    }
}

/// The paper's distance between the mesh and the taxels in contact, or that of whole contacts ([`TouchModel`]), and the evidence of the other taxels.
///
/// What is touched is drawn to the surface from either side; quiet taxels are pushed out of it, which the
/// paper leaves unused. Both go through Cauchy's loss, because some taxels are dead and some ring false.
pub struct TactileTerm {
    object: Arc<Object>,
    robot: Arc<Hand>,
    probes: Vec<Probe>,
}

impl TactileTerm {
    /// Reads the taxels of `robot` from `observation`.
    ///
    /// # Errors
    /// If the hand is unknown, or its forces are not one a taxel.
    pub fn new(
        observation: &Observation,
        object: Arc<Object>,
        robot: Arc<Hand>,
        settings: &TactileSettings,
    ) -> Result<Self, RefineError> {
        let hand = observation
            .hand
            .as_ref()
            .ok_or(RefineError::Missing { what: "hand state", term: "tactile" })?;
        robot.check_forces(&hand.forces)?;
        robot.check_joints(&hand.joints)?;
        let links = robot.taxels.iter().map(|taxel| robot.link_of(taxel));
        let links = links.collect::<Result<Vec<usize>, _>>()?;
        let probes = probes(&robot, &links, &hand.forces, settings);
        Ok(Self { object, robot, probes })
    }

    /// Calls `f` with each probe that matters. A hand that cannot be posed says nothing.
    fn residuals(&self, state: &State, mut f: impl FnMut(&ArticulatedRobot, &Probe, Residual)) {
        let Ok(hand) = self.robot.articulated(&state.t_cam_hand, &state.joints) else { return };
        let t_object_cam = state.t_cam_object.inverse();
        let reach = self.object.radius;
        for probe in &self.probes {
            let point = hand.posed().t_world_links()[probe.link] * probe.position;
            let local = t_object_cam * point;
            // Far outside everything a quiet taxel says nothing, and no exact distance is needed.
            if !probe.touched && (local - self.object.center).norm() > reach {
                continue;
            }
            let (distance, closest) = self.object.surface.signed_distance(&local);
            if !probe.touched && distance >= 0.0 {
                continue;
            }
            let along = (local - closest.point) * distance.signum();
            let gradient =
                along.try_normalize(1e-12).map_or_else(Vector3::zeros, |n| state.t_cam_object * n);
            f(&hand, probe, Residual { distance, gradient, point });
        }
    }
}

/// What taxels on `links` that feel `forces` say of where they are.
fn probes(
    robot: &Hand,
    links: &[usize],
    forces: &[Vector3<f64>],
    settings: &TactileSettings,
) -> Vec<Probe> {
    let is_touched = |force: &Vector3<f64>| force.norm() > settings.contact_threshold;
    let all = || robot.taxels.iter().zip(links).zip(forces);
    // A force that is not a number is no silence.
    let is_quiet = |force: &Vector3<f64>| force.norm() <= settings.contact_threshold;
    let quiet = all().filter(|(_, force)| is_quiet(force)).map(|((taxel, link), _)| Probe {
        link: *link,
        position: taxel.position,
        touched: false,
        weight: settings.no_contact_sigma.powi(-2),
        outlier: settings.quiet_outlier,
    });
    let mut probes: Vec<Probe> = match &settings.felt {
        TouchModel::Nothing => Vec::new(),
        TouchModel::Taxels { sigma, effective, outlier } => {
            let touched = all().filter(|(_, force)| is_touched(force));
            let weight = share(*effective, touched.clone().count().max(1) as f64, *sigma);
            let probe = |((taxel, link), _): ((&Taxel, &usize), _)| Probe {
                link: *link,
                position: taxel.position,
                touched: true,
                weight,
                outlier: *outlier,
            };
            touched.map(probe).collect()
        }
        TouchModel::Contacts(contact) => {
            contacts(robot, links, forces, settings.contact_threshold, contact)
        }
    };
    probes.extend(quiet);
    probes
}

/// Where a probe is.
struct Residual {
    /// From the surface, positive outside \[m\].
    distance: f64,
    /// Its derivative by the probe's place: the outward direction (camera frame).
    gradient: Vector3<f64>,
    /// The probe (camera frame).
    point: Point3<f64>,
}

impl Term for TactileTerm {
    fn name(&self) -> &'static str {
        "tactile"
    }

    fn value(&self, state: &State) -> f64 {
        let mut value = 0.0;
        self.residuals(state, |_, probe, r| {
            value += probe.weight * probe.cauchy().loss(r.distance.powi(2))
        });
        value
    }

    fn linearize(&self, state: &State, normal: &mut Normal) -> f64 {
        let center = state.center();
        let mut value = 0.0;
        let mut joints = vec![0.0; state.joints.len()];
        self.residuals(state, |hand, probe, r| {
            let squared = r.distance.powi(2);
            value += probe.weight * probe.cauchy().loss(squared);
            let n = r.gradient;
            let turn = (r.point.coords - center).cross(&n);
            // Only where the taxels are relative to the object matters: moving the object by a twist is
            // moving the hand by its opposite.
            let of_hand = Vector6::new(n.x, n.y, n.z, turn.x, turn.y, turn.z);
            let of_object = -of_hand;
            joints.fill(0.0);
            for (joint, velocity) in hand.point_jacobian(probe.link, &r.point) {
                joints[joint] += n.dot(&velocity);
            }
            let row = [
                (Block::ObjectPose, of_object.as_slice()),
                (Block::HandPose, of_hand.as_slice()),
                (Block::Joints(joints.len()), joints.as_slice()),
            ];
            normal.add_row(&row, r.distance, probe.weight * probe.cauchy().weight(squared));
        });
        value
    }
}

#[cfg(test)]
mod tests {
    use super::super::gradient_check::{assert_gradient, fixture};
    use super::*;

    fn term(
        observation: &Observation,
        settings: &TactileSettings,
    ) -> Result<TactileTerm, RefineError> {
        let (scene, _, _) = fixture(0);
        let object = Arc::clone(&scene.object);
        let robot = Arc::clone(&scene.robot);
        TactileTerm::new(observation, object, robot, settings)
    }

    #[test]
    fn gradients_match_differences() {
        let default = TactileSettings::default();
        let contacts = TouchModel::Contacts(ContactSettings::default());
        for felt in [default.felt.clone(), contacts] {
            let settings = TactileSettings { felt, ..default.clone() };
            for seed in 0..3 {
                let (scene, state, _) = fixture(seed);
                let term = term(&scene.observation, &settings).unwrap();
                for block in [Block::ObjectPose, Block::HandPose, Block::Joints(16)] {
                    assert_gradient(&term, &state, block, 1e-7, 1e-4);
                }
            }
        }
    }

    #[test]
    fn forces_must_fit_the_skin() {
        let (scene, _, _) = fixture(0);
        let mut observation = scene.observation.clone();
        if let Some(hand) = &mut observation.hand {
            hand.forces.pop();
        }
        let settings = TactileSettings::default();
        let error = term(&observation, &settings).err().unwrap().to_string();
        assert_eq!(error, "367 taxel forces were given for 368 taxels");
        observation.hand = None;
        assert!(matches!(term(&observation, &settings), Err(RefineError::Missing { .. })));
    }
}
