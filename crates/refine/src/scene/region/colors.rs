//! How often colors occur.

use prehend_render::RgbImage;

use super::border::MaskBorder;

/// Levels of a channel.
const LEVELS: u16 = 16;
/// Levels of a channel of histograms that are compared.
const COARSE: usize = 4;

/// Shares of the colors of a part of pictures.
#[derive(Clone, Debug)]
pub(crate) struct ColorHistogram {
    shares: Vec<f32>,
    /// True once anything was learnt.
    known: bool,
}

impl Default for ColorHistogram {
    fn default() -> Self {
        let colors = usize::from(color_index(&[1.0; 3])) + 1;
        Self { shares: vec![0.0; colors], known: false }
    }
}

/// Index of a color in histograms.
pub(crate) fn color_index(color: &[f32; 3]) -> u16 {
    let level =
        |channel: f32| (channel * f32::from(LEVELS)).clamp(0.0, f32::from(LEVELS - 1)) as u16;
    let [r, g, b] = color.map(level);
    (r * LEVELS + g) * LEVELS + b
}

impl ColorHistogram {
    /// Goes a part `gain` of the way to what `colors` show, and all of it at first.
    pub(crate) fn learn(&mut self, colors: impl Iterator<Item = u16> + Clone, gain: f32) {
        let count = colors.clone().count();
        if count == 0 {
            return;
        }
        let gain = if self.known { gain } else { 1.0 };
        self.known = true;
        self.shares.iter_mut().for_each(|share| *share *= 1.0 - gain);
        let each = gain / count as f32;
        for color in colors {
            self.shares[usize::from(color)] += each;
        }
    }

    /// Intersection with the histogram of `colors` (Swain and Ballard, 1991), of fewer levels: from 0 to 1, which is the same distribution.
    pub(crate) fn overlap(&self, colors: &[u16]) -> f64 {
        let coarse = |index: usize| {
            let level = |k: usize| index / usize::from(LEVELS).pow(k as u32) % usize::from(LEVELS);
            (0..3).fold(0, |sum, k| sum * COARSE + level(k) * COARSE / usize::from(LEVELS))
        };
        let [mut own, mut others] = [[0.0_f64; COARSE.pow(3)]; 2];
        for (index, share) in self.shares.iter().enumerate() {
            own[coarse(index)] += f64::from(*share);
        }
        let each = 1.0 / colors.len().max(1) as f64;
        colors.iter().for_each(|index| others[coarse(usize::from(*index))] += each);
        own.iter().zip(&others).map(|(a, b)| a.min(*b)).sum()
    }
}

/// Colors of an object, and of what is around it.
#[derive(Clone, Debug, Default)]
pub(crate) struct RegionColors {
    pub(crate) object: ColorHistogram,
    pub(crate) others: ColorHistogram,
}

impl RegionColors {
    /// Goes a part `gain` of the way to what the pixels of `image` show on both sides of `border`, beyond `margin` \[px\] from it. Those within it that do
    /// not show the object by `shows`, which is asked with an index of the image, are others.
    pub(crate) fn learn(
        &mut self,
        image: &RgbImage,
        border: &MaskBorder,
        margin: f32,
        shows: impl Fn(usize) -> bool,
        gain: f32,
    ) {
        let (mut object, mut others) = (Vec::new(), Vec::new());
        for (at, inside) in border.pixels().filter(|(_, inside)| inside.abs() > margin) {
            let colors = if inside > 0.0 && shows(at) { &mut object } else { &mut others };
            colors.push(color_index(&image.pixels()[at]));
        }
        self.object.learn(object.into_iter(), gain);
        self.others.learn(others.into_iter(), gain);
    }

    /// Log-likelihood ratio of each color, `limit` at most \[nat\], of which `unseen` ones have that probability; nothing before both are known.
    pub(crate) fn ratios(&self, limit: f64, unseen: f64) -> ColorRatios {
        let [limit, unseen] = [limit, unseen].map(|v| v as f32);
        let Self { object, others } = self;
        if !(object.known && others.known) {
            return ColorRatios::default();
        }
        let ratio = |(own, other): (&f32, &f32)| ((own + unseen) / (other + unseen)).ln();
        let pairs = object.shares.iter().zip(&others.shares).map(ratio);
        ColorRatios { values: pairs.map(|ratio| ratio.clamp(-limit, limit)).collect(), limit }
    }
}

/// Log-likelihood ratio of each color between object and others \[nat\].
#[derive(Clone, Debug, Default)]
pub(crate) struct ColorRatios {
    /// By number of the color; empty where nothing is known.
    values: Vec<f32>,
    /// Largest ratio \[nat\].
    limit: f32,
}

impl ColorRatios {
    /// Largest ratio \[nat\].
    pub(crate) fn limit(&self) -> f32 {
        self.limit
    }

    /// True where any is known.
    pub(crate) fn are_known(&self) -> bool {
        !self.values.is_empty()
    }

    /// Log-likelihood ratio of the color with an index; 0 where nothing is known \[nat\].
    pub(crate) fn of_index(&self, index: u16) -> f32 {
        self.values.get(usize::from(index)).copied().unwrap_or_default()
    }

    /// Log-likelihood ratio of a color \[nat\].
    pub(crate) fn of(&self, color: &[f32; 3]) -> f32 {
        self.of_index(color_index(color))
    }
}
