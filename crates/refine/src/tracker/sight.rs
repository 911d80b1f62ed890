//! A frame as the tracker looks at it.

use std::ops::Range;
use std::sync::Arc;

use prehend_render::{DepthImage, Mask};

use super::segmentation::Segmentation;
use crate::scene::{Hand, Observation, hand_depth};

/// A frame with its hand, and what shows the object in it as far as that is known.
pub(super) struct Sight {
    /// With the mask that shows the object, as far as that is known.
    pub(super) observation: Observation,
    /// The mask that came with it.
    pub(super) given: Mask,
    /// Whether that is of something, and not of everything.
    pub(super) tells: bool,
    /// Depth image of the hand \[m\], 0 where it is not.
    pub(super) hand_depth: Arc<DepthImage>,
    /// Columns and rows in which the object is, where that is known.
    pub(super) focus: Option<[Range<usize>; 2]>,
}

impl Sight {
    /// Of a hand whose joints were checked.
    pub(super) fn new(observation: Observation, hand: Option<&Arc<Hand>>) -> Self {
        let hand = hand.map(|hand| &**hand).zip(observation.hand.as_ref());
        let hand_depth = Arc::new(hand_depth(&observation.camera, hand));
        let given = observation.mask.clone();
        let tells = (1..given.pixels().len()).contains(&given.count());
        Self { given, tells, observation, hand_depth, focus: None }
    }

    /// Takes what shows the object for its mask.
    pub(super) fn show(&mut self, Segmentation { mask, around }: Segmentation) {
        (self.observation.mask, self.focus) = (mask, Some(around));
    }
}
