//! How often colors occur.

/// Levels of a channel.
pub(super) const LEVELS: u16 = 16;
/// What a color that was never seen counts for, as a share of all that were.
const UNSEEN: f32 = 1e-4;

/// Shares of the colors of a part of pictures.
#[derive(Clone, Debug)]
pub(crate) struct ColorHistogram {
    shares: Vec<f32>,
    /// Whether anything was learnt.
    known: bool,
}

impl Default for ColorHistogram {
    fn default() -> Self {
        Self { shares: vec![0.0; usize::from(LEVELS).pow(3)], known: false }
    }
}

/// The number of a color.
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

    /// Whether anything was learnt.
    pub(crate) fn is_known(&self) -> bool {
        self.known
    }

    /// Log-likelihood ratio of this histogram and another one for each color, within ± `limit` \[nat\].
    pub(crate) fn log_ratios(&self, others: &Self, limit: f32) -> impl Iterator<Item = f32> {
        let pairs = self.shares.iter().zip(&others.shares);
        let ratio = |(own, other): (&f32, &f32)| ((own + UNSEEN) / (other + UNSEEN)).ln();
        pairs.map(ratio).map(move |ratio| ratio.clamp(-limit, limit))
    }
}
