//! What looks wrong with an input before any refinement: units, frames and sensors, each with a figure and a hint.
//!
//! Poses to start from are off by centimeters, so what depends on the pose is judged with tolerance. What does not, such as
//! depth on the hand, is held to a centimeter. One cause should make one warning: what a hand, a mesh or depth is needed
//! for is not judged if that is at fault itself.

mod border;
mod depth;
mod forces;
mod hand;
mod mask;
mod model;
#[cfg(test)]
mod tests;
mod touch;
mod warning;

use nalgebra::{Isometry3, Translation3};
use prehend_render::DepthImage;

pub(crate) use self::model::likely_unit;
pub use self::warning::{Subject, Warning};
use super::correction::{CorrectionSettings, settled_pose};
use super::view::View;
use super::{Hand, HandMeasurement, Object, Observation};

/// What looks wrong with an object's model; empty if all looks well. What was assumed of its mass and its inside matters if it is `held`.
pub(crate) fn inspect_object(object: &Object, held: bool) -> Vec<Warning> {
    model::inspect(object, held)
}

/// What looks wrong with an observation, and with the object at a pose (object → camera) in it; empty if all looks well.
/// What is wrong with the object alone is [`inspect_object`]'s.
pub(crate) fn inspect_pose(
    observation: &Observation,
    object: &Object,
    hand: Option<&Hand>,
    t_cam_object: &Isometry3<f64>,
) -> Vec<Warning> {
    if let Err((image, problem)) = observation.check_sizes() {
        let finding = format!("the {image} has {problem}");
        let subject = if image == "mask" { Subject::Mask } else { Subject::Depth };
        return vec![Warning::new(subject, 0.0, "").found(finding)];
    }
    let mut warnings = Vec::new();
    let hand = hand.zip(observation.hand.as_ref());
    let (mut drawn, mut touch) = (None, None);
    if let Some((hand, measured)) = hand {
        let (of_hand, image) = hand::inspect(hand, measured, &observation.camera);
        let (of_forces, readable) = forces::inspect(hand, measured);
        warnings.extend(of_hand);
        warnings.extend(of_forces);
        (drawn, touch) = (image, readable.then_some((hand, measured)));
    }
    let z = (t_cam_object * object.center).z;
    if z.is_nan() || z <= 0.0 {
        warnings.push(
            Warning::new(Subject::Pose, z, "m")
                .found(format!("the object is behind the camera (z = {z:.3} m)"))
                .hint("does the pose map the object into the camera frame, z forward?"),
        );
        return warnings;
    }
    if !model::is_plausible(object) {
        return warnings;
    }
    let compared = |t_cam_object: &Isometry3<f64>, is_settled: bool| {
        compare(observation, object, hand, drawn.clone(), touch, t_cam_object, is_settled)
    };
    let found = compared(t_cam_object, false);
    let of_pose = |w: &Warning| matches!(w.subject, Subject::Pose | Subject::Mask);
    // Poses to start from are off: what is left at the pose that mask and depth have is not the pose's.
    let settled = found.iter().any(of_pose).then(|| {
        let hand = hand.map(|(hand, _)| hand);
        settled_pose(observation, object, hand, t_cam_object, &CorrectionSettings::default())
    });
    let settled = settled.flatten().map(|pose| compared(&pose, true));
    warnings.extend(settled.unwrap_or(found));
    warnings
}

/// What looks wrong where the object at a pose and the hand, as it is `drawn`, are compared with what is seen; a pose that `is_settled` there fits.
fn compare(
    observation: &Observation,
    object: &Object,
    hand: Option<(&Hand, &HandMeasurement)>,
    drawn: Option<DepthImage>,
    touch: Option<(&Hand, &HandMeasurement)>,
    t_cam_object: &Isometry3<f64>,
    is_settled: bool,
) -> Vec<Warning> {
    let z = (t_cam_object * object.center).z;
    let hand_drawn = drawn.is_some();
    let view = View::new(observation, &observation.camera, object, drawn, t_cam_object);
    let of_depth = depth::inspect(&view, object);
    let blamed = |subject| of_depth.iter().any(|warning| warning.subject == subject);
    let hand_fits = hand_drawn && of_depth.is_empty();
    let hand_wrong = hand.is_some() && !hand_drawn || blamed(Subject::Hand);
    let depth_wrong = blamed(Subject::Depth);
    let (off_object, mask_fits) =
        if depth_wrong { (None, false) } else { mask::off_object(&view, object, hand_fits) };
    let at_pose = if is_settled { None } else { mask::at_pose(&view, z, mask_fits, hand_wrong) };
    let pose_fits = at_pose.is_none();
    let mut warnings = of_depth;
    warnings.extend(at_pose);
    warnings.extend(off_object);
    if let Some((hand, measured)) = touch.filter(|_| hand_fits && pose_fits) {
        let seen = Translation3::from(view.toward_seen(z).unwrap_or_default()) * t_cam_object;
        warnings.extend(touch::inspect(hand, measured, object, &seen));
    }
    warnings
}
