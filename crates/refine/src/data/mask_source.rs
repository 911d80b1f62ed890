//! Where the masks of a dataset's frames come from.

use std::sync::Arc;

use nalgebra::Isometry3;
use prehend_render::{DepthImage, Mask, depth_map};

use super::bop::{Body, BodyKind, DatasetError, DatasetImage, Detections};
use crate::scene::Target;
use crate::scene::{Frame, Object};

/// A mask whose overlap with the object is below this share of another mask's is not the object's.
const LEAST_SHARE: f64 = 0.5;
/// Distance within which two bodies of one model are one \[radii\].
const SAME_PLACE: f64 = 0.2;

/// Source of the masks of a dataset's frames. Where there is no mask, or one that is a box, pixels are told by pose, depth and colors
/// ([`Estimator::input`](crate::Estimator::input)).
#[derive(Clone, Debug, Default)]
pub enum MaskSource {
    /// `mask_visib/`; where another mask of the image overlaps the object at its pose far better, that one, with a warning.
    #[default]
    Files,
    /// Masks, or else boxes, that a detector found: of those of the object the one that overlaps it most at its pose, or without a pose the most
    /// confident one.
    Detections(Arc<Detections>),
    /// Boxes of the detections.
    Boxes(Arc<Detections>),
    /// The object at its pose.
    Silhouettes,
    /// No masks: the pose tells as much as a box around it.
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
    /// Number of an object's mask among the files of the image `frame`, if masks come from these.
    pub(super) fn number(&self, frame: &DatasetImage<'_>, sought: &Sought<'_>) -> Option<usize> {
        matches!(self, Self::Files).then(|| sought.number(frame))
    }

    /// Gives `observation`, which is of the image `frame`, the mask of an object, which has this `number` if it is one of the files.
    ///
    /// # Errors
    /// If there is no such mask, or it is broken or of another size than the image.
    pub(super) fn segment(
        &self,
        observation: &mut Frame,
        frame: &DatasetImage<'_>,
        sought: &Sought<'_>,
        number: Option<usize>,
    ) -> Result<(), DatasetError> {
        let (mask, is_box) = match self {
            Self::Files => return frame.segment(observation, number.unwrap_or_default()),
            Self::Detections(detections) => sought.detected(detections, observation)?,
            Self::Boxes(detections) => (sought.detected(detections, observation)?.0, true),
            Self::Silhouettes => {
                if let Some(silhouette) = sought.silhouette(observation) {
                    observation.mask = silhouette;
                }
                return Ok(());
            }
            Self::None => return Ok(()),
        };
        // Behind a lens a box is none any more.
        let mask = frame.undistorted_mask(mask)?;
        observation.mask = if is_box { boxed(&mask) } else { mask };
        Ok(())
    }
}

impl Sought<'_> {
    /// Takes the object itself from the `bodies` of its image: of those of its model the nearest to its pose, within its radius, and what is listed there again.
    /// Without a pose all of its model are taken. An object does not hide itself.
    pub(super) fn take_from(&self, bodies: &mut Vec<Body>) {
        let kind = BodyKind::Object { obj_id: self.target.obj_id };
        let Some(pose) = self.t_cam_object else { return bodies.retain(|body| body.kind != kind) };
        let center = self.object.center;
        let distance =
            |from: &Isometry3<f64>, body: &Body| (from * center - body.t_cam_base * center).norm();
        let same = bodies.iter().filter(|body| body.kind == kind);
        let nearest = same.min_by(|a, b| distance(pose, a).total_cmp(&distance(pose, b)));
        let itself = nearest.filter(|body| distance(pose, body) < self.object.radius);
        if let Some(itself) = itself.map(|body| body.t_cam_base) {
            let same_place = SAME_PLACE * self.object.radius;
            bodies.retain(|body| body.kind != kind || distance(&itself, body) > same_place);
        }
    }

    /// Number of the mask among the files: that of [`DatasetImage::mask_number`], unless another mask of the image has more than twice its intersection over union
    /// with the object, which is warned of.
    fn number(&self, frame: &DatasetImage<'_>) -> usize {
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
    fn drawn(&self, observation: &Frame) -> Option<DepthImage> {
        let pose = self.t_cam_object?;
        Some(depth_map(&observation.camera, &[(&self.object.model, *pose)]))
    }

    /// Pixels that should show the object, were there nothing else.
    fn silhouette(&self, observation: &Frame) -> Option<Mask> {
        let depth = self.drawn(observation)?;
        let set = depth.pixels().iter().map(|z| *z > 0.0).collect();
        Mask::new(depth.width(), depth.height(), set).ok()
    }

    /// The mask, or the box as one, of the detection of the object, and whether that is a box.
    fn detected(
        &self,
        detections: &Detections,
        observation: &Frame,
    ) -> Result<(Mask, bool), DatasetError> {
        let Target { scene_id, im_id, obj_id, .. } = *self.target;
        let file = detections.file();
        let (width, height) = (observation.camera.width, observation.camera.height);
        let all = detections.of((scene_id, im_id, obj_id))?;
        let drawn = if all.len() > 1 { self.drawn(observation) } else { None };
        let mut best: Option<(f64, Mask, bool)> = None;
        // The most confident one first: it is taken unless another overlaps more.
        for found in all {
            if let Some(warning) = detections.corners(found, width, height) {
                log::warn!("{}: {}: {warning}", file.display(), self.target);
            }
            let mask = found.mask(width, height).map_err(|[rows, columns]| {
                let problem = format!(
                    "{}: the mask is {columns}x{rows} pixels, the image {width}x{height}",
                    self.target
                );
                DatasetError::unusable(file, problem)
            })?;
            let overlap =
                drawn.as_ref().map_or(0.0, |d| intersection_over_union(&mask, d.pixels()));
            if best.as_ref().is_none_or(|(most, ..)| overlap > *most) {
                best = Some((overlap, mask, found.is_box()));
            }
        }
        let (_, mask, is_box) = best.ok_or_else(|| {
            let place = format!("scene {scene_id} image {im_id}");
            let problem = format!("{place}: no detection of object {obj_id} (category_id)");
            DatasetError::no_mask(file, problem)
        })?;
        Ok((mask, is_box))
    }
}

/// The bounding box of a mask.
fn boxed(mask: &Mask) -> Mask {
    Mask::of_box(mask.width(), mask.height(), mask.bounds().unwrap_or_default())
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
