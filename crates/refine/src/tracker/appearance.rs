//! The object by its colors, where no depth is measured.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Translation3};
use prehend_render::{DepthImage, draw_depth};

use super::GAIN;
use super::sight::Sight;
use super::sums::Sums;
use crate::scene::{
    COLOR_LIMIT, ColorRatios, MaskBorder, Object, Observation, RegionColors, RegionEvidence,
    color_index,
};

/// How far around the object colors are learnt, as a share of its radius.
const AROUND: f64 = 0.5;
/// Distance from the outline within which colors are mixed \[px\].
const MIXED: f32 = 2.0;
/// Share of the pixels that should show the object of which a mask must have as many as of others to be of it.
const AGREEMENT: f32 = 0.5;
/// Every so many columns and rows a lost object is looked for.
const STRIDE: usize = 4;
/// Share of what was seen of its colors that must be seen again where it is found.
const LEAST_FOUND: f64 = 0.2;

/// Colors of the object and of what is around it, learnt from frames in which its pose was believed.
#[derive(Clone, Debug, Default)]
pub(super) struct Appearance {
    colors: RegionColors,
    ratios: ColorRatios,
    /// See [`shares`](Self::shares).
    usual: [f64; 2],
    /// Area that rather has its colors, were it flat \[m²\].
    area: f64,
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

/// Pixels that an area of 1 m² at `place` has, were it seen from the front.
fn pixels_per_area(sight: &Sight, place: &Point3<f64>) -> f64 {
    let camera = &sight.observation.camera;
    camera.fx * camera.fy / (place.z * place.z)
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

    /// How much of what is usually seen of the object is seen of one at `t_cam_object`: by pixels that rather have its colors, and by how often it has
    /// each color, whichever is less.
    pub(super) fn shown(
        &self,
        sight: &Sight,
        object: &Object,
        t_cam_object: &Isometry3<f64>,
    ) -> f64 {
        let shares = self.shares(sight, object, t_cam_object);
        let relative = shares.iter().zip(&self.usual).map(|(share, usual)| share / usual);
        relative.fold(f64::INFINITY, f64::min)
    }

    /// The share of the pixels which should show an object at `t_cam_object` that rather have its colors, and how far their histogram is its own.
    fn shares(&self, sight: &Sight, object: &Object, t_cam_object: &Isometry3<f64>) -> [f64; 2] {
        let Some(silhouette) = Silhouette::new(sight, object, t_cam_object) else {
            return [0.0; 2];
        };
        let color = sight.observation.color.pixels();
        let shown: Vec<u16> = silhouette.shown(sight).map(|at| color_index(&color[at])).collect();
        let own = shown.iter().filter(|color| self.ratios.of_index(**color) > 0.0).count();
        [own as f64 / shown.len().max(1) as f64, self.colors.object.overlap(&shown)]
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
        self.ratios = self.colors.ratios(COLOR_LIMIT);
        let shares = self.shares(sight, object, t_cam_object);
        let drawn = set.iter().filter(|set| **set).count() as f64;
        self.area = drawn * shares[0] / pixels_per_area(sight, &(t_cam_object * object.center));
        let gain = if self.usual == [0.0; 2] { 1.0 } else { f64::from(GAIN) };
        for (usual, share) in self.usual.iter_mut().zip(shares) {
            *usual += gain * (share - *usual);
        }
    }

    /// `expected`, moved across the line of sight to where most of its colors are seen within a square as large as it and fewest around that; none if these are
    /// too few.
    pub(super) fn find(
        &self,
        sight: &Sight,
        object: &Object,
        expected: &Isometry3<f64>,
    ) -> Option<Isometry3<f64>> {
        let center = expected * object.center;
        if center.z <= object.radius || !self.ratios.are_known() {
            return None;
        }
        let Observation { camera, color, .. } = &sight.observation;
        let (columns, rows) = (camera.width / STRIDE, camera.height / STRIDE);
        let has_color = |k: usize| {
            let at = (k / columns * camera.width + k % columns) * STRIDE;
            let hidden = sight.hand_depth.pixels()[at] > 0.0;
            f32::from(u8::from(!hidden && self.ratios.of(&color.pixels()[at]) > 0.0))
        };
        let seen: Vec<f32> = (0..columns * rows).map(has_color).collect();
        let reach = (0.5 * object.radius * camera.fx / center.z) as usize / STRIDE + 1;
        let [mut within, mut around] = [Sums::default(), Sums::default()];
        within.find(&seen, (columns, rows), reach);
        around.find(&seen, (columns, rows), 2 * reach);
        let score = |k: &usize| 2.0 * within.all[*k] - around.all[*k];
        let best = (0..seen.len()).max_by(|a, b| score(a).total_cmp(&score(b)))?;
        let usual = self.area * pixels_per_area(sight, &center) / STRIDE.pow(2) as f64;
        if f64::from(within.all[best]) < LEAST_FOUND * usual {
            return None;
        }
        let [x, y] = [best % columns, best / columns].map(|at| (at * STRIDE) as f64);
        let place = camera.unproject(x, y, center.z);
        Some(Translation3::from(place - center) * expected)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;

    use super::*;
    use crate::scene::default_scene;
    use crate::tracker::sight::Images;

    #[test]
    fn colors_tell_where_the_object_is() {
        let scene = default_scene(1).unwrap();
        let mut observation = scene.observation.clone();
        observation.depth.pixels_mut().fill(0.0);
        let sight = || Sight::new(observation.clone(), Some(&scene.hand), Images::default());
        let mut appearance = Appearance::default();
        assert!(appearance.find(&sight(), &scene.object, &scene.truth).is_none());
        let mut first = sight();
        first.observation.mask.copy_from(&first.given.clone());
        appearance.learn(&first, &scene.object, &scene.truth);
        let shown = |pose: &Isometry3<f64>| appearance.shown(&sight(), &scene.object, pose);
        let away = Isometry3::translation(0.15, 0.0, 0.0) * scene.truth;
        assert!((shown(&scene.truth) - 1.0).abs() < 1e-6);
        assert!(shown(&away) < 0.5, "{}", shown(&away));
        // The pixels around its middle are its own, and those beside it are not.
        let mut looked = sight();
        looked.tells = false;
        assert!(appearance.look(&mut looked, &scene.object, &scene.truth));
        let regions = looked.regions.unwrap();
        let mean = |set: bool| {
            let width = scene.observation.camera.width;
            let [columns, rows] = looked.focus.clone().unwrap();
            let mask = scene.observation.mask.pixels();
            let places = rows.flat_map(|y| columns.clone().map(move |x| (x, y)));
            let values = places.filter(|(x, y)| mask[y * width + x] == set);
            let values: Vec<f64> =
                values.map(|(x, y)| regions.at(&Vector2::new(x as f64, y as f64))).collect();
            values.iter().sum::<f64>() / values.len() as f64
        };
        assert!(mean(true) > 0.5 && mean(false) < -0.3, "{} {}", mean(true), mean(false));
        // It is found wherever it was expected.
        let found = appearance.find(&sight(), &scene.object, &away).unwrap();
        let center = |pose: &Isometry3<f64>| pose * scene.object.center;
        let off = (center(&found) - center(&scene.truth)).xy().norm();
        assert!(off < 0.6 * scene.object.radius, "{off}");
    }
}
