//! Which of an image's masks is that of an object.

use nalgebra::Isometry3;
use prehend_render::{DepthImage, Mask, depth_map};

use super::bop::Frame;
use super::targets::Target;
use crate::scene::Object;

/// A mask whose overlap with the object is below this share of another mask's is not the object's.
const LEAST_SHARE: f64 = 0.5;

/// Number of the mask of `target` in `frame`, an `object` about at `t_cam_object` \[m\]: that of [`Frame::mask_number`], unless another mask of the image
/// has more than twice its intersection over union with the object, which is warned of.
pub(super) fn mask_at(
    frame: &Frame<'_>,
    target: &Target,
    object: &Object,
    t_cam_object: &Isometry3<f64>,
) -> usize {
    let number = frame.mask_number(target.obj_id, target.instance);
    let numbers = frame.mask_numbers();
    if numbers.len() < 2 {
        return number;
    }
    let mut drawn: Option<DepthImage> = None;
    let mut overlap = |number: usize| {
        let mask = frame.mask(number).ok()?;
        let depth = drawn.get_or_insert_with(|| {
            let camera = frame.camera(mask.width(), mask.height());
            depth_map(&camera, &[(&object.model, *t_cam_object)])
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

/// Intersection over union of a mask and of where there is `depth`.
fn intersection_over_union(mask: &Mask, depth: &[f32]) -> f64 {
    let (mut both, mut either) = (0_u32, 0_u32);
    for (set, depth) in mask.pixels().iter().zip(depth) {
        both += u32::from(*set && *depth > 0.0);
        either += u32::from(*set || *depth > 0.0);
    }
    f64::from(both) / f64::from(either.max(1))
}
