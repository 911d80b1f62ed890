//! Where the hand's taxels feel forces: on the object, and not everywhere.

use nalgebra::{Isometry3, Point3};

use super::warning::{Subject, Warning};
use crate::scene::view::median;
use crate::scene::{Hand, HandMeasurement, Object};

/// A taxel that feels more is touched \[N\].
pub(super) const TOUCHED: f64 = 0.1;

/// Farthest distance of what is felt from the object where mask and depth have it \[m\].
const FROM_OBJECT: f64 = 25e-3;

/// If taxels this far from the object are among what is felt everywhere, it is not the object \[m\].
const CLEAR: f64 = 10e-3;

/// A hand that touches the object is no farther from it \[m\].
const FROM_HAND: f64 = 20e-3;

/// What is wrong with where forces are felt, with the object where mask and depth have it (object → camera). There must be one
/// for each taxel.
pub(super) fn inspect(
    hand: &Hand,
    measured: &HandMeasurement,
    object: &Object,
    t_cam_object: &Isometry3<f64>,
) -> Option<Warning> {
    let links = hand.tree.forward_kinematics(&measured.joints);
    let t_object_hand = t_cam_object.inverse() * measured.t_cam_hand;
    let mut touched: Vec<(f64, f64)> = Vec::new();
    for (taxel, force) in hand.taxels.iter().zip(&measured.forces) {
        let Ok(link) = hand.link_of(taxel) else { continue };
        if force.norm() > TOUCHED && force.norm().is_finite() {
            let place: Point3<f64> = t_object_hand * links[link] * taxel.position;
            touched.push((object.surface.signed_distance(&place).0, force.norm()));
        }
    }
    let count = touched.len();
    let far = touched.iter().filter(|(distance, _)| *distance > CLEAR).count();
    let warning = |subject, value: f64| Warning::new(subject, value * 1e2, "cm");
    if 2 * count > hand.taxels.len() && 4 * far > count {
        let middle = median(measured.forces.iter().map(|f| f.norm()).filter(|f| f.is_finite()))?;
        return Some(
            Warning::new(Subject::Touch, middle, "N")
                .found(format!(
                    "{count} of {} taxels feel more than {TOUCHED} N ({middle:.2} N in the median), {far} of them more than \
                     {:.1} cm from the object",
                    hand.taxels.len(),
                    CLEAR * 1e2
                ))
                .hint("has what they read without load been subtracted?"),
        );
    }
    let distance = weighted_median(touched).filter(|distance| *distance > FROM_OBJECT)?;
    let posed = hand.posed(&measured.t_cam_hand, &measured.joints).ok()?;
    let gap = object.samples.iter().fold(f64::INFINITY, |gap, sample| {
        posed.signed_distance(&(t_cam_object * sample.point), gap).map_or(gap, |d| d.min(gap))
    });
    if gap > FROM_HAND {
        let finding = format!(
            "{count} taxels feel the object, but it is {:.1} cm from the hand where mask and depth have it",
            gap * 1e2
        );
        let hint = "are the hand's pose (base to camera), joints and URDF right?";
        return Some(warning(Subject::Hand, gap).found(finding).hint(hint));
    }
    let finding = format!(
        "{count} taxels feel the object, but are {:.1} cm from it (in the median of forces) where mask and depth \
         have it",
        distance * 1e2
    );
    let hint = "are forces in the order of the layout, and the hand's pose and joints right?";
    Some(warning(Subject::Touch, distance).found(finding).hint(hint))
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
