//! Forces on the hand's taxels by themselves: their unit and sign, and the layout of the taxels.

use nalgebra::Vector3;

use super::touch::TOUCHED;
use super::warning::{Subject, Warning};
use crate::scene::view::median;
use crate::scene::{Hand, HandMeasurement};

/// Largest force of a taxel, and of all together \[N\].
const MOST_OF_TAXEL: f64 = 50.0;
const MOST_OF_ALL: f64 = 500.0;

/// If no force is larger \[N\], all are too small to be of a held object.
const LEAST_LARGEST: f64 = 0.02;

/// Least part of all forces that presses into the skin.
const LEAST_PRESSING: f64 = -0.3;

/// Farthest distance of a taxel from its link \[m\].
const FROM_LINK: f64 = 10e-3;

/// What is wrong with the forces by themselves, and whether their places tell anything.
pub(super) fn inspect(hand: &Hand, measured: &HandMeasurement) -> (Vec<Warning>, bool) {
    let forces = &measured.forces;
    if forces.is_empty() {
        return (Vec::new(), false);
    }
    let links = hand.taxels.iter().try_for_each(|taxel| hand.link_of(taxel).map(|_| ()));
    if let Err(error) = hand.check_forces(forces).and(links) {
        let count = forces.len() as f64;
        return (vec![Warning::new(Subject::Touch, count, "").found(error.to_string())], false);
    }
    let mut warnings = Vec::new();
    let is_broken = |f: &&Vector3<f64>| !f.norm().is_finite() && !HandMeasurement::is_unknown(f);
    let broken = forces.iter().filter(is_broken).count();
    if broken > 0 {
        let finding = format!("{broken} of {} taxel forces are no numbers", forces.len());
        warnings.push(Warning::new(Subject::Touch, broken as f64, "").found(finding));
    }
    let norms = || forces.iter().map(|f| f.norm()).filter(|f| f.is_finite());
    let (sum, largest) = (norms().sum::<f64>(), norms().fold(0.0, f64::max));
    if largest > MOST_OF_TAXEL || sum > MOST_OF_ALL || (largest > 0.0 && largest < LEAST_LARGEST) {
        warnings.push(
            Warning::new(Subject::Touch, largest, "N")
                .found(format!("the largest taxel force is {largest:.4} N, all are {sum:.4} N together"))
                .hint("are they in the unit of the format (newtons in a frame file, thousandths of one in scene_tactile.json), or raw counts?"),
        );
    }
    let pairs = hand.taxels.iter().zip(forces).filter(|(_, f)| f.norm().is_finite());
    let pressing = pairs.map(|(taxel, force)| -force.dot(&taxel.normal)).sum::<f64>() / sum;
    // An offset on all of them, which is said elsewhere, has no sign.
    let offset = median(norms()).is_some_and(|force| force > TOUCHED);
    if pressing < LEAST_PRESSING && !offset {
        warnings.push(
            Warning::new(Subject::Touch, pressing, "")
                .found(format!("{:.0} % of the taxel forces pull at the skin", -pressing * 1e2))
                .hint("are they those of the object on the hand, in the frames of the links?"),
        );
    }
    let layout = far_from_link(hand);
    let readable = layout.is_none();
    warnings.extend(layout);
    (warnings, readable)
}

/// The taxel that is farthest from its link.
fn far_from_link(hand: &Hand) -> Option<Warning> {
    let distance = |taxel| {
        let link = hand.link_of(taxel).ok()?;
        let distance = hand.shape.links()[link].signed_distance(&taxel.position);
        distance.is_finite().then_some((taxel, distance))
    };
    let farthest = hand.taxels.iter().filter_map(distance).max_by(|a, b| a.1.total_cmp(&b.1));
    let (taxel, distance) = farthest.filter(|(_, distance)| *distance > FROM_LINK)?;
    let warning = Warning::new(Subject::Touch, distance * 1e2, "cm").found(format!(
        "a taxel is {:.1} cm from its link {}",
        distance * 1e2,
        taxel.link
    ));
    Some(warning.hint("is the layout in meters, in the frames of the links?"))
}
