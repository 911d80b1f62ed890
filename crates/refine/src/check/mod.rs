//! Checks of inputs before any refinement, each with a figure and a likely cause: [`Warning`]s of single frames by limits of units, frames and sensors
//! (`limits.rs` has them all), and mistakes by name, by trying over many frames which correction ([`find_corrections`]) makes the inputs agree with what is seen.
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

use std::sync::Arc;

use nalgebra::{Isometry3, Translation3};
use prehend_render::{Camera, DepthImage};

pub use self::correction::{
    CorrectionSettings, CorrectionTrial, FieldNames, Finding, find_corrections,
};
pub(crate) use self::model::{check as check_object, likely_unit};
pub(crate) use self::warning::Subject;
pub use self::warning::Warning;
use crate::scene::{Frame, HandMeasurement, IntrinsicsMistake, Object, Pixel, View};
use crate::strategy::FitSettings;

use self::correction::settled_pose;
use self::warning::Warnings;

/// Warnings of an observation, and of the object at a pose (object → camera) in it; none if all looks well. Those of the object alone are
/// [`check_object`]'s.
pub(crate) fn check_frame(
    observation: &Frame,
    object: &Arc<Object>,
    t_cam_object: &Isometry3<f64>,
) -> Vec<Warning> {
    let mut found = Warnings::default();
    let z = (t_cam_object * object.center).z;
    if let Err((image, problem)) = observation.check_sizes() {
        let subject = if image == "mask" { Subject::Mask } else { Subject::Depth };
        found.add(subject, format!("the {image} has {problem}"));
        return found.0;
    }
    let Camera { cx, cy, width, height, .. } = observation.camera;
    if let Some(mistake) = FitSettings::default().likely_mistake(&observation.camera) {
        let question = match mistake {
            IntrinsicsMistake::Swapped => "are they swapped, or of the image before it was turned?",
            IntrinsicsMistake::OfOtherSize(_) => "are intrinsics those of images of another size?",
        };
        let message = format!(
            "the camera has cx {cx}, cy {cy} in images of {width}x{height} pixels: {question}"
        );
        found.add(Subject::Camera, message);
    }
    let hand = observation.hand.as_ref();
    let drawn = hand.and_then(|hand| hand::check(hand, &observation.camera, &mut found));
    let touch = hand.filter(|hand| touch::check(hand, &mut found));
    if z.is_nan() || z <= 0.0 {
        let message = format!(
            "the object is behind the camera (z = {z:.3} m): does the pose map the object into the camera frame, z forward?"
        );
        found.add(Subject::Pose, message);
    } else if model::is_plausible(object) {
        let images = CheckedImages { observation, object, drawn, touch };
        found.0.extend(images.check(t_cam_object).0);
    }
    found.0
}

/// Images of a frame, to be compared with the object at poses.
struct CheckedImages<'a> {
    observation: &'a Frame,
    object: &'a Arc<Object>,
    /// Depth of the hand \[m\], unless that is at fault.
    drawn: Option<DepthImage>,
    /// The hand whose forces have places.
    touch: Option<&'a HandMeasurement>,
}

impl CheckedImages<'_> {
    fn check(&self, t_cam_object: &Isometry3<f64>) -> Warnings {
        let Self { observation, object, .. } = *self;
        if !observation.is_segmented() {
            return self.check_without_mask(t_cam_object);
        }
        let found = self.compare(&self.view(t_cam_object), t_cam_object, false);
        if !found.blame(Subject::Pose) && !found.blame(Subject::Mask) {
            return found;
        }
        // Poses to start from are off: what is left at the pose that mask and depth have is not the pose's.
        let settings = CorrectionSettings::default();
        let settled = settled_pose(observation, object, t_cam_object, &settings);
        settled.map_or(found, |pose| self.compare(&self.view(&pose), &pose, true))
    }

    /// Warnings of a frame without a mask, or with a box: pixels that should show the object at its pose count as masked, unless the box is elsewhere.
    fn check_without_mask(&self, t_cam_object: &Isometry3<f64>) -> Warnings {
        let view = self.view(t_cam_object);
        let is_elsewhere = self.observation.mask.count() > 0
            && !view.pixels().any(|(_, pixel)| pixel.masked && pixel.shows_object());
        if is_elsewhere {
            return self.compare(&view, t_cam_object, false);
        }
        let mask = view.mask(Pixel::shows_object);
        if mask.count() == 0 {
            let mut found = Warnings::default();
            let message = "no pixel should show the object at this pose: wrong pose, or cam_K?";
            found.add(Subject::Pose, message);
            return found;
        }
        let observation = &Frame { mask, ..self.observation.clone() };
        let (camera, drawn) = (&observation.camera, self.drawn.clone());
        let view = View::new(observation, camera, self.object, drawn, t_cam_object);
        let mut found = Warnings::default();
        depth::check(&view, self.object, &mut found);
        found
    }

    fn view(&self, t_cam_object: &Isometry3<f64>) -> View<'_> {
        let Self { observation, object, drawn, .. } = self;
        View::new(observation, &observation.camera, object, drawn.clone(), t_cam_object)
    }

    /// Warnings of what `view` shows of the object at a pose. One that `is_settled` where mask and depth have it fits.
    fn compare(
        &self,
        view: &View<'_>,
        t_cam_object: &Isometry3<f64>,
        is_settled: bool,
    ) -> Warnings {
        let Self { observation, object, drawn, touch } = self;
        let z = (t_cam_object * object.center).z;
        let mut found = Warnings::default();
        depth::check(view, object, &mut found);
        let hand_fits = drawn.is_some() && found.0.is_empty();
        let hand_wrong =
            observation.hand.is_some() && drawn.is_none() || found.blame(Subject::Hand);
        let mut under = Warnings::default();
        let mask_fits =
            !found.blame(Subject::Depth) && mask::off_object(view, object, hand_fits, &mut under);
        let at_pose = mask::at_pose(view, z, mask_fits, hand_wrong).filter(|_| !is_settled);
        let pose_fits = at_pose.is_none();
        found.0.extend(at_pose.into_iter().chain(under.0));
        if let Some(measured) = touch.filter(|_| hand_fits && pose_fits) {
            let seen = Translation3::from(view.toward_seen(z).unwrap_or_default()) * t_cam_object;
            touch::check_places(measured, object, &seen, &mut found);
        }
        found
    }
}
