//! The mask against the object at the pose, and against what depth shows under it and across its border: where that runs, one thing ends before another.

use super::limits;
use super::warning::{Subject, Warning, Warnings};
use crate::scene::{Object, View, median};

/// Distance from the border at which depth is read on both sides: cameras blur depth at edges \[px\].
const STEP: usize = 5;

/// Distance of the hand from where it is drawn, at most \[px\].
const BESIDE: usize = 8;

/// Depth that differs less is of the same surface \[m\].
const SMOOTH: f64 = 10e-3;

/// Fewest places along the border that tell anything.
const LEAST_PLACES: usize = 50;

/// Warning of a mask that is not that of the visible part of the object, whose center has depth `z` \[m\]. The pose is blamed if `mask_fits` what
/// depth shows; what hides the object is not known if `hand_wrong`.
pub(super) fn at_pose(
    view: &View<'_>,
    z: f64,
    mask_fits: bool,
    hand_wrong: bool,
) -> Option<Warning> {
    let [of_mask, of_model] = view.sums();
    let (mask, model) = (of_mask.z, of_model.z);
    let both = view.pixels().filter(|(_, pixel)| pixel.masked && pixel.shows_object());
    let overlap = both.count() as f64;
    let area = mask / model;
    // An inverted mask has the border of a right one.
    let (subject, cause) = if mask_fits && limits::MASK_AREA.contains(&area) {
        (Subject::Pose, "the mask fits depth: is the pose right, and the mesh of this object?")
    } else {
        let cause = "wrong pose, another mesh, or a mask that is inverted or of something else?";
        (Subject::Mask, cause)
    };
    if overlap == 0.0 {
        let message = "the object at this pose does not touch its mask: wrong frame or pose?";
        return Some(Warning { subject, message: message.into() });
    }
    let share = overlap / (mask + model - overlap);
    let pixels = (of_mask.xy() / mask - of_model.xy() / model).norm();
    let shift = pixels * z / view.frame.camera.fx;
    let message = format!(
        "the object at this pose overlaps its mask by {:.0} %: the mask's center is {pixels:.0} px ({:.1} cm) beside that of what \
         should be seen, its area {area:.2} times: {cause}",
        share * 1e2,
        shift * 1e2
    );
    let is_off = !limits::MASK_AREA.contains(&area)
        || shift > limits::MASK_SHIFT
        || share < limits::MASK_OVERLAP;
    (is_off && !hand_wrong).then_some(Warning { subject, message })
}

/// Adds what depth shows under the mask, and across its border, that is not the object to `found`; true if all of this was asked and nothing found. The hand is
/// not asked unless `hand_fits`.
pub(super) fn off_object(
    view: &View<'_>,
    object: &Object,
    hand_fits: bool,
    found: &mut Warnings,
) -> bool {
    let masked = || view.pixels().map(|(_, p)| p).filter(|p| p.masked && p.sensor > 0.0);
    let count = masked().count() as f64;
    let Some(middle) = median(masked().map(|p| f64::from(p.sensor))) else { return false };
    let beyond = middle + 2.0 * object.radius;
    let share = |count_of: usize| count_of as f64 / count;
    let behind = share(masked().filter(|p| f64::from(p.sensor) > beyond).count());
    let of_hand =
        || masked().filter(|p| p.is_on_hand(limits::HAND_REACH_AT_OBJECT) && !p.shows_object());
    let on_hand = if hand_fits { share(of_hand().count()) } else { 0.0 };
    let cut = if hand_fits { cut_share(view) } else { None };
    if behind > limits::MASK_BEHIND || on_hand > limits::MASK_ON_HAND {
        let [on_hand, behind] = [on_hand, behind].map(|share| share * 1e2);
        let message = format!(
            "{on_hand:.0} % of the mask's pixels are on the hand and {behind:.0} % on what is behind the object: does it leak, \
             is it shifted, or of the whole object (mask, not mask_visib)?"
        );
        found.add(Subject::Mask, message);
        return false;
    }
    if let Some(cut) = cut.filter(|cut| *cut > limits::MASK_CUT) {
        let message = format!(
            "along {:.0} % of the mask's border the same surface goes on outside of it: is the mask shifted, or too small?",
            cut * 1e2
        );
        found.add(Subject::Mask, message);
        return false;
    }
    cut.is_some()
}

/// Part of the mask's border along which the surface goes on outside of the mask, and is not the hand's; none if depth tells too
/// little.
fn cut_share(view: &View<'_>) -> Option<f64> {
    let width = view.size().0 as isize;
    // All that is asked for is inside the image.
    let margin = STEP + 1 + BESIDE;
    let (mut places, mut cut) = (0_usize, 0_usize);
    for (index, _) in view.inner_pixels(margin).filter(|(_, p)| p.masked) {
        for outward in [1, -1, width, -width] {
            let at = |steps: usize| index.wrapping_add_signed(steps as isize * outward);
            if view.pixel(at(1)).masked {
                continue;
            }
            let inside = view.pixel(index.wrapping_add_signed(-(STEP as isize) * outward));
            let outside = view.pixel(at(STEP + 1));
            let known = inside.sensor > 0.0 && outside.sensor > 0.0;
            if !known || !inside.masked || outside.masked {
                continue;
            }
            places += 1;
            let smooth = f64::from((inside.sensor - outside.sensor).abs()) < SMOOTH;
            cut += usize::from(smooth && !near_hand(view, at(STEP + 1), outside.sensor));
        }
    }
    (places >= LEAST_PLACES).then(|| cut as f64 / places as f64)
}

/// True where the hand is drawn at or beside the pixel of that index, about as deep as `sensor` \[m\].
fn near_hand(view: &View<'_>, index: usize, sensor: f32) -> bool {
    let (width, reach) = (view.size().0 as isize, BESIDE as isize);
    let steps = [-reach, 0, reach];
    steps.iter().any(|dy| {
        steps.iter().any(|dx| {
            let hand = view.pixel(index.wrapping_add_signed(dy * width + dx)).hand;
            hand > 0.0 && f64::from((hand - sensor).abs()) < limits::HAND_REACH
        })
    })
}
