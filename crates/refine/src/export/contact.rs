//! Where hand and object touch.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::data::CONTACT_DISTANCE;
use crate::error::RefineError;
use crate::factor::TactileSettings;
use crate::scene::{Hand, HandMeasurement, Object, Observation, TouchReading};

/// By what a contact is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum ContactKind {
    /// A taxel measures a force.
    Force = 0,
    /// A sensor says that it is touched.
    Touched = 1,
    /// A point of a surface that presses into a soft skin.
    Patch = 2,
    /// The surfaces are near each other, with the object in the pose asked for.
    Shape = 3,
}

/// A point of contact, in the camera's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactPoint {
    /// By what it is known.
    pub kind: ContactKind,
    /// Name of the link that is touched.
    pub link: String,
    /// Where it is \[m\]: on the hand, or for [`ContactKind::Shape`] on the object.
    pub position: Point3<f64>,
    /// Unit normal out of the hand; of [`ContactKind::Touched`] and [`ContactKind::Shape`] that of the object there, inward, and zero where it is beyond 5 cm.
    pub normal: Vector3<f64>,
    /// Force of the object on the hand \[N\], NaN where it is not known.
    pub force: Vector3<f64>,
    /// Distance of the other surface, negative inside it \[m\]; NaN beyond 5 cm.
    pub distance: f64,
}

/// Contacts farther from the object have no distance \[m\].
const REACH: f64 = 0.05;

/// The contacts that an observation knows of, and those that the pose `t_cam_object` of `object` \[m\] makes: samples of its surface within 5 mm of the hand.
/// Taxels count as touched above 0.1 N. None without a hand.
///
/// # Errors
/// If joints, forces or links do not fit the hand.
pub fn contacts(
    observation: &Observation,
    hand: Option<&Hand>,
    object: &Object,
    t_cam_object: &Isometry3<f64>,
) -> Result<Vec<ContactPoint>, RefineError> {
    let Some((hand, measured)) = hand.zip(observation.hand.as_ref()) else {
        return Ok(Vec::new());
    };
    let posed = hand.posed(&measured.t_cam_hand, &measured.joints)?;
    let links = posed.t_world_links();
    let name = |link: usize| hand.tree.links()[link].name.clone();
    let mut found = felt(hand, measured, links)?;
    let t_object_cam = t_cam_object.inverse();
    for contact in &mut found {
        let local = t_object_cam * contact.position;
        if let Some((distance, closest)) = object.surface.signed_distance_within(&local, REACH) {
            contact.distance = distance;
            if contact.normal == Vector3::zeros() {
                let normal = object.normals[closest.face as usize];
                contact.normal = -(t_cam_object * normal);
            }
        }
    }
    for sample in &object.samples {
        let position = t_cam_object * sample.point;
        let Some(distance) = posed.signed_distance(&position, CONTACT_DISTANCE) else { continue };
        let Some(closest) = posed.closest(&position, f64::INFINITY) else { continue };
        found.push(ContactPoint {
            kind: ContactKind::Shape,
            link: name(closest.link),
            position,
            normal: -(t_cam_object * sample.normal),
            force: HandMeasurement::UNKNOWN_FORCE,
            distance,
        });
    }
    Ok(found)
}

/// What is felt, with normals of zero where layouts have none.
fn felt(
    hand: &Hand,
    measured: &HandMeasurement,
    links: &[Isometry3<f64>],
) -> Result<Vec<ContactPoint>, RefineError> {
    let point =
        |kind, link: usize, position: &Point3<f64>, normal: &Vector3<f64>, force: &Vector3<f64>| {
            let t_cam_link = &links[link];
            ContactPoint {
                kind,
                link: hand.tree.links()[link].name.clone(),
                position: t_cam_link * position,
                normal: t_cam_link * normal,
                force: t_cam_link * force,
                distance: f64::NAN,
            }
        };
    let mut found = Vec::new();
    if !measured.forces.is_empty() {
        hand.check_forces(&measured.forces)?;
        let least = TactileSettings::default().contact_threshold;
        for (taxel, force) in hand.taxels.iter().zip(&measured.forces) {
            // Nothing is known of NaN, which is above nothing.
            if force.norm() > least {
                let link = hand.link_of(taxel)?;
                found.push(point(ContactKind::Force, link, &taxel.position, &taxel.normal, force));
            }
        }
    }
    let (unknown, none) = (HandMeasurement::UNKNOWN_FORCE, Vector3::zeros());
    for reading in &measured.touch {
        match reading {
            TouchReading::Binary(places) => {
                for place in places.iter().filter(|place| place.touched) {
                    let (link, position) = (place.link, &place.position);
                    found.push(point(ContactKind::Touched, link, position, &none, &unknown));
                }
            }
            TouchReading::Patch(patch) => {
                for (position, normal) in patch.points.iter().zip(&patch.normals) {
                    found.push(point(ContactKind::Patch, patch.link, position, normal, &unknown));
                }
            }
            // That something is near is no contact.
            TouchReading::Proximity(_) => {}
        }
    }
    Ok(found)
}
