//! The mask against the object at the pose, and against what depth shows under it.

use super::border::cut_share;
use super::warning::{Subject, Warning};
use crate::scene::Object;
use crate::scene::view::{View, median};

/// Least intersection over union of the mask and the object at a pose to start from.
const LEAST_OVERLAP: f64 = 0.25;

/// Farthest distance between their centers that poses to start from explain \[m\].
const MOST_SHIFT: f64 = 0.05;

/// Ratios of their areas that poses to start from explain.
const PLAUSIBLE_AREA: std::ops::Range<f64> = 0.4..2.5;

/// Largest parts of the mask on the hand, and on what is behind the object.
const MOST_ON_HAND: f64 = 0.2;
const MOST_BEHIND: f64 = 0.05;

/// Largest part of the mask's border within a surface.
const MOST_CUT: f64 = 0.12;

/// Depth this near to that of the hand is of the hand \[m\].
const REACH: f64 = 8e-3;

/// How the mask differs from the visible part of the object, whose center has depth `z` \[m\]. The pose is blamed if `mask_fits` what
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
    // An inverted mask has the border of a right one.
    let mask_fits = mask_fits && PLAUSIBLE_AREA.contains(&(mask / model));
    let subject = if mask_fits { Subject::Pose } else { Subject::Mask };
    let warning = |value, unit| Warning::new(subject, value, unit);
    if overlap == 0.0 {
        let finding = "the object at this pose does not touch its mask".into();
        return Some(warning(0.0, "").found(finding).hint("wrong frame or pose?"));
    }
    if hand_wrong {
        return None;
    }
    let share = overlap / (mask + model - overlap);
    let (pixels, area) = ((of_mask.xy() / mask - of_model.xy() / model).norm(), mask / model);
    let shift = pixels * z / view.observation.camera.fx;
    let (value, unit) = if !PLAUSIBLE_AREA.contains(&area) {
        (area, "")
    } else if shift > MOST_SHIFT {
        (pixels, "px")
    } else if share < LEAST_OVERLAP {
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
    let hint = if mask_fits {
        "the mask fits depth: is the pose right, and the mesh of this object?"
    } else {
        "wrong pose, another mesh, or a mask that is inverted or of something else?"
    };
    Some(warning(value, unit).found(finding).hint(hint))
}

/// What depth shows under the mask, and across its border, that is not the object; and whether all of this was asked and nothing
/// found. What is asked of the hand is left out unless `hand_fits`.
pub(super) fn off_object(
    view: &View<'_>,
    object: &Object,
    hand_fits: bool,
) -> (Option<Warning>, bool) {
    let masked = || view.pixels().map(|(_, p)| p).filter(|p| p.masked && p.sensor > 0.0);
    let count = masked().count() as f64;
    let Some(middle) = median(masked().map(|p| f64::from(p.sensor))) else { return (None, false) };
    let beyond = middle + 2.0 * object.radius;
    let behind = masked().filter(|p| f64::from(p.sensor) > beyond).count() as f64 / count;
    let on_hand = masked().filter(|p| p.is_on_hand(REACH) && !p.shows_object()).count() as f64;
    let on_hand = if hand_fits { on_hand / count } else { 0.0 };
    let warning = |value| Warning::new(Subject::Mask, value, "");
    if behind > MOST_BEHIND || on_hand > MOST_ON_HAND {
        let finding = format!(
            "{:.0} % of the mask's pixels are on the hand and {:.0} % on what is behind the object",
            on_hand * 1e2,
            behind * 1e2
        );
        let hint = "does it leak, is it shifted, or of the whole object (mask, not mask_visib)?";
        return (Some(warning(on_hand + behind).found(finding).hint(hint)), false);
    }
    let cut = if hand_fits { cut_share(view) } else { None };
    let Some(cut) = cut.filter(|cut| *cut > MOST_CUT) else { return (None, cut.is_some()) };
    let percent = cut * 1e2;
    let finding =
        format!("along {percent:.0} % of the mask's border the same surface goes on outside of it");
    (Some(warning(cut).found(finding).hint("is the mask shifted, or too small?")), false)
}
