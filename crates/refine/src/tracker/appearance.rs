//! The object by its colors, where no depth is measured.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Translation3};
use prehend_render::{DepthImage, draw_depth};

use super::settings::TrackerSettings;
use super::sight::Sight;
use crate::defaults::settings;
use crate::scene::{
    ColorRatios, ForegroundSettings, Frame, MaskBorder, Object, RegionColors, RegionEvidence, Sums,
    color_index,
};

settings! {
    /// Settings of the object by its colors, where no depth is measured.
    #[derive(Copy)]
    pub struct AppearanceSettings {
        /// Distance around the object in which colors are learnt and compared, in radii of it.
        pub around: f64 = 0.5,
        /// Distance from the outline within which colors are mixed \[px\].
        pub mixed: f64 = 2.0,
        /// Share of a given mask, and of the pixels that seem to show the object, which both must have for the mask to count.
        pub agreement: f64 = 0.5,
        /// Area with its colors where an object is found, as a share of that seen before.
        pub least_found: f64 = 0.2,
        /// Number of places that are compared where an object is looked for.
        pub places: usize = 4,
        /// Standard deviation of the outline of a stated pose \[m\]. EXPERIMENTS: No mask, color only.
        pub stated_sigma: f64 = 5e-3,
        /// Standard deviation of the sides of a box that is given for a mask \[px\].
        pub box_sigma: f64 = 5.0,
        /// Number of times that colors and pose are found in turns where no mask tells the object.
        pub rounds: usize = 3,
    }
}

/// Share of pixels that is none.
const LEAST_SHARE: f64 = 1e-3;

/// Colors of the object and of what is around it, learnt from frames in which its pose was believed.
#[derive(Clone, Debug, Default)]
pub(super) struct Appearance {
    colors: RegionColors,
    ratios: ColorRatios,
    /// See [`shares`](Self::shares); none before any was learnt from a pose.
    usual: Option<[f64; 2]>,
    /// Area that rather has its colors, were it flat \[m²\].
    area: f64,
    settings: AppearanceSettings,
    foreground: ForegroundSettings,
    /// See [`TrackerSettings::gain`].
    gain: f64,
    /// Distance of the columns and rows of which a lost object is looked for \[px\].
    stride: usize,
}

/// Depth of the object in a part of an image, as if nothing else were there.
struct Silhouette {
    /// Columns and rows of the image.
    window: [Range<usize>; 2],
    /// Depth in the window \[m\]; 0 where the object is not.
    depth: DepthImage,
}

impl Silhouette {
    /// Border of the object.
    fn border(&self, sight: &Sight) -> MaskBorder {
        let set: Vec<bool> = self.depth.pixels().iter().map(|z| *z > 0.0).collect();
        MaskBorder::within(sight.frame.camera.width, self.window.clone(), &set)
    }

    /// Indices in the image of the pixels that should show the object.
    fn shown<'a>(&'a self, sight: &'a Sight) -> impl Iterator<Item = usize> + 'a {
        let [columns, rows] = self.window.clone();
        let width = sight.frame.camera.width;
        let index = rows.flat_map(move |y| columns.clone().map(move |x| y * width + x));
        let hand = sight.hand_depth.pixels();
        let shown = move |(at, z): (usize, f32)| {
            let hidden = hand[at] > 0.0 && hand[at] < z;
            (z > 0.0 && !hidden).then_some(at)
        };
        index.zip(self.depth.pixels().iter().copied()).filter_map(shown)
    }
}

/// Pixels that an area of 1 m² at `place` has, were it seen from the front.
fn pixels_per_area(sight: &Sight, place: &Point3<f64>) -> f64 {
    let camera = &sight.frame.camera;
    camera.fx * camera.fy / (place.z * place.z)
}

impl Appearance {
    /// Nothing is known of colors yet.
    pub(super) fn new(settings: &TrackerSettings) -> Self {
        Self {
            settings: settings.appearance,
            foreground: settings.fused.region.foreground,
            gain: settings.gain,
            stride: 2 * settings.segmentation.stride(),
            ..Self::default()
        }
    }

    /// Colors that were learnt otherwise.
    pub(super) fn of(colors: &RegionColors, settings: &TrackerSettings) -> Self {
        let own = Self { colors: colors.clone(), ..Self::new(settings) };
        Self { ratios: own.ratios(), ..own }
    }

    fn ratios(&self) -> ColorRatios {
        self.colors.ratios(self.foreground.color_limit, self.foreground.unseen)
    }

    /// Silhouette of `object` at a pose, with what is around it; none if that is not in the image.
    fn silhouette(
        &self,
        sight: &Sight,
        object: &Object,
        t_cam_object: &Isometry3<f64>,
    ) -> Option<Silhouette> {
        let camera = &sight.frame.camera;
        let center = t_cam_object * object.center;
        if center.z <= object.radius {
            return None;
        }
        let at = camera.project(&center)?;
        let extent = (1.0 + self.settings.around) * object.radius * camera.fx.max(camera.fy)
            / (center.z - object.radius);
        let window = sight.part(&at, extent, 1);
        let [columns, rows] = &window;
        if columns.is_empty() || rows.is_empty() {
            return None;
        }
        let part = camera.cropped(columns.start, rows.start, columns.len(), rows.len());
        let mut depth = DepthImage::default();
        draw_depth(&mut depth, &part, &[(&object.model, *t_cam_object)]);
        depth.pixels().iter().any(|z| *z > 0.0).then_some(Silhouette { window, depth })
    }

    /// True once both kinds of colors are known.
    pub(super) fn is_known(&self) -> bool {
        self.ratios.are_known()
    }

    /// Finds what of `sight` shows `object`, which should be at `t_cam_object`, and how far its pixels are the object's; false if nothing is seen of it. A single
    /// frame without a mask has an object that is stated to be `about` somewhere.
    pub(super) fn look(
        &self,
        sight: &mut Sight,
        object: &Object,
        t_cam_object: &Isometry3<f64>,
        about: Option<&Isometry3<f64>>,
    ) -> bool {
        let Some(silhouette) = self.silhouette(sight, object, t_cam_object) else { return false };
        let color = &sight.frame.color;
        let seen: Vec<usize> = silhouette
            .shown(sight)
            .filter(|at| self.ratios.of(&color.pixels()[*at]) >= 0.0)
            .collect();
        let given = sight.given.pixels();
        let both = seen.iter().filter(|at| given[**at]).count() as f32;
        let agreement = self.settings.agreement as f32;
        let agrees = sight.tells
            && both >= agreement * seen.len() as f32
            && both >= agreement * sight.given.count() as f32;
        let regions = match agrees {
            true => RegionEvidence::of_mask(Some(color), &sight.given, &self.foreground),
            false => None,
        };
        let mut regions = regions.unwrap_or_else(|| {
            let window = silhouette.window.clone();
            RegionEvidence::of_colors(color, window, &self.ratios, &self.foreground)
        });
        if let Some(about) = about {
            self.place(&mut regions, sight, object, about);
        }
        sight.regions = Some(Arc::new(regions));
        let (width, height) = (sight.frame.camera.width, sight.frame.camera.height);
        let mask = &mut sight.frame.mask;
        mask.refill(width, height, false);
        seen.iter()
            .filter(|at| !agrees || given[**at])
            .for_each(|at| mask.pixels_mut()[*at] = true);
        sight.focus = Some(silhouette.window);
        !seen.is_empty()
    }

    /// Adds to `regions` that the object was stated to be `about` somewhere, and in the given box, if there is one.
    fn place(
        &self,
        regions: &mut RegionEvidence,
        sight: &Sight,
        object: &Object,
        about: &Isometry3<f64>,
    ) {
        let (camera, given) = (&sight.frame.camera, sight.given.pixels());
        let Some(silhouette) = self.silhouette(sight, object, about) else { return };
        let border = silhouette.border(sight);
        let sigma = self.settings.stated_sigma * camera.fx / (about * object.center).z;
        regions.add_border(&border, sigma as f32, f32::INFINITY);
        if sight.given.count() > 0 {
            let window = silhouette.window;
            let [columns, rows] = window.clone();
            let set = rows.flat_map(|y| columns.clone().map(move |x| given[y * camera.width + x]));
            let border = MaskBorder::within(camera.width, window, &set.collect::<Vec<_>>());
            regions.add_border(&border, self.settings.box_sigma as f32, 0.0);
        }
    }

    /// Share of what is usually seen of the object that is seen of one at `t_cam_object`, one at most: by pixels that rather have its colors, and by how often
    /// it has each color, whichever is less. One where nothing is known of it.
    pub(super) fn shown(
        &self,
        sight: &Sight,
        object: &Object,
        t_cam_object: &Isometry3<f64>,
    ) -> f64 {
        let Some(usual) = self.usual else { return 1.0 };
        let Some(silhouette) = self.silhouette(sight, object, t_cam_object) else { return 0.0 };
        let shares = self.shares(sight, &silhouette);
        let relative =
            shares.iter().zip(usual).map(|(share, usual)| share / usual.max(LEAST_SHARE));
        relative.fold(1.0, f64::min)
    }

    /// Share of the pixels which should show the object that rather have its colors, and intersection of their histogram and its own.
    fn shares(&self, sight: &Sight, silhouette: &Silhouette) -> [f64; 2] {
        let color = sight.frame.color.pixels();
        let shown: Vec<u16> = silhouette.shown(sight).map(|at| color_index(&color[at])).collect();
        let own = shown.iter().filter(|color| self.ratios.of_index(**color) > 0.0).count();
        [own as f64 / shown.len().max(1) as f64, self.colors.object.overlap(&shown)]
    }

    /// Learns colors from a frame with the object at `t_cam_object`.
    pub(super) fn learn(&mut self, sight: &Sight, object: &Object, t_cam_object: &Isometry3<f64>) {
        let Some(silhouette) = self.silhouette(sight, object, t_cam_object) else { return };
        let border = silhouette.border(sight);
        let (mask, color) = (sight.frame.mask.pixels(), &sight.frame.color);
        let mut shown = vec![false; color.pixels().len()];
        silhouette.shown(sight).for_each(|at| shown[at] = true);
        let known = self.ratios.are_known();
        let shows = |at: usize| match known {
            true => shown[at] && self.ratios.of(&color.pixels()[at]) >= 0.0,
            false => shown[at] && mask[at],
        };
        let mixed = self.settings.mixed as f32;
        self.colors.learn(color, &border, mixed, shows, self.gain as f32);
        self.ratios = self.ratios();
        let shares = self.shares(sight, &silhouette);
        let drawn = silhouette.depth.pixels().iter().filter(|z| **z > 0.0).count() as f64;
        self.area = drawn * shares[0] / pixels_per_area(sight, &(t_cam_object * object.center));
        let usual = self.usual.unwrap_or(shares);
        let next = |k: usize| usual[k] + self.gain * (shares[k] - usual[k]);
        self.usual = Some([next(0), next(1)]);
    }

    /// `expected`, moved across the line of sight to where its colors are: of the places with most of them within a square as large as it, and fewest around
    /// that, the one at which most of it is seen. None if these are too few.
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
        let Frame { camera, color, .. } = &sight.frame;
        let stride = self.stride;
        let (columns, rows) = (camera.width / stride, camera.height / stride);
        if columns == 0 {
            return None;
        }
        let has_color = |k: usize| {
            let at = (k / columns * camera.width + k % columns) * stride;
            let hand = f64::from(sight.hand_depth.pixels()[at]);
            let hidden = hand > 0.0 && hand < center.z;
            f32::from(u8::from(!hidden && self.ratios.of(&color.pixels()[at]) > 0.0))
        };
        let seen: Vec<f32> = (0..columns * rows).map(has_color).collect();
        let reach = (0.5 * object.radius * camera.fx / center.z) as usize / stride + 1;
        let [mut within, mut around] = [Sums::default(), Sums::default()];
        within.find(&seen, (columns, rows), reach);
        around.find(&seen, (columns, rows), 2 * reach);
        let score = |k: &usize| 2.0 * within.all[*k] - around.all[*k];
        let usual = self.area * pixels_per_area(sight, &center) / stride.pow(2) as f64;
        let is_enough = |k: &usize| f64::from(within.all[*k]) >= self.settings.least_found * usual;
        let mut places: Vec<usize> = (0..seen.len()).filter(is_enough).collect();
        let mut best: Option<(f64, Isometry3<f64>)> = None;
        for _ in 0..self.settings.places {
            let Some(place) = places.iter().copied().max_by(|a, b| score(a).total_cmp(&score(b)))
            else {
                break;
            };
            let [column, row] = [place % columns, place / columns];
            places.retain(|k| {
                (k % columns).abs_diff(column).max((k / columns).abs_diff(row)) > reach
            });
            let [x, y] = [column, row].map(|at| (at * stride) as f64);
            let moved = Translation3::from(camera.unproject(x, y, center.z) - center) * expected;
            let shown = self.shown(sight, object, &moved);
            if best.as_ref().is_none_or(|(most, _)| shown > *most) {
                best = Some((shown, moved));
            }
        }
        best.map(|(_, pose)| pose)
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
        let mut observation = scene.frame.clone();
        observation.depth.pixels_mut().fill(0.0);
        let sight = || Sight::new(observation.clone(), Images::default());
        let mut appearance = Appearance::new(&TrackerSettings::default());
        assert!(appearance.find(&sight(), &scene.object, &scene.truth).is_none());
        let mut first = sight();
        first.frame.mask.copy_from(&first.given.clone());
        appearance.learn(&first, &scene.object, &scene.truth);
        let shown = |pose: &Isometry3<f64>| appearance.shown(&sight(), &scene.object, pose);
        let away = Isometry3::translation(0.15, 0.0, 0.0) * scene.truth;
        assert!((shown(&scene.truth) - 1.0).abs() < 1e-6);
        assert!(shown(&away) < 0.5, "{}", shown(&away));
        // The pixels around its middle are its own, and those beside it are not.
        let mut looked = sight();
        looked.tells = false;
        assert!(appearance.look(&mut looked, &scene.object, &scene.truth, None));
        let regions = looked.regions.unwrap();
        let mean = |set: bool| {
            let width = scene.frame.camera.width;
            let [columns, rows] = looked.focus.clone().unwrap();
            let mask = scene.frame.mask.pixels();
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
