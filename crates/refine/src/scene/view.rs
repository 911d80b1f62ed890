//! The object at a pose and the hand, drawn beside what was sensed.

use nalgebra::{Isometry3, Vector3};
use prehend_render::{Camera, DepthImage, Mask, depth_map};

use super::prepared_frame::hand_depth;
use super::{Frame, Object};
use crate::error::RefineError;

/// Expected and measured pixels of a frame, for an object at a pose.
pub(crate) struct View<'a> {
    pub(crate) frame: &'a Frame,
    /// Depth of the whole object at the pose \[m\], 0 where it is not.
    object: DepthImage,
    /// Depth of the hand \[m\], 0 where it is not or not known.
    hand: DepthImage,
    /// Pixels that object, hand or mask cover, row by row.
    covered: Vec<usize>,
}

/// Depth that differs by so much from the object's is of something else \[m\].
const ELSEWHERE: f64 = 15e-3;

/// One pixel of it. Depths are in meters, 0 for none.
#[derive(Clone, Copy)]
pub(crate) struct Pixel {
    pub(crate) object: f32,
    pub(crate) hand: f32,
    pub(crate) sensor: f32,
    pub(crate) masked: bool,
}

impl<'a> View<'a> {
    /// With the object at `t_cam_object` before `camera`, that of the observation or a better one of its size, and the depth image of
    /// the hand \[m\] where it is known. All images must have the camera's size.
    pub(crate) fn new(
        observation: &'a Frame,
        camera: &Camera,
        object: &Object,
        hand: Option<DepthImage>,
        t_cam_object: &Isometry3<f64>,
    ) -> Self {
        let hand = hand.unwrap_or_else(|| hand_depth(camera, None));
        let object = depth_map(camera, &[(&object.model, *t_cam_object)]);
        let mut view = Self { frame: observation, object, hand, covered: Vec::new() };
        let covers = |p: Pixel| p.object > 0.0 || p.hand > 0.0 || p.masked;
        let (width, height) = view.size();
        view.covered = (0..width * height).filter(|&i| covers(view.pixel(i))).collect();
        view
    }

    /// With the object at `t_cam_object` before the camera, and the hand where it is measured.
    ///
    /// # Errors
    /// If an image has not the camera's size, or there is not one joint position a joint.
    pub(crate) fn of_observation(
        observation: &'a Frame,
        object: &Object,
        t_cam_object: &Isometry3<f64>,
    ) -> Result<Self, RefineError> {
        observation.require_sizes()?;
        let camera = &observation.camera;
        let hand = observation.hand.as_ref().map(|measured| {
            measured.hand.check_joints(&measured.joints)?;
            Ok::<_, RefineError>(hand_depth(camera, Some(measured)))
        });
        Ok(Self::new(observation, camera, object, hand.transpose()?, t_cam_object))
    }

    /// Where the object should be seen, and nothing else was measured.
    pub(crate) fn likely_mask(&self) -> Mask {
        self.mask(|pixel| pixel.shows_object() && !pixel.is_off_object(ELSEWHERE))
    }

    /// Mask of those of [`pixels`](Self::pixels) of which `is_set`.
    pub(crate) fn mask(&self, is_set: impl Fn(&Pixel) -> bool) -> Mask {
        let (width, height) = self.size();
        let mut mask = Mask::filled(width, height, false);
        for ([x, y], pixel) in self.pixels() {
            mask.pixels_mut()[y * width + x] = is_set(&pixel);
        }
        mask
    }

    /// Width and height \[px\].
    pub(crate) fn size(&self) -> (usize, usize) {
        (self.hand.width(), self.hand.height())
    }

    /// All pixels that object, hand or mask cover, row by row, each with its column and row.
    pub(crate) fn pixels(&self) -> impl Iterator<Item = ([usize; 2], Pixel)> {
        let width = self.size().0;
        self.covered.iter().map(move |&i| ([i % width, i / width], self.pixel(i)))
    }

    /// Those of [`pixels`](Self::pixels) that are at least `margin` \[px\] from the image's border, each with its index, row by row.
    pub(crate) fn inner_pixels(&self, margin: usize) -> impl Iterator<Item = (usize, Pixel)> {
        let (width, height) = self.size();
        let inside = move |at: usize, size: usize| at >= margin && at + margin < size;
        let pixels =
            self.pixels().filter(move |([x, y], _)| inside(*x, width) && inside(*y, height));
        pixels.map(move |([x, y], pixel)| (y * width + x, pixel))
    }

    /// The pixel of that index, row by row.
    #[inline]
    pub(crate) fn pixel(&self, index: usize) -> Pixel {
        Pixel {
            object: self.object.pixels()[index],
            hand: self.hand.pixels()[index],
            sensor: self.frame.depth.pixels()[index],
            masked: self.frame.mask.pixels()[index],
        }
    }

    /// Sums over the pixels of the mask, and over those that should show the object: column, row and number.
    pub(crate) fn sums(&self) -> [Vector3<f64>; 2] {
        let (mut mask, mut model) = (Vector3::zeros(), Vector3::zeros());
        for ([x, y], pixel) in self.pixels() {
            let at = Vector3::new(x as f64, y as f64, 1.0);
            mask += at * f64::from(u8::from(pixel.masked));
            model += at * f64::from(u8::from(pixel.shows_object()));
        }
        [mask, model]
    }

    /// Translation of the object, its center at depth `z` \[m\], to the mask and its depth (camera frame) \[m\]. `None` without depth where mask and
    /// object overlap.
    pub(crate) fn toward_seen(&self, z: f64) -> Option<Vector3<f64>> {
        let [mask, model] = self.sums();
        let forward = median(self.depths_on_object().map(|(sensor, object)| sensor - object))?;
        let camera = &self.frame.camera;
        let place = |sum: Vector3<f64>, z| camera.unproject(sum.x / sum.z, sum.y / sum.z, z);
        Some(place(mask, z + forward) - place(model, z))
    }

    /// Sensor's and object's depth \[m\] where the mask shows the object.
    pub(crate) fn depths_on_object(&self) -> impl Iterator<Item = (f64, f64)> {
        self.pixels()
            .filter(|(_, p)| p.shows_object() && p.masked && p.sensor > 0.0)
            .map(|(_, p)| (f64::from(p.sensor), f64::from(p.object)))
    }
}

impl Pixel {
    /// Whether the object should be seen there, with nothing of the hand before it.
    pub(crate) fn shows_object(&self) -> bool {
        self.object > 0.0 && (self.hand == 0.0 || self.object < self.hand)
    }

    /// Whether depth was measured, but not within `reach` \[m\] of the object's.
    fn is_off_object(&self, reach: f64) -> bool {
        self.sensor > 0.0 && f64::from((self.sensor - self.object).abs()) > reach
    }

    /// Whether depth is within `reach` \[m\] of the hand's.
    pub(crate) fn is_on_hand(&self, reach: f64) -> bool {
        self.hand > 0.0 && self.sensor > 0.0 && f64::from((self.sensor - self.hand).abs()) < reach
    }
}

/// The middle one of `values`; none of none.
pub(crate) fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    let middle = values.len() / 2;
    (middle < values.len()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}
