//! Forces on the hand's taxels: their unit and sign, the layout of the taxels, and where they are felt.

use nalgebra::{Isometry3, Point3, Vector3};

use super::limits;
use super::warning::{Subject, Warnings};
use crate::scene::{Hand, HandMeasurement, Object, median};

/// Adds what is wrong with the forces by themselves to `found`; true if their places tell anything.
pub(super) fn check(measured: &HandMeasurement, found: &mut Warnings) -> bool {
    let HandMeasurement { hand, forces, .. } = measured;
    if forces.is_empty() {
        return false;
    }
    let mut warn = |message| found.add(Subject::Touch, message);
    let links = hand.taxels.iter().try_for_each(|taxel| hand.link_of(taxel).map(|_| ()));
    if let Err(error) = hand.check_forces(forces).and(links) {
        warn(error.to_string());
        return false;
    }
    let is_broken = |f: &&Vector3<f64>| !f.norm().is_finite() && !HandMeasurement::is_unknown(f);
    let (broken, of) = (forces.iter().filter(is_broken).count(), forces.len());
    if broken > 0 {
        warn(format!("{broken} of {of} taxel forces are no numbers"));
    }
    let norms = || forces.iter().map(|f| f.norm()).filter(|f| f.is_finite());
    let (sum, largest) = (norms().sum::<f64>(), norms().fold(0.0, f64::max));
    if largest > limits::TAXEL_FORCE
        || sum > limits::TOTAL_FORCE
        || (largest > 0.0 && largest < limits::HELD_FORCE)
    {
        warn(format!(
            "the largest taxel force is {largest:.4} N, all are {sum:.4} N together: are they in the unit of the format \
             (newtons in a frame file, thousandths of one in scene_tactile.json), or raw counts?"
        ));
    }
    let pairs = hand.taxels.iter().zip(forces).filter(|(_, f)| f.norm().is_finite());
    let pulling = pairs.map(|(taxel, force)| force.dot(&taxel.normal)).sum::<f64>() / sum;
    // An offset on all of them, which is said elsewhere, has no sign.
    let offset = median(norms()).is_some_and(|force| force > limits::TOUCHED);
    if -pulling < limits::PRESSING_SHARE && !offset {
        warn(format!(
            "{:.0} % of the taxel forces pull at the skin: are they those of the object on the hand, in the frames of the links?",
            pulling * 1e2
        ));
    }
    let far = farthest_from_link(hand).filter(|(_, distance)| *distance > limits::TAXEL_FROM_LINK);
    if let Some((link, distance)) = far {
        warn(format!(
            "a taxel is {:.1} cm from its link {link}: is the layout in meters, in the frames of the links?",
            distance * 1e2
        ));
    }
    far.is_none()
}

/// Link of the taxel that is farthest from its link, and that distance \[m\].
fn farthest_from_link(hand: &Hand) -> Option<(&str, f64)> {
    let distances = hand.taxels.iter().filter_map(|taxel| {
        let link = hand.link_of(taxel).ok()?;
        let distance = hand.shape.links()[link].signed_distance(&taxel.position);
        distance.is_finite().then_some((&*taxel.link, distance))
    });
    distances.max_by(|a, b| a.1.total_cmp(&b.1))
}

/// Adds what is wrong with where forces are felt to `found`, with the object where mask and depth have it (object → camera). There must be one force for each
/// taxel.
pub(super) fn check_places(
    measured: &HandMeasurement,
    object: &Object,
    t_cam_object: &Isometry3<f64>,
    found: &mut Warnings,
) {
    let hand = &measured.hand;
    let links = hand.tree.forward_kinematics(&measured.joints);
    let t_object_hand = t_cam_object.inverse() * measured.t_cam_hand;
    // Distances of touched taxels from the object, each with its force.
    let mut touched: Vec<(f64, f64)> = Vec::new();
    for (taxel, force) in hand.taxels.iter().zip(&measured.forces) {
        let Ok(link) = hand.link_of(taxel) else { continue };
        if force.norm() > limits::TOUCHED && force.norm().is_finite() {
            let place: Point3<f64> = t_object_hand * links[link] * taxel.position;
            touched.push((object.surface.signed_distance(&place).0, force.norm()));
        }
    }
    let (count, of) = (touched.len(), hand.taxels.len());
    let far = touched.iter().filter(|(distance, _)| *distance > limits::TOUCH_CLEAR).count();
    let norms = measured.forces.iter().map(|f| f.norm()).filter(|f| f.is_finite());
    if 2 * count > of && 4 * far > count {
        let message = format!(
            "{count} of {of} taxels feel more than {} N ({:.2} N in the median), {far} of them more than {:.1} cm \
             from the object: has what they read without load been subtracted?",
            limits::TOUCHED,
            median(norms).unwrap_or_default(),
            limits::TOUCH_CLEAR * 1e2
        );
        return found.add(Subject::Touch, message);
    }
    let distance =
        weighted_median(touched).filter(|distance| *distance > limits::TOUCH_FROM_OBJECT);
    let posed = hand.posed(&measured.t_cam_hand, &measured.joints);
    let (Some(distance), Ok(posed)) = (distance, posed) else { return };
    let gap = object.samples.iter().fold(f64::INFINITY, |gap, sample| {
        posed.signed_distance(&(t_cam_object * sample.point), gap).map_or(gap, |d| d.min(gap))
    });
    let (gap_cm, distance_cm) = (gap * 1e2, distance * 1e2);
    if gap > limits::HAND_FROM_OBJECT {
        let message = format!(
            "{count} taxels feel the object, but it is {gap_cm:.1} cm from the hand where mask and depth have it: are the \
             hand's pose (base to camera), joints and description right?"
        );
        return found.add(Subject::Hand, message);
    }
    let message = format!(
        "{count} taxels feel the object, but they are {distance_cm:.1} cm from it (in the median of forces) where mask and \
         depth have it: are forces in the order of the layout, and the hand's pose and joints right?"
    );
    found.add(Subject::TouchPlace, message);
}

/// The value on either side of which is half of the weight, of pairs of value and weight; none of none.
fn weighted_median(mut pairs: Vec<(f64, f64)>) -> Option<f64> {
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * pairs.iter().map(|(_, weight)| weight).sum::<f64>();
    let mut below = 0.0;
    let middle = pairs.iter().find(|(_, weight)| {
        below += weight;
        below >= half
    });
    middle.map(|(value, _)| *value)
}
