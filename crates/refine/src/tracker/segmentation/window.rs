//! The part of a picture in which the object may be, with what is expected there.

use std::f32::consts::PI;
use std::ops::Range;

use nalgebra::{Isometry3, Vector3};
use prehend_render::{Camera, DepthImage, draw_depth};

use super::{COLOR_LIMIT, STRIDE};
use crate::scene::{Object, color_index};

use crate::tracker::sight::Sight;
use crate::tracker::sums::{Sums, squares};

/// Outlines are expected within so many pixels of the window to either side.
const BAND: usize = 4;
/// Depth of the surface is carried on over so many pixels of the window beyond its outline.
const BEYOND: usize = 16;
/// How sure it is that the object is where it should be.
const SURE: f32 = 0.85;
/// Standard deviation of depth about where the object should be, and at the hand \[m\].
const DEPTH_SIGMA: f32 = 5e-3;
/// Depth that is so far from the object's surface is not of it \[m\].
const OFF_OBJECT: f32 = 15e-3;
/// Density of depths of what is not known \[1/m\], and how often depth that is not in front of the object is so, too, where the object is seen.
const ANYWHERE: f32 = 3.0;
const OUTLIERS: f32 = 0.03;

/// How far from the middle of a hand it holds something \[m\].
const HELD: f32 = 0.2;

/// What a pixel surely shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Label {
    Object,
    Other,
}

/// One pixel of a window.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pixel {
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
pub(super) struct Window {
    pixels: Vec<Pixel>,
    range: [Range<usize>; 2],
    /// Of the whole picture.
    camera: Option<Camera>,
    /// The object where it should be.
    drawn: DepthImage,
    /// Numbers of pixels, and sums of such.
    values: Vec<f32>,
    shown: Sums,
    near: Sums,
    count: Sums,
}

impl Window {
    /// Looks about an object at `t_cam_object`, and `reach` \[m\] to all sides; none if that is out of the picture.
    pub(super) fn look(
        &mut self,
        sight: &Sight,
        object: &Object,
        t_cam_object: &Isometry3<f64>,
        reach: f64,
    ) -> Option<()> {
        let full = &sight.observation.camera;
        let center = t_cam_object * object.center;
        if center.z <= 0.0 {
            return None;
        }
        // The whole picture, if it is as near as that.
        let nearest = (center.z - object.radius).max(f64::MIN_POSITIVE);
        let at = full.project(&center)?;
        let extent = (object.radius + reach) * full.fx.max(full.fy) / nearest;
        let [across, down] = sight.part(&at, extent, STRIDE);
        let (left, columns, top, rows) = (across.start, across.len(), down.start, down.len());
        if columns == 0 || rows == 0 {
            return None;
        }
        let coarse = full.scaled(1.0 / STRIDE as f64);
        let camera: Camera = coarse.cropped(left, top, columns, rows);
        draw_depth(&mut self.drawn, &camera, &[(&object.model, *t_cam_object)]);
        let picture = |column: usize, row: usize| [(left + column) * STRIDE, (top + row) * STRIDE];
        self.pixels.clear();
        for (row, line) in self.drawn.pixels().chunks(columns).enumerate() {
            self.pixels.extend(line.iter().enumerate().map(|(column, &own)| {
                let pixel = Pixel::sensed(sight, picture(column, row));
                let hidden = pixel.hand > 0.0 && pixel.hand < own;
                let share = if own > 0.0 && !hidden { 1.0 } else { 0.0 };
                Pixel { share, object: own, ..pixel }
            }));
        }
        if self.pixels.iter().all(|pixel| pixel.share == 0.0) {
            return None;
        }
        let size = (columns, rows);
        let Self { pixels, values, .. } = self;
        values.clear();
        values.extend(pixels.iter().map(|pixel| pixel.share));
        self.shown.find(values, size, BAND);
        self.near.find(self.drawn.pixels(), size, BEYOND);
        let drawn = |z: &f32| f32::from(u8::from(*z > 0.0));
        values.clear();
        values.extend(self.drawn.pixels().iter().map(drawn));
        self.count.find(values, size, BEYOND);
        let (shown, near, count) = (&self.shown.all, &self.near.all, &self.count.all);
        let middle = center.z as f32;
        for (i, pixel) in pixels.iter_mut().enumerate() {
            let across = squares(i % columns, columns, BAND);
            pixel.share = shown[i] / (across * squares(i / columns, rows, BAND)) as f32;
            if pixel.object == 0.0 {
                pixel.object = if count[i] > 0.0 { near[i] / count[i] } else { middle };
            }
        }
        let ends = picture(columns, rows);
        self.range = [left * STRIDE..ends[0], top * STRIDE..ends[1]];
        Some(())
    }

    /// Of a whole picture, in which nothing is known of the object.
    pub(super) fn whole(sight: &Sight) -> Self {
        let full = &sight.observation.camera;
        let (columns, rows) = (full.width.div_ceil(STRIDE), full.height.div_ceil(STRIDE));
        let pixel = |k: usize| Pixel::sensed(sight, [k % columns * STRIDE, k / columns * STRIDE]);
        let range = [0..full.width, 0..full.height];
        let pixels = (0..columns * rows).map(pixel).collect();
        Self { pixels, range, camera: Some(*full), ..Self::default() }
    }

    /// Where what is seen at a pixel of a whole picture is, camera frame \[m\].
    pub(super) fn place(&self, pixel: &Pixel) -> Vector3<f32> {
        let [x, y] = pixel.at.map(f64::from);
        let place = self.camera.map(|camera| camera.unproject(x, y, f64::from(pixel.sensor)));
        place.map_or_else(Vector3::zeros, |place| place.coords.cast())
    }

    /// The middle of what of the hand is seen, camera frame \[m\]; none without one.
    pub(super) fn hand_center(&self) -> Option<Vector3<f32>> {
        let on_hand = self.pixels.iter().filter(|pixel| pixel.is_on_hand());
        let (sum, count) = on_hand.fold((Vector3::zeros(), 0.0), |(sum, count), pixel| {
            (sum + self.place(pixel), count + 1.0)
        });
        (count > 0.0).then(|| sum / count)
    }

    /// Its columns and rows in the picture.
    pub(super) fn range(&self) -> [Range<usize>; 2] {
        self.range.clone()
    }

    pub(super) fn pixels(&self) -> impl Iterator<Item = &Pixel> + Clone {
        self.pixels.iter()
    }
}

impl Pixel {
    /// What was sensed at a column and row, of which nothing is expected.
    fn sensed(sight: &Sight, at: [usize; 2]) -> Self {
        let Sight { observation, given, hand_depth, .. } = sight;
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
    pub(super) fn is_elsewhere(&self) -> bool {
        let off = (self.sensor - self.object).abs();
        self.share == 0.0 && self.sensor > 0.0 && off > OFF_OBJECT
    }

    /// The area of what is seen here, and of what should show the object, in squares of depth.
    pub(super) fn seen_area(&self) -> f32 {
        self.sensor * self.sensor
    }

    /// See [`seen_area`](Self::seen_area).
    pub(super) fn expected_area(&self) -> f32 {
        self.share * self.object * self.object
    }

    /// Whether the object should be seen here \[nat\].
    pub(super) fn prior(&self) -> f32 {
        let sure = (1.0 - SURE) + (2.0 * SURE - 1.0) * self.share;
        (sure / (1.0 - sure)).ln()
    }

    /// Whether depth is rather the object's than that of the hand or of something else \[nat\].
    pub(super) fn depth_evidence(&self) -> f32 {
        if !(self.sensor > 0.0 && self.sensor.is_finite()) {
            return 0.0;
        }
        let bell = |off: f32| {
            (-0.5 * (off / DEPTH_SIGMA).powi(2)).exp() / ((2.0 * PI).sqrt() * DEPTH_SIGMA)
        };
        let own = bell(self.sensor - self.object);
        let outliers = if self.sensor < self.object { 0.0 } else { OUTLIERS };
        let own = (1.0 - outliers) * own + outliers * ANYWHERE;
        let other = match self.hand > 0.0 {
            true => 0.5 * (bell(self.sensor - self.hand) + ANYWHERE),
            false => ANYWHERE,
        };
        (own / other).ln()
    }

    /// Whether depth is the hand's.
    fn is_on_hand(&self) -> bool {
        self.hand > 0.0 && self.sensor > 0.0 && (self.sensor - self.hand).abs() < 2.0 * DEPTH_SIGMA
    }

    /// Whether what is seen here, at `place`, may be held by a hand about that place \[nat\].
    pub(super) fn near_hand(&self, center: Option<Vector3<f32>>, place: &Vector3<f32>) -> f32 {
        let Some(center) = center else { return 0.0 };
        match self.sensor > 0.0 && !self.is_on_hand() && (place - center).norm() < HELD {
            true => 0.0,
            false => -2.0 * COLOR_LIMIT,
        }
    }

    /// What it surely shows, where that is known.
    pub(super) fn label(&self) -> Option<Label> {
        let off = (self.sensor - self.object).abs();
        let measured = self.sensor > 0.0;
        if self.share >= 1.0 && measured && off < DEPTH_SIGMA {
            return Some(Label::Object);
        }
        let elsewhere = self.share == 0.0 || measured && off > OFF_OBJECT;
        elsewhere.then_some(Label::Other)
    }
}
