//! Where the masks of a dataset's frames come from.

use std::fmt::Display;
use std::sync::Arc;

use nalgebra::Isometry3;
use prehend_render::{DepthImage, Mask, depth_map};

use super::bop::{Body, BodyKind, DatasetError, Detections, Frame};
use super::targets::Target;
use crate::scene::{Object, Observation};

/// A mask whose overlap with the object is below this share of another mask's is not the object's.
const LEAST_SHARE: f64 = 0.5;

/// Source of the masks of a dataset's frames. Where there is no mask, or one that is a box, pixels are told by pose, depth and colors
/// ([`FrameInput::prepared`](super::FrameInput::prepared)).
#[derive(Clone, Debug, Default)]
pub enum MaskSource {
    /// `mask_visib/`; where another mask of the image overlaps the object at its pose far better, that one, with a warning.
    #[default]
    Files,
    /// Masks, or else boxes, that a detector found: of those of the object the one that overlaps it most at its pose, or without a pose the most
    /// confident one.
    Detections(Arc<Detections>),
    /// Boxes of the detections; without any, no masks: the pose tells as much as a box around it.
    Boxes(Option<Arc<Detections>>),
    /// The object at its pose.
    Silhouettes,
    /// No masks.
    None,
}

/// An object in an image whose mask is asked for.
pub(super) struct Sought<'a> {
    pub(super) target: &'a Target,
    pub(super) object: &'a Object,
    /// About where it is \[m\], if that is known.
    pub(super) t_cam_object: Option<&'a Isometry3<f64>>,
}

impl MaskSource {
    /// Gives `observation`, which is of the image `frame`, the mask of an object; returns its number if it is one of the files.
    ///
    /// # Errors
    /// If there is no such mask, or it is broken or of another size than the image.
    pub(super) fn segment(
        &self,
        observation: &mut Observation,
        frame: &Frame<'_>,
        sought: &Sought<'_>,
    ) -> Result<Option<usize>, DatasetError> {
        let mask = match self {
            Self::Files => {
                let number = sought.number(frame);
                return frame.segment(observation, number).map(|()| Some(number));
            }
            Self::Detections(detections) => sought.detected(detections, observation)?,
            Self::Boxes(Some(detections)) => {
                boxed(&sought.detected(detections, observation)?, observation)
            }
            Self::Silhouettes => match sought.silhouette(observation) {
                Some(silhouette) => silhouette,
                None => return Ok(None),
            },
            Self::Boxes(None) | Self::None => return Ok(None),
        };
        let is_drawn = matches!(self, Self::Silhouettes);
        observation.mask = if is_drawn { mask } else { frame.undistorted_mask(mask)? };
        Ok(None)
    }
}

impl Sought<'_> {
    /// True of the object itself among the bodies of its image: of the same model, and where it is as far as that is known. An object does not hide itself.
    pub(super) fn is_it(&self, body: &Body) -> bool {
        let is_same = body.kind == BodyKind::Object { obj_id: self.target.obj_id };
        let center = self.object.center;
        let is_there = |pose: &Isometry3<f64>| {
            (pose * center - body.t_cam_base * center).norm() < self.object.radius
        };
        is_same && self.t_cam_object.is_none_or(is_there)
    }

    /// Number of the mask among the files: that of [`Frame::mask_number`], unless another mask of the image has more than twice its intersection over union
    /// with the object, which is warned of.
    fn number(&self, frame: &Frame<'_>) -> usize {
        let Self { target, object, t_cam_object } = self;
        let number = frame.mask_number(target.obj_id, target.instance);
        let Some(t_cam_object) = t_cam_object else { return number };
        let numbers = frame.mask_numbers();
        if numbers.len() < 2 {
            return number;
        }
        let mut drawn: Option<DepthImage> = None;
        let mut overlap = |number: usize| {
            let mask = frame.mask(number).ok()?;
            let depth = drawn.get_or_insert_with(|| {
                let camera = frame.camera(mask.width(), mask.height());
                depth_map(&camera, &[(&object.model, **t_cam_object)])
            });
            Some(intersection_over_union(&mask, depth.pixels()))
        };
        let of_number = overlap(number).unwrap_or_default();
        // No overlap is more than one: the others need not be read then.
        if of_number >= LEAST_SHARE {
            return number;
        }
        let others = numbers.into_iter().filter(|other| *other != number);
        let overlaps = others.filter_map(|other| Some((other, overlap(other)?)));
        let Some((best, most)) = overlaps.max_by(|a, b| a.1.total_cmp(&b.1)) else { return number };
        if of_number >= LEAST_SHARE * most {
            return number;
        }
        log::warn!(
            "{target}: mask {number} overlaps its pose by {of_number:.2} and mask {best} by {most:.2}, which is used"
        );
        best
    }

    /// Depth of the object alone at its pose \[m\].
    fn drawn(&self, observation: &Observation) -> Option<DepthImage> {
        let pose = self.t_cam_object?;
        Some(depth_map(&observation.camera, &[(&self.object.model, *pose)]))
    }

    /// Pixels that should show the object, were there nothing else.
    fn silhouette(&self, observation: &Observation) -> Option<Mask> {
        let depth = self.drawn(observation)?;
        let set = depth.pixels().iter().map(|z| *z > 0.0).collect();
        Mask::new(depth.width(), depth.height(), set).ok()
    }

    /// The mask, or the box as one, of the detection of the object.
    fn detected(
        &self,
        detections: &Detections,
        observation: &Observation,
    ) -> Result<Mask, DatasetError> {
        let Target { scene_id, im_id, obj_id, .. } = *self.target;
        let fault = |problem: &dyn Display| {
            DatasetError::unusable(detections.file(), format!("{}: {problem}", self.target))
        };
        let (width, height) = (observation.camera.width, observation.camera.height);
        let found = detections.of(scene_id, im_id, obj_id);
        let all: Vec<Mask> = found.iter().filter_map(|found| found.mask(width, height)).collect();
        if all.is_empty() {
            return Err(match found.is_empty() {
                true => fault(&"no detection of this object (category_id) in this image"),
                false => {
                    fault(&format!("the mask is not of the image's {width} x {height} pixels"))
                }
            });
        }
        // The most confident one first.
        let best = match self.drawn(observation).filter(|_| all.len() > 1) {
            None => 0,
            Some(drawn) => {
                let overlap = |k: usize| intersection_over_union(&all[k], drawn.pixels());
                let overlaps: Vec<f64> = (0..all.len()).map(overlap).collect();
                (1..all.len())
                    .fold(0, |best, k| if overlaps[k] > overlaps[best] { k } else { best })
            }
        };
        all.into_iter().nth(best).ok_or_else(|| fault(&"no detection"))
    }
}

/// The bounding box of a mask.
fn boxed(mask: &Mask, observation: &Observation) -> Mask {
    let (width, height) = (observation.camera.width, observation.camera.height);
    Mask::of_box(width, height, mask.bounds().unwrap_or_default())
}

/// Intersection over union of a mask and of where there is `depth`.
fn intersection_over_union(mask: &Mask, depth: &[f32]) -> f64 {
    let (mut both, mut either) = (0_u32, 0_u32);
    for (set, depth) in mask.pixels().iter().zip(depth) {
        both += u32::from(*set && *depth > 0.0);
        either += u32::from(*set || *depth > 0.0);
    }
    f64::from(both) / f64::from(either.max(1))
}
