//! Expected and measured values of each pixel.

use prehend_render::depth_map;

use crate::problem::State;
use crate::scene::{CameraCalibrationError, Pixel, PreparedFrame, View, eroded};

/// The object and the hand of a state in the image of a frame, with what is wrong with the camera corrected.
pub(crate) struct FusedPixels<'a> {
    view: View<'a>,
    camera_error: CameraCalibrationError,
    /// Pixels beside an edge that do not count, nor outlines beside the hand, onto which masks leak \[px\].
    margin: usize,
}

impl<'a> FusedPixels<'a> {
    pub(crate) fn new(frame: &PreparedFrame<'a>, state: &State, margin: usize) -> Self {
        let observation = frame.observation();
        let camera = state.camera.corrected(&observation.camera);
        let hand = frame.hand().map(|measured| {
            depth_map(&camera, &measured.hand.render_bodies(&state.t_cam_hand, &state.joints))
        });
        let (object, pose) = (frame.object(), &state.t_cam_object);
        let view = View::new(observation, &camera, object, hand, pose);
        Self { view, camera_error: state.camera, margin }
    }

    /// Whether each pixel, row by row, is so; those that neither object nor hand nor mask cover are as `others`.
    fn marked(&self, others: bool, is_so: impl Fn(usize, Pixel) -> bool) -> Vec<bool> {
        let (width, height) = self.view.size();
        let mut marked = vec![others; width * height];
        for ([x, y], pixel) in self.view.pixels() {
            let i = y * width + x;
            marked[i] = is_so(i, pixel);
        }
        marked
    }

    /// How far behind the object's surface the measured one is \[m\], with the column and row, where the mask agrees that it is the object and
    /// not near its edges; wherever the object should be seen, if that is fewer than `fewest` pixels.
    pub(crate) fn on_object(&self, fewest: usize) -> Vec<([usize; 2], f64)> {
        let agreed = self.residuals(|p| p.object, |p| p.shows_object() && p.masked);
        if agreed.len() >= fewest {
            return agreed;
        }
        self.residuals(|p| p.object, |p| p.shows_object())
    }

    /// Offsets of measured depth behind the hand's surface \[m\], with column and row, outside the mask.
    pub(crate) fn on_hand(&self) -> Vec<([usize; 2], f64)> {
        self.residuals(|p| p.hand, |p| p.hand > 0.0 && !p.shows_object() && !p.masked)
    }

    /// Whether each pixel, row by row, is away from the hand.
    fn away_from_hand(&self) -> Vec<bool> {
        eroded(self.view.size().0, &self.marked(true, |_, p| p.hand == 0.0), self.margin)
    }

    /// How far the outlines of mask and object are apart, away from the hand \[px\]: the area between them by the length of the object's.
    /// `None` without an outline there.
    pub(crate) fn outline_distance(&self) -> Option<f64> {
        let (width, height) = self.view.size();
        let away = self.away_from_hand();
        let seen = self.marked(false, |_, p| p.shows_object());
        let is_edge = |i: usize| {
            let (x, y) = (i % width, i / width);
            let inner = x > 0 && y > 0 && x + 1 < width && y + 1 < height;
            inner && [i - 1, i + 1, i - width, i + width].iter().any(|near| !seen[*near])
        };
        let (mut length, mut between) = (0, 0);
        for ([x, y], pixel) in self.view.pixels() {
            let i = y * width + x;
            length += usize::from(away[i] && seen[i] && is_edge(i));
            between += usize::from(away[i] && seen[i] != pixel.masked);
        }
        (length > 0).then(|| between as f64 / length as f64)
    }

    /// How far behind the surface of which a pixel has the depth the measured one is \[m\], with the column and row, where and around where
    /// it `is_there`.
    fn residuals(
        &self,
        depth: impl Fn(Pixel) -> f32,
        is_there: impl Fn(Pixel) -> bool,
    ) -> Vec<([usize; 2], f64)> {
        let width = self.view.size().0;
        let inside = eroded(width, &self.marked(false, |_, p| is_there(p)), self.margin);
        let CameraCalibrationError { depth_scale, depth_bias, .. } = self.camera_error;
        let residual = |(place, pixel): ([usize; 2], Pixel)| {
            let z = depth_scale * f64::from(pixel.sensor) + depth_bias;
            (place, z - f64::from(depth(pixel)))
        };
        let seen = self.view.pixels();
        seen.filter(|([x, y], p)| inside[y * width + x] && p.sensor > 0.0).map(residual).collect()
    }
}
