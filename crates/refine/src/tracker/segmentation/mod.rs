//! Segmentation: the pixels that show the object, by where it should be, depth, colors, and a mask if there is one.

mod parts;
mod settings;
mod window;

use std::mem;
use std::sync::Arc;

use nalgebra::{Isometry3, Translation3};
use prehend_render::Mask;

use self::parts::large_parts;
pub use self::settings::SegmentationSettings;
use self::window::{Label, SegmentationWindow, WindowPixel};
use super::TrackerSettings;
use super::sight::Sight;
use crate::scene::{
    ColorRatios, ForegroundSettings, MaskBorder, Object, RegionColors, RegionEvidence,
};

/// Tells the object from everything else by its colors and those around it, which are learnt from frames in which its pose was
/// believed.
#[derive(Clone, Debug, Default)]
pub(super) struct Segmenter {
    settings: SegmentationSettings,
    foreground: ForegroundSettings,
    /// See [`TrackerSettings::gain`].
    gain: f32,
    colors: RegionColors,
    ratios: ColorRatios,
    /// How often masks say so of pixels that show the object, and of others.
    hits: f32,
    false_alarms: f32,
    /// How much of the object is seen, in squares of depth by pixels.
    seen_area: f32,
    /// See [`color_shares`](Self::color_shares); none before any was learnt from a pose.
    usual_shares: Option<[f64; 2]>,
    /// Where the last frame was looked at; its memory serves the next one.
    window: SegmentationWindow,
}

impl Segmenter {
    pub(super) fn new(settings: &TrackerSettings) -> Self {
        let TrackerSettings { segmentation, gain, fused, .. } = settings;
        let foreground = fused.region.foreground;
        Self { settings: *segmentation, gain: *gain as f32, foreground, ..Self::default() }
    }

    /// Forgets colors, and what masks are worth.
    pub(super) fn forget(&mut self) {
        let Self { settings, foreground, gain, .. } = *self;
        let window = mem::take(&mut self.window);
        *self = Self { settings, foreground, gain, window, ..Self::default() };
    }

    /// Takes the pixels of `sight` that show `object`, which should be at `t_cam_object`, for its mask, and says whether there are any: far less
    /// than those that should is nothing. Where no depth is measured, finds regions, too.
    ///
    /// The mask that came with it is evidence as far as it agrees with pixels that are sure: one of no use tells nothing.
    pub(super) fn segment(
        &mut self,
        sight: &mut Sight,
        object: &Object,
        t_cam_object: &Isometry3<f64>,
    ) -> bool {
        let mut window = mem::take(&mut self.window);
        sight.regions = None;
        let is_seen = window.look(sight, object, t_cam_object, self.settings.reach, &self.settings);
        let is_seen = is_seen.is_some() && self.segment_window(sight, &window);
        self.window = window;
        is_seen
    }

    fn segment_window(&mut self, sight: &mut Sight, window: &SegmentationWindow) -> bool {
        self.judge_masks(window, sight.measured);
        let [set, unset] = self.mask_evidence(sight);
        let settings = &self.settings;
        let (width, height) = (sight.frame.camera.width, sight.frame.camera.height);
        let mask = &mut sight.frame.mask;
        mask.refill(width, height, false);
        let (mut seen, mut expected) = (0.0, 0.0);
        for pixel in window.pixels() {
            expected += pixel.share;
            // Most pixels. Where no depth is measured, colors beyond the object tell nothing of it.
            if pixel.is_elsewhere(settings) || pixel.share == 0.0 && !sight.measured {
                continue;
            }
            let color = self.ratios.of_index(pixel.color);
            let told = if pixel.masked { set } else { unset };
            let evidence = pixel.prior(settings) + pixel.depth_evidence(settings);
            if evidence + color + told <= 0.0 {
                continue;
            }
            seen += 1.0;
            fill(mask, pixel.at, settings.stride());
        }
        sight.focus = Some(window.range());
        if !sight.measured {
            sight.regions = Some(Arc::new(self.regions(sight, window)));
        }
        seen >= self.settings.least_share as f32 * expected && seen > 0.0
    }

    /// Regions by the given mask, if that and the pixels which seem to show the object overlap, and else by colors.
    fn regions(&self, sight: &Sight, window: &SegmentationWindow) -> RegionEvidence {
        let Sight { frame, given, tells, .. } = sight;
        let both =
            frame.mask.pixels().iter().zip(given.pixels()).filter(|(a, b)| **a && **b).count();
        let most = frame.mask.count().max(given.count()) as f64;
        let agrees = *tells && both as f64 >= self.settings.agreement * most;
        let of_mask = || RegionEvidence::of_mask(Some(&frame.color), given, &self.foreground);
        agrees.then(of_mask).flatten().unwrap_or_else(|| {
            let ratios = self.colors.ratios(self.foreground.color_limit, self.foreground.unseen);
            RegionEvidence::of_colors(&frame.color, window.range(), &ratios, &self.foreground)
        })
    }

    /// Adds to the regions of `sight` that `object` is `about` that pose, and in the given box, if there is one.
    pub(super) fn add_prior(&self, sight: &mut Sight, object: &Object, about: &Isometry3<f64>) {
        let mut window = SegmentationWindow::default();
        let Some(regions) = sight.regions.take() else { return };
        let mut regions = Arc::unwrap_or_clone(regions);
        if window.look(sight, object, about, self.settings.reach, &self.settings).is_some() {
            let camera = &sight.frame.camera;
            let sigma = self.settings.stated_sigma * camera.fx / (about * object.center).z;
            let border = MaskBorder::within(camera.width, window.range(), &window.silhouette());
            regions.add_border(&border, sigma as f32, f32::INFINITY);
            if sight.given.count() > 0 {
                let border = MaskBorder::of_window(&sight.given, window.range());
                regions.add_border(&border, self.settings.box_sigma as f32, 0.0);
            }
        }
        sight.regions = Some(Arc::new(regions));
    }

    /// The pixels of `sight` that may show an object of which nothing is known: of its colors, in the mask as far as that has been right, and, of
    /// an object in a hand, near what of the hand is seen, but not on it. None if they are far less than was seen of it before.
    pub(super) fn anywhere(&self, sight: &Sight) -> Option<Mask> {
        let (width, height) = (sight.frame.camera.width, sight.frame.camera.height);
        let mut mask = Mask::filled(width, height, false);
        for pixel in self.places(sight, 0.0)?.iter().flatten() {
            fill(&mut mask, pixel.at, self.settings.stride());
        }
        Some(mask)
    }

    /// `expected`, moved across the line of sight to where its colors are: of the places of [`anywhere`](Self::anywhere), the one at which most of it is seen.
    pub(super) fn find(
        &self,
        sight: &Sight,
        object: &Object,
        expected: &Isometry3<f64>,
    ) -> Option<Isometry3<f64>> {
        let center = expected * object.center;
        let places = self.places(sight, center.z as f32)?;
        let moved = places.iter().take(self.settings.places).map(|place| {
            let mean = |k: usize| {
                place.iter().map(|pixel| f64::from(pixel.at[k])).sum::<f64>() / place.len() as f64
            };
            let center = sight.frame.camera.unproject(mean(0), mean(1), center.z) - center;
            let pose = Translation3::from(center) * expected;
            (self.shown(sight, object, &pose), pose)
        });
        // The first of equals is the largest.
        let better = |best: (f64, _), next: (f64, _)| if next.0 > best.0 { next } else { best };
        moved.reduce(better).map(|(_, pose)| pose)
    }

    /// See [`anywhere`](Self::anywhere): connected parts. Where no depth is measured it is that of the object, `depth` \[m\].
    fn places(&self, sight: &Sight, depth: f32) -> Option<Vec<Vec<WindowPixel>>> {
        let settings = &self.settings;
        let window = SegmentationWindow::whole(sight, depth, settings);
        let [set, unset] = self.mask_evidence(sight);
        let center = window.hand_center();
        // Nothing is known at all.
        if center.is_none() && !self.ratios.are_known() && set == 0.0 {
            return None;
        }
        let may_show = |pixel: &WindowPixel| {
            let color = self.ratios.of_index(pixel.color);
            let told = if pixel.masked { set } else { unset };
            let near = pixel.near_hand(center, &window.place(pixel), settings);
            let evidence = near + color + told;
            // Before any color is known, all that is near the hand may be the object.
            evidence > 0.0 || evidence == 0.0 && !self.ratios.are_known()
        };
        let pixels: Vec<WindowPixel> = window.pixels().copied().collect();
        let may_show: Vec<bool> = pixels.iter().map(may_show).collect();
        let columns = sight.frame.camera.width.div_ceil(settings.stride());
        let parts = large_parts(&may_show, columns, settings.least_share);
        let of_part = |part: &Vec<usize>| part.iter().map(|k| pixels[*k]).collect();
        let parts: Vec<Vec<WindowPixel>> = parts.iter().map(of_part).collect();
        let shown = || parts.iter().flatten();
        let area: f32 = shown().map(WindowPixel::seen_area).sum();
        let enough = shown().count() >= settings.enough
            && area >= settings.least_share as f32 * self.seen_area;
        enough.then_some(parts)
    }

    /// The share of the pixels which should show an object at `t_cam_object` that do so by depth and colors, of those with depth or a color that tells. Where no
    /// depth is measured, over the usual share, one at most.
    pub(super) fn shown(
        &self,
        sight: &Sight,
        object: &Object,
        t_cam_object: &Isometry3<f64>,
    ) -> f64 {
        let mut window = SegmentationWindow::default();
        if window.look(sight, object, t_cam_object, 0.0, &self.settings).is_none() {
            return 0.0;
        }
        if !sight.measured {
            let Some(usual) = self.usual_shares else { return 1.0 };
            let shares = self.color_shares(&window);
            let relative =
                shares.iter().zip(usual).map(|(share, usual)| share / usual.max(f64::MIN_POSITIVE));
            return relative.fold(1.0, f64::min);
        }
        let (mut seen, mut expected) = (0.0, 0.0);
        for pixel in window.pixels() {
            let color = self.ratios.of_index(pixel.color);
            let told = pixel.depth_evidence(&self.settings) + color;
            if told != 0.0 {
                expected += pixel.share;
                let is_seen = told > 0.0 && color > -0.5 * self.settings.color_limit as f32;
                seen += pixel.share * f32::from(u8::from(is_seen));
            }
        }
        if expected > 0.0 { f64::from(seen / expected) } else { 0.0 }
    }

    /// Share of the pixels which should show the object that rather have its colors, and intersection of their histogram and its own.
    fn color_shares(&self, window: &SegmentationWindow) -> [f64; 2] {
        let shown = window.pixels().filter(|pixel| pixel.is_expected());
        let shown: Vec<u16> = shown.map(|pixel| pixel.color).collect();
        let own = shown.iter().filter(|color| self.ratios.of_index(**color) > 0.0).count();
        [own as f64 / shown.len().max(1) as f64, self.colors.object.overlap(&shown)]
    }

    /// Learns colors from a frame with the object at `t_cam_object`.
    pub(super) fn learn(&mut self, sight: &Sight, object: &Object, t_cam_object: &Isometry3<f64>) {
        let mut window = mem::take(&mut self.window);
        if window.look(sight, object, t_cam_object, self.settings.reach, &self.settings).is_some() {
            let area: f32 = window.pixels().map(WindowPixel::expected_area).sum();
            let gain = if self.seen_area > 0.0 { self.gain } else { 1.0 };
            self.seen_area += gain * (area - self.seen_area);
            let is_known = self.ratios.are_known();
            let label = |pixel: &WindowPixel| match (sight.measured, is_known) {
                (true, _) => pixel.label(&self.settings),
                (false, true) => pixel.label_by(self.ratios.of_index(pixel.color) >= 0.0),
                (false, false) => pixel.label_by(pixel.masked || !sight.tells),
            };
            for (of, colors) in
                [(Label::Object, &mut self.colors.object), (Label::Other, &mut self.colors.others)]
            {
                let pixels = window.pixels().filter(|pixel| label(pixel) == Some(of));
                colors.learn(pixels.map(|pixel| pixel.color), self.gain);
            }
            self.ratios = self.colors.ratios(self.settings.color_limit, self.foreground.unseen);
            let shares = self.color_shares(&window);
            let usual = self.usual_shares.unwrap_or(shares);
            let gain = f64::from(self.gain);
            self.usual_shares = Some([0, 1].map(|k| usual[k] + gain * (shares[k] - usual[k])));
        }
        self.window = window;
    }

    /// Finds how often the mask is right, unless too few pixels are sure: what is not where it should be says nothing of masks.
    fn judge_masks(&mut self, window: &SegmentationWindow, measured: bool) {
        let mut expected = 0.0_f32;
        // Of those that show the object and of others, how many are not in the mask and are.
        let mut counts = [[0.0_f32; 2]; 2];
        for pixel in window.pixels() {
            expected += pixel.share;
            let label = match measured {
                true => pixel.label(&self.settings),
                false => pixel.label_by(self.ratios.of_index(pixel.color) >= 0.0),
            };
            if let Some(label) = label {
                counts[label as usize][usize::from(pixel.masked)] += 1.0;
            }
        }
        let share = |label: Label, least: f32| {
            let [unset, set] = counts[label as usize];
            (unset + set >= (self.settings.enough as f32).max(least)).then(|| set / (unset + set))
        };
        let shares = (
            share(Label::Object, self.settings.least_share as f32 * expected),
            share(Label::Other, 0.0),
        );
        (self.hits, self.false_alarms) = match shares {
            (Some(hits), Some(false_alarms)) => (hits, false_alarms),
            // What they were worth is forgotten while they cannot be judged.
            _ => ((1.0 - self.gain) * self.hits, (1.0 - self.gain) * self.false_alarms),
        };
    }

    /// Log-likelihood ratios of the object at a pixel inside the mask of `sight`, and outside of it \[nat\].
    fn mask_evidence(&self, sight: &Sight) -> [f32; 2] {
        if !sight.tells {
            return [0.0; 2];
        }
        let error = self.settings.mask_error as f32;
        let rate = |share: f32| share.max(error).min(1.0 - error);
        let (hits, false_alarms) = (rate(self.hits), rate(self.false_alarms));
        // One that is wrong more often than right is of something else, and does not tell where the object is not.
        [(hits / false_alarms).ln().max(0.0), ((1.0 - hits) / (1.0 - false_alarms)).ln().min(0.0)]
    }
}

/// Sets the pixels that the one at a column and row stands for.
fn fill(mask: &mut Mask, at: [u32; 2], stride: usize) {
    let [x, y] = at.map(|k| k as usize);
    let (width, height) = (mask.width(), mask.height());
    for row in y..(y + stride).min(height) {
        let end = (x + stride).min(width);
        mask.pixels_mut()[row * width + x..row * width + end].fill(true);
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;

    use super::*;
    use crate::scene::default_scene;
    use crate::tracker::sight::Images;

    /// Least share of an object's pixels that show it at its true pose.
    const LEAST_OF_TRUTH: f64 = 0.5;

    /// Overlap of two masks over what either has.
    fn overlap(a: &Mask, b: &Mask) -> f64 {
        let pairs = || a.pixels().iter().zip(b.pixels());
        let both = pairs().filter(|(a, b)| **a && **b).count() as f64;
        both / pairs().filter(|(a, b)| **a || **b).count() as f64
    }

    #[test]
    fn the_object_is_told_from_the_rest_also_by_useless_masks() {
        let scene = default_scene(1).unwrap();
        let sight = |fill: Option<bool>| {
            let mut observation = scene.frame.clone();
            fill.iter().for_each(|fill| observation.mask.pixels_mut().fill(*fill));
            Sight::new(observation, Images::default())
        };
        let mut segmenter = Segmenter::new(&TrackerSettings::default());
        segmenter.learn(&sight(None), &scene.object, &scene.truth);
        // As far off as an object that slips between two frames.
        let off = Isometry3::translation(6e-3, -4e-3, 3e-3) * scene.truth;
        for fill in [None, Some(false), Some(true)] {
            let mut looked = sight(fill);
            assert!(segmenter.segment(&mut looked, &scene.object, &off));
            let overlap = overlap(&looked.frame.mask, &scene.frame.mask);
            assert!(overlap > 0.9, "{fill:?}: {overlap}");
            // From nothing, too.
            let found = segmenter.anywhere(&sight(fill)).unwrap();
            let anywhere = self::overlap(&found, &scene.frame.mask);
            assert!(anywhere > 0.6, "{fill:?}: {anywhere}");
        }
        let away = Isometry3::translation(0.3, 0.0, 0.0) * scene.truth;
        assert!(!segmenter.segment(&mut sight(None), &scene.object, &away));
        let shown = |pose: &Isometry3<f64>| segmenter.shown(&sight(None), &scene.object, pose);
        let [there, elsewhere] = [&scene.truth, &away].map(shown);
        assert!(there > LEAST_OF_TRUTH && there > elsewhere, "{there} {elsewhere}");
        // Something with the colors of what is around it, as far away as the object would be.
        let mut disguised = scene.frame.clone();
        let [left, top, ..] = disguised.mask.bounds().unwrap();
        let around = disguised.color.pixels()[(top - 3) * disguised.camera.width + left - 3];
        disguised.color.pixels_mut().fill(around);
        let disguised = Sight::new(disguised, Images::default());
        let share = segmenter.shown(&disguised, &scene.object, &scene.truth);
        assert!(share < 0.1, "{share}");
    }
    #[test]
    fn colors_alone_tell_where_the_object_is() {
        let scene = default_scene(1).unwrap();
        let mut observation = scene.frame.clone();
        observation.depth.pixels_mut().fill(0.0);
        let sight = || Sight::new(observation.clone(), Images::default());
        let mut segmenter = Segmenter::new(&TrackerSettings::default());
        let unmasked = Sight { tells: false, ..sight() };
        assert!(segmenter.find(&unmasked, &scene.object, &scene.truth).is_none());
        segmenter.learn(&sight(), &scene.object, &scene.truth);
        let shown = |pose: &Isometry3<f64>| segmenter.shown(&sight(), &scene.object, pose);
        let away = Isometry3::translation(0.15, 0.0, 0.0) * scene.truth;
        assert!((shown(&scene.truth) - 1.0).abs() < 1e-6);
        assert!(shown(&away) < 0.5, "{}", shown(&away));
        // It is found wherever it was expected.
        let found = segmenter.find(&sight(), &scene.object, &away).unwrap();
        let center = |pose: &Isometry3<f64>| pose * scene.object.center;
        let off = (center(&found) - center(&scene.truth)).xy().norm();
        assert!(off < 0.6 * scene.object.radius, "{off}");
        // The pixels around its middle are its own, and those beside it are not.
        let mut looked = sight();
        looked.tells = false;
        assert!(segmenter.segment(&mut looked, &scene.object, &scene.truth));
        let overlap = overlap(&looked.frame.mask, &scene.frame.mask);
        assert!(overlap > 0.8, "{overlap}");
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
    }
}
