//! How the fragments of a pixel are blended.

use super::exponential::exp;
use super::fragment::Fragment;
use super::settings::Settings;

/// A fragment's part in its pixel.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Part {
    /// p = sigmoid(−d/σ).
    pub(crate) presence: f32,
    /// 1 − p, without cancellation.
    pub(crate) absence: f32,
    /// w = p exp((ζ − ζ_max)/γ).
    pub(crate) weight: f32,
}

/// The sums of a pixel's blend.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Blend {
    /// Depth of the nearest fragment \[m\].
    pub(crate) nearest: f32,
    /// Its depth moves the depth that weights are relative to, but not the background's weight.
    pub(crate) drifting: bool,
    /// δ, the background's weight.
    pub(crate) background: f32,
    /// Σ w + δ.
    pub(crate) sum: f32,
    /// 1 − α = Π (1 − p).
    pub(crate) clear: f32,
}

impl Blend {
    /// Weighs `fragments`, writing each one's part to `parts`.
    #[inline(always)]
    pub(crate) fn new(fragments: &[Fragment], parts: &mut [Part], settings: &Settings) -> Self {
        let nearest = fragments.iter().fold(f32::INFINITY, |z, f| if f.z < z { f.z } else { z });
        let reference = nearest.min(settings.farthest);
        let (background, bounded) = settings.background(reference);
        for (part, fragment) in parts.iter_mut().zip(fragments) {
            // exp is bounded, so that a p of one and a p of zero both stay finite.
            let e = exp(fragment.distance * settings.sharpness);
            let presence = 1.0 / (1.0 + e);
            let depth = exp((reference - fragment.z) * settings.depth_rate);
            *part = Part { presence, absence: e * presence, weight: presence * depth };
        }
        let (mut sum, mut clear) = (background, 1.0);
        for part in &parts[..fragments.len()] {
            sum += part.weight;
            clear *= part.absence;
        }
        let drifting = bounded && nearest < settings.farthest;
        Self { nearest, drifting, background, sum, clear }
    }
}
