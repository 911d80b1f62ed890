//! Images of a frame, made small, with the object in units of the model.

use std::borrow::Cow;
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector2};
use prehend_render::{DepthImage, RgbImage, depth_map, render_scene};

use super::inputs::CheckInputs;
use super::settings::CorrectionSettings;
use crate::check::hand::broken;
use crate::check::limits::{HAND_PIXELS, HAND_REACH};
use crate::error::RefineError;
use crate::scene::{Frame, Object, hand_depth, median};

/// Extents that render without trouble, in units of length.
const RENDERED: std::ops::Range<f64> = 1e-2..1e2;

/// A frame's images and its object.
pub(super) struct FrameImages<'a> {
    pub(super) settings: &'a CorrectionSettings,
    /// The object with a radius that renders: its unit of length is [`CheckInputs::meters`] of [`given`](Self::given).
    pub(super) object: Arc<Object>,
    /// The inputs as they are.
    pub(super) given: CheckInputs,
    /// The frame with smaller images.
    pub(super) frame: Frame,
    /// Depth of the hand \[m\], if it can be drawn.
    hand: Option<DepthImage>,
    pub(super) has_depth: bool,
    /// Column, row and depth \[m\] of some pixels with depth, of the mask, and of all others.
    points: [Vec<(Vector2<f64>, f64)>; 2],
}

impl<'a> FrameImages<'a> {
    /// # Errors
    /// If images have not the camera's size, or a model that has to be made larger cannot be used.
    pub(super) fn new(
        observation: &Frame,
        object: &Arc<Object>,
        t_cam_object: &Isometry3<f64>,
        settings: &'a CorrectionSettings,
    ) -> Result<Self, RefineError> {
        observation.require_sizes()?;
        let factor = observation.camera.width.div_ceil(settings.width.max(1)).max(1);
        let camera = observation.camera.scaled((factor as f64).recip());
        let mut frame = Frame::new(camera)
            .color(observation.color.downsampled(factor))
            .depth(observation.depth.downsampled(factor))
            .mask(observation.mask.downsampled(factor));
        frame.hand = observation.hand.clone().filter(|measured| broken(measured).is_none());
        let mut given = CheckInputs::new(camera, *t_cam_object);
        let mut object = Arc::clone(object);
        let extent = 2.0 * object.radius;
        if !RENDERED.contains(&extent) {
            // Nothing but lengths changes: what is measured stays what it is.
            let factor = 10_f64.powf(-(extent / settings.extent).log10().round());
            let inertial = Some(object.inertial.clone());
            let mesh = object.mesh.clone().scaled(factor);
            object = Arc::new(Object::new(&object.name, mesh, inertial, object.seed)?);
            given.t_cam_object.translation.vector *= factor;
            given.depth_scale *= factor;
            given.meters /= factor;
        }
        let points = [true, false].map(|masked| points(&frame, masked, settings.points));
        let has_depth = !points[0].is_empty() || !points[1].is_empty();
        let hand = frame.hand.as_ref().map(|hand| hand_depth(&camera, Some(hand)));
        Ok(Self { settings, object, given, frame, hand, has_depth, points })
    }

    /// True of a pixel that the mask, as `inputs` have it, covers.
    pub(super) fn is_masked(&self, inputs: &CheckInputs, index: usize) -> bool {
        self.frame.mask.pixels()[index] != inputs.mask_inverted
    }

    /// Column and row, and depth as `inputs` have it, of some masked pixels.
    pub(super) fn masked_points(
        &self,
        inputs: &CheckInputs,
    ) -> impl Iterator<Item = (Vector2<f64>, f64)> {
        let scale = inputs.depth_scale;
        let points = &self.points[usize::from(inputs.mask_inverted)];
        points.iter().map(move |(pixel, depth)| (*pixel, depth * scale))
    }

    /// Depth that `inputs` have at a pixel, 0 for none.
    pub(super) fn sensor(&self, inputs: &CheckInputs, index: usize) -> f64 {
        f64::from(self.frame.depth.pixels()[index]) * inputs.depth_scale
    }

    /// Depth of the object as `inputs` have it, 0 where it is not.
    pub(super) fn drawn(&self, inputs: &CheckInputs) -> DepthImage {
        depth_map(&inputs.camera, &[(&self.object.model, inputs.t_cam_object)])
    }

    /// Depth of the hand \[m\] before the camera of `inputs`, where the hand is known.
    pub(super) fn hand_drawn(&self, inputs: &CheckInputs) -> Option<Cow<'_, DepthImage>> {
        match inputs.camera == self.given.camera {
            true => self.hand.as_ref().map(Cow::Borrowed),
            false => {
                let hand = self.frame.hand.as_ref()?;
                Some(Cow::Owned(hand_depth(&inputs.camera, Some(hand))))
            }
        }
    }

    /// Factor that makes depth under the mask that of the object.
    pub(super) fn depth_ratio(&self) -> Option<f64> {
        let given = &self.given;
        let drawn = self.drawn(given);
        let object = median(drawn.pixels().iter().filter(|z| **z > 0.0).map(|z| f64::from(*z)))?;
        Some(object / median(self.masked_points(given).map(|(_, depth)| depth))?)
    }

    /// The point that poses turn about, in the camera frame.
    pub(super) fn center(&self, inputs: &CheckInputs) -> Point3<f64> {
        inputs.t_cam_object * self.object.center
    }

    /// Difference from the object's depth beyond which depth is of something else, in units of the object's length.
    pub(super) fn tolerance(&self) -> f64 {
        self.settings.elsewhere * self.object.radius
    }

    /// Mean of intersection over union of mask and visible object, of the part of the mask whose depth is the object's, and of the part
    /// of the hand whose depth is the hand's, of those that are known: 0 to 1.
    pub(super) fn agreement(&self, inputs: &CheckInputs, hand: Option<&DepthImage>) -> f64 {
        let tolerance = self.tolerance();
        let drawn = self.drawn(inputs);
        let (mut both, mut either, mut known, mut near) = (0.0, 0.0, 0.0, 0.0);
        // What is in front, of which nothing else may be known, hides pixels of the object.
        let of_hidden = if self.has_depth { 1.0 } else { self.settings.hidden };
        for (index, object) in drawn.pixels().iter().enumerate() {
            let (object, sensor) = (f64::from(*object), self.sensor(inputs, index));
            let masked = self.is_masked(inputs, index);
            let hand = hand.map_or(0.0, |hand| f64::from(hand.pixels()[index]));
            let before = |depth: f64| depth > 0.0 && depth < object - tolerance;
            let hidden = !masked && before(sensor) || before(hand / inputs.meters);
            let visible = object > 0.0 && !hidden;
            both += f64::from(u8::from(masked && visible));
            either += if masked { 1.0 } else { of_hidden * f64::from(u8::from(visible)) };
            if sensor > 0.0 && masked {
                known += 1.0;
                near += f64::from(u8::from(object > 0.0 && (sensor - object).abs() < tolerance));
            }
        }
        let shares = [
            Some(both / f64::max(either, 1.0)),
            self.has_depth.then(|| near / f64::max(known, 1.0)),
            hand.and_then(|hand| self.hand_share(inputs, hand)),
        ];
        let shares: Vec<f64> = shares.into_iter().flatten().collect();
        shares.iter().sum::<f64>() / shares.len() as f64
    }

    /// Agreement of the image's colors with the model's, 0 to 1; where red and blue are swapped, what it lacks to one. None of a pale model.
    /// Brightness has no part in it, and a pose that is a little off hardly any: distributions are compared, of (red − blue) / (red + green + blue).
    pub(super) fn color_agreement(&self, inputs: &CheckInputs) -> Option<f64> {
        let model = (&*self.object.model, inputs.t_cam_object);
        let drawn = render_scene(&inputs.camera, &[model], 1, |_, p| p.albedo, |_, _| [0.0; 3]);
        let chromas = |image: &RgbImage| {
            let shown = (0..drawn.object.len())
                .filter(|&i| drawn.object[i].is_some() && self.is_masked(inputs, i));
            let chroma = |[red, green, blue]: [f32; 3]| {
                f64::from(red - blue) / (f64::from(red + green + blue) + self.settings.dark)
            };
            let mut chromas: Vec<f64> = shown.map(|i| chroma(image.pixels()[i])).collect();
            chromas.sort_by(f64::total_cmp);
            chromas
        };
        let (model, image) = (chromas(&drawn.color), chromas(&self.frame.color));
        let [pale, tint] = self.settings.tint.map(|chroma| model.len() as f64 * chroma.powi(2));
        let alike: f64 = model.iter().zip(&image).map(|(a, b)| (a - b).powi(2)).sum();
        let swapped = model.iter().zip(image.iter().rev());
        let swapped: f64 = swapped.map(|(a, b)| (a + b).powi(2)).sum();
        let is_pale = model.iter().map(|chroma| chroma.powi(2)).sum::<f64>() <= pale;
        (!is_pale).then(|| 0.5 + 0.5 * (swapped - alike) / (swapped + alike + tint))
    }

    /// Part of the hand, beside the mask, whose depth is the hand's; none where too little of it is seen.
    pub(super) fn hand_share(&self, inputs: &CheckInputs, hand: &DepthImage) -> Option<f64> {
        let (mut count, mut near) = (0, 0);
        for (index, hand) in hand.pixels().iter().enumerate() {
            let sensor = self.sensor(inputs, index) * inputs.meters;
            if *hand > 0.0 && sensor > 0.0 && !self.is_masked(inputs, index) {
                count += 1;
                near += usize::from((sensor - f64::from(*hand)).abs() < HAND_REACH);
            }
        }
        (count >= HAND_PIXELS).then(|| near as f64 / count as f64)
    }
}

/// Some `limit` pixels with depth that are `masked`, or are not, on a regular grid.
fn points(frame: &Frame, masked: bool, limit: usize) -> Vec<(Vector2<f64>, f64)> {
    let Frame { mask, depth, .. } = frame;
    let width = mask.width().max(1);
    let there = |i: &usize| mask.pixels()[*i] == masked && depth.pixels()[*i] > 0.0;
    let all: Vec<usize> = (0..mask.pixels().len()).filter(there).collect();
    // An odd stride does not follow the columns.
    let stride = (all.len() / limit.max(1)).max(1) | 1;
    let point = |&i: &usize| (place(i, width), f64::from(depth.pixels()[i]));
    all.iter().step_by(stride).map(point).collect()
}

/// Column and row of a pixel \[px\].
fn place(index: usize, width: usize) -> Vector2<f64> {
    Vector2::new((index % width) as f64, (index / width) as f64)
}

/// Mean column and row of `pixels`, by index, of an image of that width; none of none.
pub(super) fn centroid(width: usize, pixels: impl Iterator<Item = usize>) -> Option<Vector2<f64>> {
    let (mut sum, mut count) = (Vector2::zeros(), 0.0);
    pixels.for_each(|index| {
        sum += place(index, width);
        count += 1.0;
    });
    (count > 0.0).then(|| sum / count)
}
