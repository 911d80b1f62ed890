//! What of a picture shows the object, told by where it should be, depth, colors, and a mask if there is one.

mod parts;
mod settings;
mod window;

use std::mem;

use nalgebra::Isometry3;
use prehend_render::Mask;

use self::parts::large_parts;
pub use self::settings::SegmentationSettings;
use self::window::{Label, Pixel, Window};
use super::TrackerSettings;
use super::sight::Sight;
use crate::scene::{ColorRatios, Object, RegionColors};

/// Tells the object from everything else by its colors and those around it, which are learnt from frames in which its pose was
/// believed.
#[derive(Clone, Debug, Default)]
pub(super) struct Segmenter {
    settings: SegmentationSettings,
    /// See [`TrackerSettings::gain`].
    gain: f32,
    /// Probability of a color that was never seen.
    unseen: f64,
    colors: RegionColors,
    ratios: ColorRatios,
    /// How often masks say so of pixels that show the object, and of others.
    hits: f32,
    false_alarms: f32,
    /// How much of the object is seen, in squares of depth by pixels.
    seen_area: f32,
    /// Where the last frame was looked at; its memory serves the next one.
    window: Window,
}

impl Segmenter {
    pub(super) fn new(settings: &TrackerSettings) -> Self {
        let TrackerSettings { segmentation, gain, fused, .. } = settings;
        let unseen = fused.region.foreground.unseen;
        Self { settings: *segmentation, gain: *gain as f32, unseen, ..Self::default() }
    }

    /// Takes the pixels of `sight` that show `object`, which should be at `t_cam_object`, for its mask, and says whether there are any: far less
    /// than those that should is nothing.
    ///
    /// The mask that came with it is evidence as far as it agrees with pixels that are sure: one of no use tells nothing.
    pub(super) fn segment(
        &mut self,
        sight: &mut Sight,
        object: &Object,
        t_cam_object: &Isometry3<f64>,
    ) -> bool {
        let mut window = mem::take(&mut self.window);
        if window.look(sight, object, t_cam_object, self.settings.reach, &self.settings).is_none() {
            self.window = window;
            return false;
        }
        self.judge_masks(&window);
        let [set, unset] = self.mask_evidence(sight);
        let settings = &self.settings;
        let (width, height) = (sight.frame.camera.width, sight.frame.camera.height);
        let mask = &mut sight.frame.mask;
        mask.refill(width, height, false);
        let (mut seen, mut expected) = (0.0, 0.0);
        for pixel in window.pixels() {
            expected += pixel.share;
            // Most pixels.
            if pixel.is_elsewhere(settings) {
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
        let is_seen = seen >= settings.least_share as f32 * expected && seen > 0.0;
        self.window = window;
        is_seen
    }

    /// The pixels of `sight` that may show an object of which nothing is known: of its colors, in the mask as far as that has been right, and, of
    /// an object in a hand, near what of the hand is seen, but not on it. None if they are far less than was seen of it before.
    pub(super) fn anywhere(&self, sight: &Sight) -> Option<Mask> {
        let settings = &self.settings;
        let window = Window::whole(sight, settings);
        let [set, unset] = self.mask_evidence(sight);
        let center = window.hand_center();
        // Nothing is known at all.
        if center.is_none() && !self.ratios.are_known() && set == 0.0 {
            return None;
        }
        let may_show = |pixel: &Pixel| {
            let color = self.ratios.of_index(pixel.color);
            let told = if pixel.masked { set } else { unset };
            let near = pixel.near_hand(center, &window.place(pixel), settings);
            let evidence = near + color + told;
            // Before any color is known, all that is near the hand may be the object.
            evidence > 0.0 || evidence == 0.0 && !self.ratios.are_known()
        };
        let may_show: Vec<bool> = window.pixels().map(may_show).collect();
        let columns = sight.frame.camera.width.div_ceil(settings.stride());
        let parts = large_parts(&may_show, columns, settings.least_share);
        let shown =
            || window.pixels().zip(&parts).filter(|(_, part)| **part).map(|(pixel, _)| pixel);
        let area: f32 = shown().map(Pixel::seen_area).sum();
        let (width, height) = (sight.frame.camera.width, sight.frame.camera.height);
        let mut mask = Mask::filled(width, height, false);
        shown().for_each(|pixel| fill(&mut mask, pixel.at, settings.stride()));
        let enough = shown().count() >= settings.enough
            && area >= settings.least_share as f32 * self.seen_area;
        enough.then_some(mask)
    }

    /// The share of the pixels which should show an object at `t_cam_object` that do so by depth and colors, of those with depth or a color that tells.
    pub(super) fn shown(
        &self,
        sight: &Sight,
        object: &Object,
        t_cam_object: &Isometry3<f64>,
    ) -> f64 {
        let mut window = Window::default();
        if window.look(sight, object, t_cam_object, 0.0, &self.settings).is_none() {
            return 0.0;
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

    /// Colors as far as they are known.
    pub(super) fn colors(&self) -> &RegionColors {
        &self.colors
    }

    /// Learns colors from a frame with the object at `t_cam_object`.
    pub(super) fn learn(&mut self, sight: &Sight, object: &Object, t_cam_object: &Isometry3<f64>) {
        let mut window = mem::take(&mut self.window);
        if window.look(sight, object, t_cam_object, self.settings.reach, &self.settings).is_some() {
            let area: f32 = window.pixels().map(Pixel::expected_area).sum();
            let gain = if self.seen_area > 0.0 { self.gain } else { 1.0 };
            self.seen_area += gain * (area - self.seen_area);
            for (label, colors) in
                [(Label::Object, &mut self.colors.object), (Label::Other, &mut self.colors.others)]
            {
                let pixels =
                    window.pixels().filter(|pixel| pixel.label(&self.settings) == Some(label));
                colors.learn(pixels.map(|pixel| pixel.color), self.gain);
            }
            self.ratios = self.colors.ratios(self.settings.color_limit, self.unseen);
        }
        self.window = window;
    }

    /// Finds how often the mask is right, unless too few pixels are sure: what is not where it should be says nothing of masks.
    fn judge_masks(&mut self, window: &Window) {
        let mut expected = 0.0_f32;
        // Of those that show the object and of others, how many are not in the mask and are.
        let mut counts = [[0.0_f32; 2]; 2];
        for pixel in window.pixels() {
            expected += pixel.share;
            if let Some(label) = pixel.label(&self.settings) {
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

    /// What it tells that a pixel is in the mask of `sight`, and that it is not \[nat\].
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
    use super::*;
    use crate::scene::default_scene;
    use crate::tracker::sight::Images;

    /// What is seen of an object where it is, at least.
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
}
