//! The part of a picture in which the object may be, with what is expected there.

use std::f32::consts::PI;
use std::ops::Range;

use nalgebra::{Isometry3, Vector3};
use prehend_render::{Camera, DepthImage, draw_depth};

use super::SegmentationSettings;
use crate::scene::{BoxSums, Object, color_index, squares};
use crate::tracker::sight::Sight;

/// Certain label of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Label {
    Object,
    Other,
}

/// One pixel of a window.
#[derive(Clone, Copy, Debug)]
pub(super) struct WindowPixel {
    /// Column and row in the picture.
    pub(super) at: [u32; 2],
    /// The share of its neighbors that should show the object.
    pub(super) share: f32,
    pub(super) color: u16,
    pub(super) masked: bool,
    /// Depth of the object, carried on beyond its outline, of the hand, and as measured \[m\]; 0 where there is none.
    object: f32,
    hand: f32,
    sensor: f32,
}

/// Part of a picture at every so many pixels. It can look at many pictures, one after the other, in the same memory.
#[derive(Clone, Debug, Default)]
pub(super) struct SegmentationWindow {
    pixels: Vec<WindowPixel>,
    range: [Range<usize>; 2],
    /// Camera of the whole picture.
    camera: Option<Camera>,
    /// The object where it should be.
    drawn: DepthImage,
    /// Numbers of pixels, and sums of such.
    values: Vec<f32>,
    shown: BoxSums,
    near: BoxSums,
    count: BoxSums,
    settings: SegmentationSettings,
}

impl SegmentationWindow {
    /// Looks about an object at `t_cam_object`, and `reach` \[m\] to all sides; none if that is out of the picture.
    pub(super) fn look(
        &mut self,
        sight: &Sight,
        object: &Object,
        t_cam_object: &Isometry3<f64>,
        reach: f64,
        settings: &SegmentationSettings,
    ) -> Option<()> {
        self.settings = *settings;
        let (stride, band) = (settings.stride(), settings.band);
        let full = &sight.frame.camera;
        let center = t_cam_object * object.center;
        if center.z <= 0.0 {
            return None;
        }
        // The whole picture, if it is as near as that.
        let nearest = (center.z - object.radius).max(f64::MIN_POSITIVE);
        let at = full.project(&center)?;
        let extent = (object.radius + reach) * full.fx.max(full.fy) / nearest;
        let [across, down] = sight.part(&at, extent, stride);
        let (left, columns, top, rows) = (across.start, across.len(), down.start, down.len());
        if columns == 0 || rows == 0 {
            return None;
        }
        let coarse = full.scaled(1.0 / stride as f64);
        let camera: Camera = coarse.cropped(left, top, columns, rows);
        draw_depth(&mut self.drawn, &camera, &[(&object.model, *t_cam_object)]);
        let picture = |column: usize, row: usize| [(left + column) * stride, (top + row) * stride];
        self.pixels.clear();
        for (row, line) in self.drawn.pixels().chunks(columns).enumerate() {
            self.pixels.extend(line.iter().enumerate().map(|(column, &own)| {
                let pixel = WindowPixel::sensed(sight, picture(column, row));
                let hidden = pixel.hand > 0.0 && pixel.hand < own;
                let share = if own > 0.0 && !hidden { 1.0 } else { 0.0 };
                WindowPixel { share, object: own, ..pixel }
            }));
        }
        if self.pixels.iter().all(|pixel| pixel.share == 0.0) {
            return None;
        }
        let size = (columns, rows);
        let Self { pixels, values, .. } = self;
        values.clear();
        values.extend(pixels.iter().map(|pixel| pixel.share));
        self.shown.find(values, size, band);
        self.near.find(self.drawn.pixels(), size, 4 * band);
        let drawn = |z: &f32| f32::from(u8::from(*z > 0.0));
        values.clear();
        values.extend(self.drawn.pixels().iter().map(drawn));
        self.count.find(values, size, 4 * band);
        let (shown, near, count) = (&self.shown.all, &self.near.all, &self.count.all);
        let middle = center.z as f32;
        for (i, pixel) in pixels.iter_mut().enumerate() {
            let across = squares(i % columns, columns, band);
            pixel.share = shown[i] / (across * squares(i / columns, rows, band)) as f32;
            if pixel.object == 0.0 {
                pixel.object = if count[i] > 0.0 { near[i] / count[i] } else { middle };
            }
        }
        // Of a thin object no square is full: its middle is as sure as can be.
        let most = self.pixels.iter().map(|pixel| pixel.share).fold(0.0, f32::max);
        self.pixels.iter_mut().for_each(|pixel| pixel.share /= most);
        let ends = picture(columns, rows);
        self.range = [left * stride..ends[0], top * stride..ends[1]];
        Some(())
    }

    /// Window of a whole picture, in which nothing is known of the object but, where no depth is measured, its `depth` \[m\].
    pub(super) fn whole(sight: &Sight, depth: f32, settings: &SegmentationSettings) -> Self {
        let (full, stride) = (&sight.frame.camera, settings.stride());
        let (columns, rows) = (full.width.div_ceil(stride), full.height.div_ceil(stride));
        let pixel = |k: usize| WindowPixel {
            object: depth,
            ..WindowPixel::sensed(sight, [k % columns * stride, k / columns * stride])
        };
        let range = [0..full.width, 0..full.height];
        let pixels = (0..columns * rows).map(pixel).collect();
        Self { pixels, range, camera: Some(*full), settings: *settings, ..Self::default() }
    }

    /// Point that is visible at a pixel of a whole picture, camera frame \[m\].
    pub(super) fn place(&self, pixel: &WindowPixel) -> Vector3<f32> {
        let [x, y] = pixel.at.map(f64::from);
        let place = self.camera.map(|camera| camera.unproject(x, y, f64::from(pixel.sensor)));
        place.map_or_else(Vector3::zeros, |place| place.coords.cast())
    }

    /// Centroid of the visible points of the hand, camera frame \[m\]; none without one.
    pub(super) fn hand_center(&self) -> Option<Vector3<f32>> {
        let on_hand = self.pixels.iter().filter(|pixel| pixel.is_on_hand(&self.settings));
        let (sum, count) = on_hand.fold((Vector3::zeros(), 0.0), |(sum, count), pixel| {
            (sum + self.place(pixel), count + 1.0)
        });
        (count > 0.0).then(|| sum / count)
    }

    /// Its columns and rows in the picture.
    pub(super) fn range(&self) -> [Range<usize>; 2] {
        self.range.clone()
    }

    /// Silhouette of the whole object, for each pixel of the picture within its range.
    pub(super) fn silhouette(&self) -> Vec<bool> {
        let (stride, [columns, rows]) = (self.settings.stride(), self.range());
        let width = columns.len() / stride;
        let drawn = |x: usize, y: usize| self.drawn.pixels()[y / stride * width + x / stride] > 0.0;
        (0..rows.len()).flat_map(|y| (0..columns.len()).map(move |x| drawn(x, y))).collect()
    }

    pub(super) fn pixels(&self) -> impl Iterator<Item = &WindowPixel> + Clone {
        self.pixels.iter()
    }
}

impl WindowPixel {
    /// Measured pixel at a column and row, without an expectation.
    fn sensed(sight: &Sight, at: [usize; 2]) -> Self {
        let Sight { frame: observation, given, hand_depth, .. } = sight;
        let index = at[1] * observation.camera.width + at[0];
        Self {
            at: at.map(|k| k as u32),
            share: 0.0,
            color: color_index(&observation.color.pixels()[index]),
            masked: given.pixels()[index],
            object: 0.0,
            hand: hand_depth.pixels()[index],
            sensor: observation.depth.pixels()[index],
        }
    }

    /// Whether this pixel is left out whatever its color and masks: beyond the object's outline, and far from it in depth.
    pub(super) fn is_elsewhere(&self, settings: &SegmentationSettings) -> bool {
        let off = (self.sensor - self.object).abs();
        self.share == 0.0 && self.sensor > 0.0 && off > settings.off_object()
    }

    /// The area of what is seen here, and of what should show the object, in squares of depth.
    pub(super) fn seen_area(&self) -> f32 {
        let depth = if self.sensor > 0.0 { self.sensor } else { self.object };
        depth * depth
    }

    /// See [`seen_area`](Self::seen_area).
    pub(super) fn expected_area(&self) -> f32 {
        self.share * self.object * self.object
    }

    /// Whether the object should be seen here \[nat\].
    pub(super) fn prior(&self, settings: &SegmentationSettings) -> f32 {
        let prior = settings.prior as f32;
        let sure = (1.0 - prior) + (2.0 * prior - 1.0) * self.share;
        (sure / (1.0 - sure)).ln()
    }

    /// Whether depth is rather the object's than that of the hand or of something else \[nat\].
    pub(super) fn depth_evidence(&self, settings: &SegmentationSettings) -> f32 {
        if !(self.sensor > 0.0 && self.sensor.is_finite()) {
            return 0.0;
        }
        let [sigma, background, outliers] =
            [settings.depth_sigma, settings.background, settings.outliers].map(|v| v as f32);
        let bell = |off: f32| (-0.5 * (off / sigma).powi(2)).exp() / ((2.0 * PI).sqrt() * sigma);
        let own = bell(self.sensor - self.object);
        let outliers = if self.sensor < self.object { 0.0 } else { outliers };
        let own = (1.0 - outliers) * own + outliers * background;
        let other = match self.hand > 0.0 {
            true => 0.5 * (bell(self.sensor - self.hand) + background),
            false => background,
        };
        (own / other).ln()
    }

    /// Whether depth is the hand's.
    fn is_on_hand(&self, settings: &SegmentationSettings) -> bool {
        let reach = 2.0 * settings.depth_sigma as f32;
        self.hand > 0.0 && self.sensor > 0.0 && (self.sensor - self.hand).abs() < reach
    }

    /// Log-evidence that the point at `place` is held by a hand about `center` (both in the camera frame \[m\]), at most 0 \[nat\].
    pub(super) fn near_hand(
        &self,
        center: Option<Vector3<f32>>,
        place: &Vector3<f32>,
        settings: &SegmentationSettings,
    ) -> f32 {
        let hidden = self.sensor == 0.0 && self.hand > 0.0 && self.hand < self.object;
        let Some(center) = center.filter(|_| !hidden) else {
            return if hidden { -2.0 * settings.color_limit as f32 } else { 0.0 };
        };
        let is_held = (place - center).norm() < settings.held as f32;
        match self.sensor > 0.0 && !self.is_on_hand(settings) && is_held {
            true => 0.0,
            false => -2.0 * settings.color_limit as f32,
        }
    }

    /// True where the object should be seen.
    pub(super) fn is_expected(&self) -> bool {
        self.share > 0.5
    }

    /// Its label in a frame without depth: within the object it is that or not `by_color`.
    pub(super) fn label_by(&self, by_color: bool) -> Option<Label> {
        match self.share >= 1.0 {
            true if by_color => Some(Label::Object),
            true => Some(Label::Other),
            false => (self.share == 0.0).then_some(Label::Other),
        }
    }

    /// Certain label, if it has one.
    pub(super) fn label(&self, settings: &SegmentationSettings) -> Option<Label> {
        let off = (self.sensor - self.object).abs();
        let measured = self.sensor > 0.0;
        if self.share >= 1.0 && measured && off < settings.depth_sigma as f32 {
            return Some(Label::Object);
        }
        let elsewhere = self.share == 0.0 || measured && off > settings.off_object();
        elsewhere.then_some(Label::Other)
    }
}
