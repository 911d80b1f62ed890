//! Touch: what feels the object is on its surface, what does not is outside.

mod binary;
mod contacts;
mod patch;
mod probe;
mod proximity;

use std::sync::Arc;

use nalgebra::Vector3;
use prehend_geometry::hand::Taxel;
use prehend_geometry::robot::ArticulatedRobot;
use serde::{Deserialize, Serialize};

pub use self::binary::BinaryTouchSettings;
pub use self::contacts::ContactSettings;
use self::contacts::contacts;
pub use self::patch::ContactPatchSettings;
use self::patch::NormalProbe;
use self::probe::{Distance, Probe};
pub use self::proximity::ProximitySettings;
use crate::defaults::settings;
use crate::error::RefineError;
use crate::problem::{Factor, NoiseModel, Rows, State};
use crate::scene::{Hand, HandMeasurement, Object, PreparedFrame};

/// Evidence from taxels that feel force.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum TouchModel {
    /// Nothing: they are as good as dead.
    Nothing,
    /// Each that it is near the surface, as in the paper. A contact spreads over the taxels around it, so that a touched taxel may be
    /// a few millimeters away, and one contact lights up a whole patch.
    Taxels(NoiseModel),
    /// Neighbors together that the skin touches the surface at their center of force.
    Contacts(ContactSettings),
}

impl TouchModel {
    /// Noise of distances of what is touched from the surface.
    pub(crate) fn noise_mut(&mut self) -> Option<&mut NoiseModel> {
        match self {
            Self::Nothing => None,
            Self::Taxels(noise) => Some(noise),
            Self::Contacts(contacts) => Some(&mut contacts.noise),
        }
    }
}

settings! {
    /// Settings of [`TactileFactor::new`].
    pub struct TactileSettings {
        /// Force above which a taxel counts as touched, the paper's γ \[N\].
        pub contact_threshold: f64 = 0.1,
        /// Model of touched taxels.
        pub touch: TouchModel = TouchModel::Contacts(ContactSettings::default()),
        /// Noise of depths of inactive taxels inside the object \[m\]; the dead ones are outliers.
        pub no_contact: NoiseModel = NoiseModel::cauchy(1e-3, f64::INFINITY),
    }
}

/// Distances of places of the hand from the object's surface: of taxels and contacts ([`new`](Self::new)), and of sensors that measure no forces.
///
/// Touched taxels and contacts are drawn to the surface from either side; inactive taxels are pushed out of it, which the
/// paper leaves unused. Both have Cauchy's kernel, because some taxels are dead and some report false forces.
pub struct TactileFactor {
    name: &'static str,
    object: Arc<Object>,
    hand: Arc<Hand>,
    probes: Vec<Probe>,
    normals: Vec<NormalProbe>,
}

impl TactileFactor {
    /// The paper's distance between the mesh and the taxels of `frame` in contact, or that of whole contacts ([`TouchModel`]), and the evidence of the
    /// other taxels.
    ///
    /// # Errors
    /// If the hand is unknown, or its forces are not one a taxel.
    pub fn new(frame: &PreparedFrame<'_>, settings: &TactileSettings) -> Result<Self, RefineError> {
        Self::of_hand("tactile", frame, |HandMeasurement { hand, forces, .. }| {
            hand.check_forces(forces)?;
            let links = hand.taxels.iter().map(|taxel| hand.link_of(taxel));
            let links = links.collect::<Result<Vec<usize>, _>>()?;
            Ok(probes(hand, &links, forces, settings))
        })
    }

    /// Factor called `name` of probes of the hand of `frame`.
    fn of_hand(
        name: &'static str,
        frame: &PreparedFrame<'_>,
        probes: impl FnOnce(&HandMeasurement) -> Result<Vec<Probe>, RefineError>,
    ) -> Result<Self, RefineError> {
        let measured = frame.require_hand(name)?;
        let (object, hand) = (Arc::clone(frame.object()), Arc::clone(&measured.hand));
        Ok(Self { name, object, hand, probes: probes(measured)?, normals: Vec::new() })
    }

    /// The hand at `state`; none that cannot be posed.
    fn posed(&self, state: &State) -> Option<ArticulatedRobot> {
        self.hand.articulated(&state.t_cam_hand, &state.joints).ok()
    }

    /// Distances of what is touched from the object's surface, positive outside \[m\]; of none for a hand that cannot be posed.
    pub(crate) fn touched_distances(&self, state: &State) -> Vec<f64> {
        let Some(hand) = self.posed(state) else { return Vec::new() };
        let touched = self.probes.iter().filter(|probe| probe.distance != Distance::Outside);
        let measured = touched.filter_map(|probe| probe.measure(&self.object, state, &hand));
        measured.map(|measured| measured.distance).collect()
    }
}

/// Probes of the taxels on `links` that feel `forces`.
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
    let probe = |(taxel, link): (&Taxel, &usize), distance, weighting| Probe {
        link: *link,
        position: taxel.position,
        distance,
        weighting,
    };
    let mut probes: Vec<Probe> = match &settings.touch {
        TouchModel::Nothing => Vec::new(),
        TouchModel::Taxels(noise) => {
            let touched = all().filter(|(_, force)| is_touched(force));
            let weighting = noise.weighting(touched.clone().count());
            touched.map(|(taxel, _)| probe(taxel, Distance::Is(0.0), weighting)).collect()
        }
        TouchModel::Contacts(contact) => {
            contacts(hand, links, forces, settings.contact_threshold, contact)
        }
    };
    let inactive = all().filter(|(_, force)| is_inactive(force));
    let weighting = settings.no_contact.weighting(inactive.clone().count());
    probes.extend(inactive.map(|(taxel, _)| probe(taxel, Distance::Outside, weighting)));
    probes
}

impl Factor for TactileFactor {
    fn name(&self) -> &'static str {
        self.name
    }

    /// A hand that cannot be posed costs nothing.
    fn rows(&self, state: &State, rows: &mut Rows<'_>) {
        let Some(hand) = self.posed(state) else { return };
        self.probes.iter().for_each(|probe| probe.add_row(&self.object, state, &hand, rows));
        self.normals.iter().for_each(|normal| normal.add_rows(&self.object, state, &hand, rows));
    }
}

#[cfg(test)]
mod tests {
    use super::super::gradient_check::{assert_gradient, fixture, scene};
    use super::*;
    use crate::problem::Block;
    use crate::scene::{BinaryContact, ContactPatch, Frame, ProximityReading, TouchReading};

    #[test]
    fn gradients_match_differences() {
        let default = TactileSettings::default();
        let taxels = TouchModel::Taxels(NoiseModel::cauchy(3e-3, 8.0));
        for touch in [default.touch.clone(), taxels] {
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
        let mut observation = scene.frame.clone();
        let contacts = TactileSettings::default();
        let touch = TouchModel::Taxels(NoiseModel::cauchy(3e-3, 8.0));
        let taxels = TactileSettings { touch, ..contacts.clone() };
        let probes = |observation: &Frame, settings: &TactileSettings| {
            let frame = PreparedFrame::new(observation, &scene.object).unwrap();
            TactileFactor::new(&frame, settings).unwrap().probes.len()
        };
        let all = probes(&observation, &taxels);
        fn forces(observation: &mut Frame) -> &mut [Vector3<f64>] {
            &mut observation.hand.as_mut().unwrap().forces
        }
        forces(&mut observation)[7] = HandMeasurement::UNKNOWN_FORCE;
        assert_eq!(probes(&observation, &taxels), all - 1);
        forces(&mut observation).fill(HandMeasurement::UNKNOWN_FORCE);
        assert_eq!([&taxels, &contacts].map(|settings| probes(&observation, settings)), [0, 0]);
    }

    #[test]
    fn gradients_of_touch_without_forces_match_differences() {
        let scene = scene();
        let place = |taxel: &Taxel| (scene.hand.link_of(taxel).unwrap(), taxel.position);
        let (mut contacts, mut distances) = (Vec::new(), Vec::new());
        for (k, taxel) in scene.hand.taxels.iter().enumerate() {
            let (link, position) = place(taxel);
            contacts.push(BinaryContact { link, position, touched: k % 3 == 0 });
            distances.push(ProximityReading { link, position, distance: 0.002 * (k % 7) as f64 });
        }
        let of_pad: Vec<&Taxel> = scene.hand.taxels.iter().filter(|t| t.patch == "11").collect();
        let patch = ContactPatch {
            link: place(of_pad[0]).0,
            points: of_pad.iter().map(|taxel| taxel.position).collect(),
            normals: of_pad.iter().map(|taxel| taxel.normal).collect(),
        };
        let mut observation = scene.frame.clone();
        observation.hand.as_mut().unwrap().touch = vec![
            TouchReading::Binary(contacts),
            TouchReading::Proximity(distances),
            TouchReading::Patch(patch),
        ];
        let frame = PreparedFrame::new(&observation, &scene.object).unwrap();
        let (binary, proximity, patch) = (
            TactileFactor::binary(&frame, &BinaryTouchSettings::default(), [true; 2]).unwrap(),
            TactileFactor::proximity(&frame, &ProximitySettings::default()).unwrap(),
            TactileFactor::patches(&frame, &ContactPatchSettings::default()).unwrap(),
        );
        let factors: [&dyn Factor; 3] = [&binary, &proximity, &patch];
        for seed in 0..3 {
            let (_, state) = fixture(seed);
            for factor in factors {
                for block in [Block::ObjectPose, Block::HandPose, Block::Joints(16)] {
                    assert_gradient(factor, &state, block, 1e-7, 1e-3);
                }
            }
        }
        // What is not used says nothing.
        let neither = BinaryTouchSettings::default();
        let neither = TactileFactor::binary(&frame, &neither, [false; 2]).unwrap();
        assert_eq!(neither.cost(&fixture(0).1), 0.0);
    }

    #[test]
    fn distances_that_are_right_cost_nothing() {
        let scene = scene();
        let (_, state) = fixture(0);
        let measured = scene.frame.hand.as_ref().unwrap();
        let hand = scene.hand.articulated(&measured.t_cam_hand, &measured.joints).unwrap();
        let truth = State { t_cam_object: scene.truth, ..state };
        let cost = |off: f64| {
            let reading = |taxel: &Taxel| {
                let link = scene.hand.link_of(taxel).unwrap();
                let point = hand.posed().t_world_links()[link] * taxel.position;
                let local = scene.truth.inverse() * point;
                let distance = scene.object.surface.signed_distance(&local).0 + off;
                ProximityReading { link, position: taxel.position, distance }
            };
            let mut observation = scene.frame.clone();
            let readings = scene.hand.taxels.iter().map(reading).collect();
            observation.hand.as_mut().unwrap().touch = vec![TouchReading::Proximity(readings)];
            let frame = PreparedFrame::new(&observation, &scene.object).unwrap();
            TactileFactor::proximity(&frame, &ProximitySettings::default()).unwrap().cost(&truth)
        };
        assert!(cost(0.0) < 1e-9 && cost(2e-3) > 0.1, "{} {}", cost(0.0), cost(2e-3));
    }

    #[test]
    fn a_patch_on_the_wrong_side_costs() {
        let scene = scene();
        let (_, state) = fixture(0);
        let truth = State { t_cam_object: scene.truth, ..state };
        // Where the object touches a pad, the skin's normal is against its own.
        let taxels = scene.hand.taxels.iter();
        let touched = taxels.zip(&scene.frame.hand.as_ref().unwrap().forces);
        let touched = touched.max_by(|a, b| a.1.norm().total_cmp(&b.1.norm())).unwrap().0;
        let cost = |sign: f64| {
            let mut observation = scene.frame.clone();
            observation.hand.as_mut().unwrap().touch = vec![TouchReading::Patch(ContactPatch {
                link: scene.hand.link_of(touched).unwrap(),
                points: vec![touched.position],
                normals: vec![touched.normal * sign],
            })];
            let frame = PreparedFrame::new(&observation, &scene.object).unwrap();
            let settings = ContactPatchSettings::default();
            TactileFactor::patches(&frame, &settings).unwrap().cost(&truth)
        };
        assert!(cost(-1.0) > cost(1.0) + 5.0, "{} {}", cost(1.0), cost(-1.0));
    }

    #[test]
    fn forces_must_fit_the_skin() {
        let scene = scene();
        let mut observation = scene.frame.clone();
        let settings = TactileSettings::default();
        if let Some(hand) = &mut observation.hand {
            hand.forces.pop();
        }
        let frame = PreparedFrame::new(&observation, &scene.object).unwrap();
        let error = TactileFactor::new(&frame, &settings).err().unwrap().to_string();
        assert_eq!(error, "367 taxel forces were given for 368 taxels");
        observation.hand = None;
        let frame = PreparedFrame::new(&observation, &scene.object).unwrap();
        let refused = TactileFactor::new(&frame, &settings);
        assert!(matches!(refused, Err(RefineError::Missing { .. })));
    }
}
