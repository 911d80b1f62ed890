//! The mask against the object at the pose, and against what depth shows under it and across its border: where that runs, one thing ends before another.

use super::limits::{
    HAND_REACH, HAND_REACH_AT_OBJECT, MASK_AREA, MASK_BEHIND, MASK_CUT, MASK_ON_HAND, MASK_OVERLAP,
    MASK_SHIFT,
};
use super::warning::{Subject, Warning};
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
    let (subject, hint) = if mask_fits && MASK_AREA.contains(&area) {
        (Subject::Pose, "the mask fits depth: is the pose right, and the mesh of this object?")
    } else {
        let hint = "wrong pose, another mesh, or a mask that is inverted or of something else?";
        (Subject::Mask, hint)
    };
    if overlap == 0.0 {
        let finding = "the object at this pose does not touch its mask";
        return Some(Warning::new(subject, (0.0, ""), finding, "wrong frame or pose?"));
    }
    let share = overlap / (mask + model - overlap);
    let pixels = (of_mask.xy() / mask - of_model.xy() / model).norm();
    let shift = pixels * z / view.frame.camera.fx;
    let value = if hand_wrong {
        return None;
    } else if !MASK_AREA.contains(&area) {
        (area, "")
    } else if shift > MASK_SHIFT {
        (pixels, "px")
    } else if share < MASK_OVERLAP {
        (share, "")
    } else {
        return None;
    };
    let finding = format!(
        "the object at this pose overlaps its mask by {:.0} %: the mask's center is {pixels:.0} px ({:.1} cm) \
         beside that of what should be seen, its area {area:.2} times",
        share * 1e2,
        shift * 1e2
    );
    Some(Warning::new(subject, value, finding, hint))
}

/// Warning of what depth shows under the mask, and across its border, that is not the object; and whether all of this was asked and nothing found. The hand is not asked
/// unless `hand_fits`.
pub(super) fn off_object(
    view: &View<'_>,
    object: &Object,
    hand_fits: bool,
) -> (Option<Warning>, bool) {
    let masked = || view.pixels().map(|(_, p)| p).filter(|p| p.masked && p.sensor > 0.0);
    let count = masked().count() as f64;
    let Some(middle) = median(masked().map(|p| f64::from(p.sensor))) else { return (None, false) };
    let beyond = middle + 2.0 * object.radius;
    let share = |count_of: usize| count_of as f64 / count;
    let behind = share(masked().filter(|p| f64::from(p.sensor) > beyond).count());
    let of_hand = || masked().filter(|p| p.is_on_hand(HAND_REACH_AT_OBJECT) && !p.shows_object());
    let on_hand = if hand_fits { share(of_hand().count()) } else { 0.0 };
    if behind > MASK_BEHIND || on_hand > MASK_ON_HAND {
        let finding = format!(
            "{:.0} % of the mask's pixels are on the hand and {:.0} % on what is behind the object",
            on_hand * 1e2,
            behind * 1e2
        );
        let hint = "does it leak, is it shifted, or of the whole object (mask, not mask_visib)?";
        return (Some(Warning::new(Subject::Mask, (on_hand + behind, ""), finding, hint)), false);
    }
    let cut = if hand_fits { cut_share(view) } else { None };
    let Some(cut) = cut.filter(|cut| *cut > MASK_CUT) else { return (None, cut.is_some()) };
    let percent = cut * 1e2;
    let finding =
        format!("along {percent:.0} % of the mask's border the same surface goes on outside of it");
    let hint = "is the mask shifted, or too small?";
    (Some(Warning::new(Subject::Mask, (cut, ""), finding, hint)), false)
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
            hand > 0.0 && f64::from((hand - sensor).abs()) < HAND_REACH
        })
    })
}
