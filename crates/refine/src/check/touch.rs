//! Forces on the hand's taxels: their unit and sign, the layout of the taxels, and where they are felt.

use nalgebra::{Isometry3, Point3, Vector3};

use super::limits::{
    HAND_FROM_OBJECT, HELD_FORCE, PRESSING_SHARE, TAXEL_FORCE, TAXEL_FROM_LINK, TOTAL_FORCE,
    TOUCH_CLEAR, TOUCH_FROM_OBJECT, TOUCHED,
};
use super::warning::{Subject, Warning};
use crate::scene::{Hand, HandMeasurement, Object, median};

/// Warnings of the forces by themselves, and whether their places tell anything.
pub(super) fn check(measured: &HandMeasurement) -> (Vec<Warning>, bool) {
    let HandMeasurement { hand, forces, .. } = measured;
    if forces.is_empty() {
        return (Vec::new(), false);
    }
    let warning = |value, finding: String, hint| Warning::new(Subject::Touch, value, finding, hint);
    let links = hand.taxels.iter().try_for_each(|taxel| hand.link_of(taxel).map(|_| ()));
    if let Err(error) = hand.check_forces(forces).and(links) {
        return (vec![warning((forces.len() as f64, ""), error.to_string(), "")], false);
    }
    let mut warnings = Vec::new();
    let is_broken = |f: &&Vector3<f64>| !f.norm().is_finite() && !HandMeasurement::is_unknown(f);
    let broken = forces.iter().filter(is_broken).count();
    if broken > 0 {
        let finding = format!("{broken} of {} taxel forces are no numbers", forces.len());
        warnings.push(warning((broken as f64, ""), finding, ""));
    }
    let norms = || forces.iter().map(|f| f.norm()).filter(|f| f.is_finite());
    let (sum, largest) = (norms().sum::<f64>(), norms().fold(0.0, f64::max));
    if largest > TAXEL_FORCE || sum > TOTAL_FORCE || (largest > 0.0 && largest < HELD_FORCE) {
        let finding =
            format!("the largest taxel force is {largest:.4} N, all are {sum:.4} N together");
        let hint = "are they in the unit of the format (newtons in a frame file, thousandths of one in scene_tactile.json), or raw counts?";
        warnings.push(warning((largest, "N"), finding, hint));
    }
    let pairs = hand.taxels.iter().zip(forces).filter(|(_, f)| f.norm().is_finite());
    let pressing = pairs.map(|(taxel, force)| -force.dot(&taxel.normal)).sum::<f64>() / sum;
    // An offset on all of them, which is said elsewhere, has no sign.
    let offset = median(norms()).is_some_and(|force| force > TOUCHED);
    if pressing < PRESSING_SHARE && !offset {
        let finding = format!("{:.0} % of the taxel forces pull at the skin", -pressing * 1e2);
        let hint = "are they those of the object on the hand, in the frames of the links?";
        warnings.push(warning((pressing, ""), finding, hint));
    }
    let layout = far_from_link(hand);
    let readable = layout.is_none();
    warnings.extend(layout);
    (warnings, readable)
}

/// Warning of the taxel that is farthest from its link.
fn far_from_link(hand: &Hand) -> Option<Warning> {
    let distance = |taxel| {
        let link = hand.link_of(taxel).ok()?;
        let distance = hand.shape.links()[link].signed_distance(&taxel.position);
        distance.is_finite().then_some((taxel, distance))
    };
    let farthest = hand.taxels.iter().filter_map(distance).max_by(|a, b| a.1.total_cmp(&b.1));
    let (taxel, distance) = farthest.filter(|(_, distance)| *distance > TAXEL_FROM_LINK)?;
    let finding = format!("a taxel is {:.1} cm from its link {}", distance * 1e2, taxel.link);
    let hint = "is the layout in meters, in the frames of the links?";
    Some(Warning::new(Subject::Touch, (distance * 1e2, "cm"), finding, hint))
}

/// Warning of where forces are felt, with the object where mask and depth have it (object → camera). There must be one force for each taxel.
pub(super) fn check_places(
    measured: &HandMeasurement,
    object: &Object,
    t_cam_object: &Isometry3<f64>,
) -> Option<Warning> {
    let hand = &measured.hand;
    let links = hand.tree.forward_kinematics(&measured.joints);
    let t_object_hand = t_cam_object.inverse() * measured.t_cam_hand;
    // Distances of touched taxels from the object, each with its force.
    let mut touched: Vec<(f64, f64)> = Vec::new();
    for (taxel, force) in hand.taxels.iter().zip(&measured.forces) {
        let Ok(link) = hand.link_of(taxel) else { continue };
        if force.norm() > TOUCHED && force.norm().is_finite() {
            let place: Point3<f64> = t_object_hand * links[link] * taxel.position;
            touched.push((object.surface.signed_distance(&place).0, force.norm()));
        }
    }
    let (count, of) = (touched.len(), hand.taxels.len());
    let far = touched.iter().filter(|(distance, _)| *distance > TOUCH_CLEAR).count();
    if 2 * count > of && 4 * far > count {
        let middle = median(measured.forces.iter().map(|f| f.norm()).filter(|f| f.is_finite()))?;
        let finding = format!(
            "{count} of {of} taxels feel more than {TOUCHED} N ({middle:.2} N in the median), {far} of them more than \
             {:.1} cm from the object",
            TOUCH_CLEAR * 1e2
        );
        let hint = "has what they read without load been subtracted?";
        return Some(Warning::new(Subject::Touch, (middle, "N"), finding, hint));
    }
    let distance = weighted_median(touched).filter(|distance| *distance > TOUCH_FROM_OBJECT)?;
    let posed = hand.posed(&measured.t_cam_hand, &measured.joints).ok()?;
    let gap = object.samples.iter().fold(f64::INFINITY, |gap, sample| {
        posed.signed_distance(&(t_cam_object * sample.point), gap).map_or(gap, |d| d.min(gap))
    });
    let (subject, by, finding, hint) = if gap > HAND_FROM_OBJECT {
        let finding = format!("it is {:.1} cm from the hand", gap * 1e2);
        (
            Subject::Hand,
            gap,
            finding,
            "are the hand's pose (base to camera), joints and URDF right?",
        )
    } else {
        let finding =
            format!("they are {:.1} cm from it (in the median of forces)", distance * 1e2);
        let hint = "are forces in the order of the layout, and the hand's pose and joints right?";
        (Subject::Touch, distance, finding, hint)
    };
    let finding =
        format!("{count} taxels feel the object, but {finding} where mask and depth have it");
    Some(Warning::new(subject, (by * 1e2, "cm"), finding, hint))
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
