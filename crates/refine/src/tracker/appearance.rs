//! The object by its colors, where no depth is measured.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::Isometry3;
use prehend_render::{DepthImage, draw_depth};

use super::GAIN;
use super::sight::Sight;
use crate::scene::{ColorRatios, MaskBorder, Object, RegionColors, RegionEvidence};

/// How far around the object colors are learnt, as a share of its radius.
const AROUND: f64 = 0.5;
/// Distance from the outline within which colors are mixed \[px\].
const MIXED: f32 = 2.0;
/// Share of the pixels that should show the object of which a mask must have as many as of others to be of it.
const AGREEMENT: f32 = 0.5;

/// Colors of the object and of what is around it, learnt from frames in which its pose was believed.
#[derive(Clone, Debug, Default)]
pub(super) struct Appearance {
    colors: RegionColors,
    ratios: ColorRatios,
}

/// The object in an image, were nothing before it but the hand.
struct Silhouette {
    /// Columns and rows of the image.
    window: [Range<usize>; 2],
    /// Of the window \[m\]; 0 where it is not.
    depth: DepthImage,
}

impl Silhouette {
    /// Of `object` at a pose, with what is around it; none if that is not in the image.
    fn new(sight: &Sight, object: &Object, t_cam_object: &Isometry3<f64>) -> Option<Self> {
        let camera = &sight.observation.camera;
        let center = t_cam_object * object.center;
        if center.z <= object.radius {
            return None;
        }
        let at = camera.project(&center)?;
        let extent =
            (1.0 + AROUND) * object.radius * camera.fx.max(camera.fy) / (center.z - object.radius);
        let range = |middle: f64, size: usize| {
            let [from, to] = [middle - extent, middle + extent];
            from.max(0.0) as usize..to.clamp(0.0, size as f64) as usize
        };
        let window = [range(at.x, camera.width), range(at.y, camera.height)];
        let [columns, rows] = &window;
        if columns.is_empty() || rows.is_empty() {
            return None;
        }
        let part = camera.cropped(columns.start, rows.start, columns.len(), rows.len());
        let mut depth = DepthImage::default();
        draw_depth(&mut depth, &part, &[(&object.model, *t_cam_object)]);
        depth.pixels().iter().any(|z| *z > 0.0).then_some(Self { window, depth })
    }

    /// Index in the image of each of its pixels, and depth of the object there.
    fn pixels<'a>(&'a self, sight: &'a Sight) -> impl Iterator<Item = (usize, f32)> + 'a {
        let [columns, rows] = self.window.clone();
        let width = sight.observation.camera.width;
        let index = rows.flat_map(move |y| columns.clone().map(move |x| y * width + x));
        index.zip(self.depth.pixels().iter().copied())
    }

    /// Indices of those that should show the object.
    fn shown<'a>(&'a self, sight: &'a Sight) -> impl Iterator<Item = usize> + 'a {
        let hand = sight.hand_depth.pixels();
        let shown = move |(at, z): (usize, f32)| {
            let hidden = hand[at] > 0.0 && hand[at] < z;
            (z > 0.0 && !hidden).then_some(at)
        };
        self.pixels(sight).filter_map(shown)
    }
}

impl Appearance {
    /// Finds what of `sight` shows `object`, which should be at `t_cam_object`, and how far its pixels are the object's; false if nothing is seen of it.
    pub(super) fn look(
        &self,
        sight: &mut Sight,
        object: &Object,
        t_cam_object: &Isometry3<f64>,
    ) -> bool {
        let Some(silhouette) = Silhouette::new(sight, object, t_cam_object) else { return false };
        let color = &sight.observation.color;
        let shown: Vec<usize> = silhouette.shown(sight).collect();
        let seen: Vec<usize> = shown
            .iter()
            .copied()
            .filter(|at| self.ratios.of(&color.pixels()[*at]) >= 0.0)
            .collect();
        let [columns, rows] = silhouette.window.clone();
        let given = sight.given.pixels();
        let both = seen.iter().filter(|at| given[**at]).count() as f32;
        let agrees = sight.tells
            && both >= AGREEMENT * seen.len() as f32
            && both >= AGREEMENT * sight.given.count() as f32;
        let regions = match agrees {
            true => RegionEvidence::of_mask(Some(color), &sight.given),
            false => None,
        };
        let regions = regions.unwrap_or_else(|| {
            RegionEvidence::of_colors(color, [columns.clone(), rows.clone()], &self.ratios)
        });
        sight.regions = Some(Arc::new(regions));
        let (width, height) = (sight.observation.camera.width, sight.observation.camera.height);
        let mask = &mut sight.observation.mask;
        mask.refill(width, height, false);
        seen.iter()
            .filter(|at| !agrees || given[**at])
            .for_each(|at| mask.pixels_mut()[*at] = true);
        sight.focus = Some([columns, rows]);
        !seen.is_empty()
    }

    /// The share of the pixels which should show an object at `t_cam_object` that do so by their colors.
    pub(super) fn shown(
        &self,
        sight: &Sight,
        object: &Object,
        t_cam_object: &Isometry3<f64>,
    ) -> f64 {
        let Some(silhouette) = Silhouette::new(sight, object, t_cam_object) else { return 0.0 };
        let color = sight.observation.color.pixels();
        let (mut seen, mut expected) = (0.0, 0.0);
        for at in silhouette.shown(sight) {
            let told = self.ratios.of(&color[at]);
            expected += 1.0;
            seen += if told > 0.0 { 1.0 } else { 0.0 };
        }
        if expected > 0.0 { seen / expected } else { 0.0 }
    }

    /// Learns colors from a frame with the object at `t_cam_object`.
    pub(super) fn learn(&mut self, sight: &Sight, object: &Object, t_cam_object: &Isometry3<f64>) {
        let Some(silhouette) = Silhouette::new(sight, object, t_cam_object) else { return };
        let set: Vec<bool> = silhouette.depth.pixels().iter().map(|z| *z > 0.0).collect();
        let width = sight.observation.camera.width;
        let border = MaskBorder::within(width, silhouette.window.clone(), &set);
        let (mask, hand) = (sight.observation.mask.pixels(), sight.hand_depth.pixels());
        let shows = |at: usize| mask[at] && hand[at] == 0.0;
        self.colors.learn(&sight.observation.color, &border, MIXED, shows, GAIN);
        self.ratios = self.colors.ratios();
    }
}
