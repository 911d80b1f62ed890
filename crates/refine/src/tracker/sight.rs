//! A frame as the tracker looks at it.

use std::mem;
use std::ops::Range;
use std::sync::Arc;

use nalgebra::Vector2;
use prehend_render::{DepthImage, Mask};

use crate::scene::{Frame, RegionEvidence, draw_hand_depth};

/// A frame with its hand, and what shows the object in it as far as that is known.
pub(super) struct Sight {
    /// With the mask that shows the object, as far as that is known.
    pub(super) frame: Frame,
    /// The mask that came with it.
    pub(super) given: Mask,
    /// True if that tells which pixels show the object: it is neither empty nor a box.
    pub(super) tells: bool,
    /// Depth image of the hand \[m\], 0 where it is not.
    pub(super) hand_depth: Arc<DepthImage>,
    /// The measured depth, as terms share it \[m\].
    pub(super) depth: Arc<DepthImage>,
    /// True where any depth is measured.
    pub(super) measured: bool,
    /// Regions of the image, where no depth is measured.
    pub(super) regions: Option<Arc<RegionEvidence>>,
    /// Columns and rows in which the object is, where that is known.
    pub(super) focus: Option<[Range<usize>; 2]>,
}

/// The images of a sight that is over, whose memory serves the next one.
#[derive(Default)]
pub(super) struct Images {
    mask: Mask,
    hand_depth: Arc<DepthImage>,
    depth: Arc<DepthImage>,
}

impl Sight {
    /// Sight of a frame, the joints of whose hand were checked.
    pub(super) fn new(mut observation: Frame, images: Images) -> Self {
        let Images { mask, mut hand_depth, mut depth } = images;
        let hand = observation.hand.as_ref();
        draw_hand_depth(own(&mut hand_depth), &observation.camera, hand);
        own(&mut depth).copy_from(&observation.depth);
        let tells = observation.is_segmented();
        let given = mem::replace(&mut observation.mask, mask);
        let measured = observation.has_depth();
        Self {
            given,
            tells,
            frame: observation,
            hand_depth,
            depth,
            measured,
            regions: None,
            focus: None,
        }
    }

    /// Columns and rows within `extent` \[px\] of a place, in squares of `unit` pixels, as far as they are in the image.
    pub(super) fn part(&self, place: &Vector2<f64>, extent: f64, unit: usize) -> [Range<usize>; 2] {
        let range = |middle: f64, size: usize| {
            let end = |at: f64| at.clamp(0.0, size as f64) as usize / unit;
            end(middle - extent)..end(middle + extent)
        };
        let camera = &self.frame.camera;
        [range(place.x, camera.width), range(place.y, camera.height)]
    }

    /// Its images, whose memory serves the next one.
    pub(super) fn into_images(self) -> Images {
        let Self { frame: observation, hand_depth, depth, .. } = self;
        Images { mask: observation.mask, hand_depth, depth }
    }
}

/// The image, or a new one if somebody still has the old one.
fn own(image: &mut Arc<DepthImage>) -> &mut DepthImage {
    if Arc::get_mut(image).is_none() {
        *image = Arc::default();
    }
    Arc::make_mut(image)
}
