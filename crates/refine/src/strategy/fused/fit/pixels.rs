//! What should be seen in each pixel, beside what was measured there.

use prehend_render::{DepthImage, depth_map};

use crate::problem::State;
use crate::scene::{CameraCalibrationError, Frame, Observation};

/// The object and the hand of a state in the image of a frame, with what is wrong with the camera corrected.
pub(super) struct Pixels<'a> {
    observation: &'a Observation,
    camera_error: CameraCalibrationError,
    object: DepthImage,
    hand: DepthImage,
}

impl<'a> Pixels<'a> {
    pub(super) fn new(frame: &Frame<'a>, state: &State) -> Self {
        let observation = frame.observation();
        let camera = state.camera.corrected(&observation.camera);
        let object = depth_map(&camera, &[(&frame.object().model, state.t_cam_object)]);
        let hand = match frame.hand() {
            Some((hand, _)) => {
                depth_map(&camera, &hand.render_bodies(&state.t_cam_hand, &state.joints))
            }
            None => DepthImage::filled(camera.width, camera.height, 0.0),
        };
        Self { observation, camera_error: state.camera, object, hand }
    }

    fn width(&self) -> usize {
        self.object.width()
    }

    /// Whether the object is what should be seen at pixel `i`.
    fn shows_object(&self, i: usize) -> bool {
        let (object, hand) = (self.object.pixels()[i], self.hand.pixels()[i]);
        object > 0.0 && (hand == 0.0 || object < hand)
    }

    /// How far behind the object's surface the measured one is \[m\], with the column and row, where the mask agrees that it is the object and
    /// not near its edges; wherever the object should be seen, if that is fewer than `fewest` pixels.
    pub(super) fn on_object(&self, fewest: usize) -> Vec<([usize; 2], f64)> {
        let mask = self.observation.mask.pixels();
        let agreed = self.residuals(&self.object, |i| self.shows_object(i) && mask[i]);
        if agreed.len() >= fewest {
            return agreed;
        }
        self.residuals(&self.object, |i| self.shows_object(i))
    }

    /// The same of the hand's surface beside the mask.
    pub(super) fn on_hand(&self) -> Vec<([usize; 2], f64)> {
        let (mask, hand) = (self.observation.mask.pixels(), self.hand.pixels());
        self.residuals(&self.hand, |i| hand[i] > 0.0 && !self.shows_object(i) && !mask[i])
    }

    /// Shares of the object's pixels that are in the middle of a patch that the mask lacks, and of one that it has too much, both away from
    /// the hand.
    pub(super) fn mask_misfit(&self) -> [f64; 2] {
        let (mask, hand) = (self.observation.mask.pixels(), self.hand.pixels());
        let count = self.object.pixels().len();
        let away = eroded(self.width(), (0..count).map(|i| hand[i] == 0.0), HAND_MARGIN);
        let seen = (0..count).filter(|i| self.shows_object(*i)).count().max(1);
        [true, false].map(|lacking| {
            let differs =
                |i: usize| away[i] && self.shows_object(i) == lacking && mask[i] != lacking;
            let patches = eroded(self.width(), (0..count).map(differs), EDGE_MARGIN);
            patches.iter().filter(|inside| **inside).count() as f64 / seen as f64
        })
    }

    fn residuals(
        &self,
        surface: &DepthImage,
        is_there: impl Fn(usize) -> bool,
    ) -> Vec<([usize; 2], f64)> {
        let (measured, surface) = (self.observation.depth.pixels(), surface.pixels());
        let inside = eroded(self.width(), (0..surface.len()).map(is_there), EDGE_MARGIN);
        let CameraCalibrationError { depth_scale, depth_bias, .. } = self.camera_error;
        let residual = |i: usize| {
            let z = depth_scale * f64::from(measured[i]) + depth_bias;
            ([i % self.width(), i / self.width()], z - f64::from(surface[i]))
        };
        let seen = (0..surface.len()).filter(|i| inside[*i] && measured[*i] > 0.0);
        seen.map(residual).collect()
    }
}

/// Pixels beside an edge that do not count \[px\].
const EDGE_MARGIN: usize = 2;

/// Pixels beside the hand where masks are not compared \[px\]: they leak onto it.
const HAND_MARGIN: usize = 3;

/// Of an image of `width` columns the pixels whose neighbors up to `reach` columns and rows away are all set.
fn eroded(width: usize, set: impl Iterator<Item = bool>, reach: usize) -> Vec<bool> {
    let set: Vec<bool> = set.collect();
    let (mut rows, mut all) = (vec![false; set.len()], vec![false; set.len()]);
    let height = set.len() / width.max(1);
    for y in 0..height {
        let mut run = 0;
        for x in 0..width {
            run = if set[y * width + x] { run + 1 } else { 0 };
            if run > 2 * reach {
                rows[y * width + x - reach] = true;
            }
        }
    }
    let mut runs = vec![0; width];
    for y in 0..height {
        for (x, run) in runs.iter_mut().enumerate() {
            *run = if rows[y * width + x] { *run + 1 } else { 0 };
            if *run > 2 * reach {
                all[(y - reach) * width + x] = true;
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn erosion_leaves_what_is_surrounded() {
        let square = |k: usize| (2..7).contains(&(k % 10)) && (1..6).contains(&(k / 10));
        let left = eroded(10, (0..80).map(square), 2);
        let kept: Vec<usize> = (0..80).filter(|k| left[*k]).collect();
        assert_eq!(kept, [34]);
    }
}
