//! Checks of inputs before any refinement, each with a figure and a likely cause: [`Warning`]s of single frames by limits of units, frames and sensors
//! (`limits.rs` has them all), and mistakes by name, by trying over many frames which [`Correction`] makes the inputs agree with what is seen.
//!
//! One cause should make one warning: what a hand, a mesh or depth is needed for is not judged if that is at fault itself.

mod correction;
mod depth;
mod hand;
mod limits;
mod mask;
mod model;
#[cfg(test)]
mod tests;
mod touch;
mod warning;

use nalgebra::{Isometry3, Translation3};
use prehend_render::DepthImage;

pub use self::correction::{
    Correction, CorrectionSettings, CorrectionTrial, FieldNames, Finding, find_corrections,
};
pub(crate) use self::model::{check as check_object, likely_unit};
pub use self::warning::{Subject, Warning};
use crate::scene::{Frame, HandMeasurement, Object, View};

use self::correction::settled_pose;

/// Warnings of an observation, and of the object at a pose (object → camera) in it; none if all looks well. Those of the object alone are
/// [`check_object`]'s.
pub(crate) fn check_frame(
    observation: &Frame,
    object: &Object,
    t_cam_object: &Isometry3<f64>,
) -> Vec<Warning> {
    if let Err((image, problem)) = observation.check_sizes() {
        let subject = if image == "mask" { Subject::Mask } else { Subject::Depth };
        return vec![Warning::new(subject, (0.0, ""), format!("the {image} has {problem}"), "")];
    }
    let mut warnings = Vec::new();
    let (mut drawn, mut touch) = (None, None);
    if let Some(measured) = &observation.hand {
        let (of_hand, image) = hand::check(measured, &observation.camera);
        let (of_forces, readable) = touch::check(measured);
        warnings.extend(of_hand.into_iter().chain(of_forces));
        (drawn, touch) = (image, readable.then_some(measured));
    }
    let z = (t_cam_object * object.center).z;
    if z.is_nan() || z <= 0.0 {
        let finding = format!("the object is behind the camera (z = {z:.3} m)");
        let hint = "does the pose map the object into the camera frame, z forward?";
        warnings.push(Warning::new(Subject::Pose, (z, "m"), finding, hint));
        return warnings;
    }
    if !model::is_plausible(object) {
        return warnings;
    }
    let compare = |pose: &Isometry3<f64>, is_settled: bool| {
        compare(observation, object, (drawn.as_ref(), touch), pose, is_settled)
    };
    let found = compare(t_cam_object, false);
    let of_pose = |w: &Warning| matches!(w.subject, Subject::Pose | Subject::Mask);
    // Poses to start from are off: what is left at the pose that mask and depth have is not the pose's.
    let settled = found
        .iter()
        .any(of_pose)
        .then(|| settled_pose(observation, object, t_cam_object, &CorrectionSettings::default()));
    warnings.extend(settled.flatten().map_or(found, |pose| compare(&pose, true)));
    warnings
}

/// Warnings of the images of a frame with the object at a pose, against the depth of the hand \[m\], unless that is at fault, and the hand whose forces have
/// places. A pose that `is_settled` where mask and depth have it fits.
fn compare(
    observation: &Frame,
    object: &Object,
    (drawn, touch): (Option<&DepthImage>, Option<&HandMeasurement>),
    t_cam_object: &Isometry3<f64>,
    is_settled: bool,
) -> Vec<Warning> {
    let z = (t_cam_object * object.center).z;
    let view = View::new(observation, &observation.camera, object, drawn.cloned(), t_cam_object);
    let mut warnings = depth::check(&view, object);
    let blamed = |subject| warnings.iter().any(|warning| warning.subject == subject);
    let hand_fits = drawn.is_some() && warnings.is_empty();
    let hand_wrong = observation.hand.is_some() && drawn.is_none() || blamed(Subject::Hand);
    let (off_object, mask_fits) = match blamed(Subject::Depth) {
        true => (None, false),
        false => mask::off_object(&view, object, hand_fits),
    };
    let at_pose = if is_settled { None } else { mask::at_pose(&view, z, mask_fits, hand_wrong) };
    let pose_fits = at_pose.is_none();
    warnings.extend(at_pose.into_iter().chain(off_object));
    if let Some(measured) = touch.filter(|_| hand_fits && pose_fits) {
        let seen = Translation3::from(view.toward_seen(z).unwrap_or_default()) * t_cam_object;
        warnings.extend(touch::check_places(measured, object, &seen));
    }
    warnings
}
