//! How the fragments of a pixel are blended.

use super::candidate::{Candidate, Part};
use super::exponential::exp;
use super::number::Number;
use super::settings::Settings;

/// The sums of a pixel's blend.
#[derive(Clone, Copy)]
pub(crate) struct Blend<T> {
    /// Depth of the nearest fragment \[m\].
    pub(crate) nearest: T,
    /// 1 where that depth moves the depth that weights are relative to, but not the background's weight; else 0.
    pub(crate) drifting: T,
    /// δ, the background's weight.
    pub(crate) background: T,
    /// One over Σ w + δ.
    pub(crate) inverse_sum: T,
    /// 1 − α = Π (1 − p).
    pub(crate) clear: T,
}

impl<T: Number> Blend<T> {
    /// Weighs `candidates`, writing each one's part.
    #[inline(always)]
    pub(crate) fn new(candidates: &mut [Candidate<T>], settings: &Settings, zero: T) -> Self {
        let is = |value: f32| zero.like(value);
        let one = is(1.0);
        let mut nearest = is(f32::INFINITY);
        for candidate in candidates.iter() {
            let z = candidate.fragment.z;
            let nearer = zero.below(candidate.counts) & z.below(nearest);
            nearest = T::pick(nearer, z, nearest);
        }
        let (farthest, rate) = (is(settings.farthest), is(settings.depth_rate));
        let in_range = nearest.below(farthest);
        let reference = T::pick(in_range, nearest, farthest);
        let (background, bounded) = settings.background(reference);
        let (mut sum, mut clear) = (background, one);
        for candidate in candidates {
            let counts = zero.below(candidate.counts);
            // exp is bounded, so that a p of one and a p of zero both stay finite.
            let e = exp(candidate.fragment.distance * is(settings.sharpness));
            let presence = one / (one + e);
            let depth = exp((reference - candidate.fragment.z) * rate);
            let part = Part {
                presence: T::pick(counts, presence, zero),
                absence: T::pick(counts, e * presence, one),
                weight: T::pick(counts, presence * depth, zero),
            };
            sum = sum + part.weight;
            clear = clear * part.absence;
            candidate.part = part;
        }
        let drifting = T::pick(bounded & in_range, one, zero);
        Self { nearest, drifting, background, inverse_sum: one / sum, clear }
    }
}
