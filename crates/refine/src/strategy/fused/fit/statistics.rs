//! In how many ways a pose fits what was observed, and how well in each.

use std::collections::BTreeMap;

use super::pixels::Pixels;
use crate::factor::{NoiseEstimate, PriorSettings};
use crate::problem::{Linearization, State};
use crate::scene::{Frame, median};

/// What is most likely wrong where something does not fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Suspect {
    /// The surface lies elsewhere than depth was measured.
    Depth,
    DepthScale,
    Hand,
    Touch,
    Color,
    Mask,
}

/// A way in which a pose may not fit.
pub(super) struct Statistic {
    pub(super) name: &'static str,
    /// What does not matter: about so much is added before logarithms are taken.
    negligible: f64,
    pub(super) suspect: Suspect,
}

const fn statistic(name: &'static str, negligible: f64, suspect: Suspect) -> Statistic {
    Statistic { name, negligible, suspect }
}

/// Their number.
pub(super) const COUNT: usize = 17;

/// All of them, in the order of [`FitStatistics`].
pub(super) const STATISTICS: [Statistic; COUNT] = [
    // Medians and root mean squares, over the noise of single pixels.
    statistic("depth residual", 0.2, Suspect::Depth),
    statistic("depth offset", 0.3, Suspect::Depth),
    statistic("depth residual of patches", 0.2, Suspect::Depth),
    statistic("hand depth offset", 0.1, Suspect::DepthScale),
    statistic("hand depth residual", 0.2, Suspect::Hand),
    // Standard deviation [m].
    statistic("correlated depth noise", 2e-4, Suspect::Depth),
    // Standard deviations.
    statistic("depth bias", 0.5, Suspect::DepthScale),
    statistic("depth scale", 1.0, Suspect::DepthScale),
    statistic("focal length", 0.5, Suspect::DepthScale),
    statistic("hand position", 1.0, Suspect::Hand),
    statistic("joint position", 1.0, Suspect::Hand),
    // Costs [nat].
    statistic("prior", 2.0, Suspect::Hand),
    statistic("tactile", 1.0, Suspect::Touch),
    statistic("penetration", 0.5, Suspect::Touch),
    statistic("rendering", 5.0, Suspect::Color),
    // Shares of the object's pixels.
    statistic("mask too small", 3e-3, Suspect::Mask),
    statistic("mask too large", 3e-3, Suspect::Mask),
];

impl Statistic {
    /// Whether it speaks against a pose: a mask may be wrong, and a pose still right.
    pub(super) fn counts(&self) -> bool {
        self.suspect != Suspect::Mask
    }
}

/// How well a pose fits in each of the ways, as logarithms; `None` where there is no such evidence.
#[derive(Clone, Debug, PartialEq)]
pub struct FitStatistics(pub(super) [Option<f64>; COUNT]);

/// What is known of a frame besides.
pub(in super::super) struct Known<'a> {
    /// What it says of calibrations.
    pub(in super::super) said: &'a State,
    /// How much it costs that calibrations differ from that \[nat\].
    pub(in super::super) cost: f64,
    /// How accurate they are, each by itself.
    pub(in super::super) sigmas: &'a PriorSettings,
    /// Noise of depth, where it can be measured.
    pub(in super::super) noise: Option<NoiseEstimate>,
    /// Whether depth on the object is evidence.
    pub(in super::super) with_depth: bool,
}

/// Fewest pixels that say something.
const FEWEST: usize = 30;

/// Added to the noise of single pixels that residuals are compared with \[m\].
const FINEST: f64 = 2e-4;

/// That noise where it cannot be measured \[m\].
const TYPICAL: f64 = 7e-4;

/// Statistics are at most so large.
const WORST: f64 = 1e12;

/// Width of patches of depth \[px\], and how many of its pixels a patch must have.
const PATCH: usize = 12;
const FULL: usize = 70;

/// How far a pixel of a patch counts at most \[m\].
const FAR: f64 = 15e-3;

impl FitStatistics {
    /// Of `point` in `frame`, of which this is `known`.
    pub(super) fn new(frame: &Frame<'_>, point: &Linearization, known: &Known<'_>) -> Self {
        let Known { said, cost, sigmas, noise, with_depth } = known;
        let costs = point.factors.iter().map(|factor| (factor.name, factor.cost));
        let mut found: BTreeMap<&str, f64> = costs.collect();
        let pixels = Pixels::new(frame, &point.state);
        // Where noise cannot be measured, depth is not where the object is: that must show.
        let unit = noise.as_ref().map_or(TYPICAL, |noise| noise.independent) + FINEST;
        let on_object = pixels.on_object(FEWEST);
        if *with_depth && on_object.len() >= FEWEST {
            found.extend(size(&on_object).map(|size| ("depth residual", size / unit)));
            found.extend(offset(&on_object).map(|offset| ("depth offset", offset / unit)));
            let of_patches = of_patches(&on_object).map(|rms| rms / unit);
            found.extend(of_patches.map(|rms| ("depth residual of patches", rms)));
        }
        let on_hand = pixels.on_hand();
        if on_hand.len() >= FEWEST {
            found.extend(size(&on_hand).map(|size| ("hand depth residual", size / unit)));
            found.extend(offset(&on_hand).map(|offset| ("hand depth offset", offset / unit)));
        }
        let correlated = noise.as_ref().filter(|_| *with_depth).map(|noise| noise.correlated);
        found.extend(correlated.map(|correlated| ("correlated depth noise", correlated)));
        let [lacks, exceeds] = pixels.mask_misfit();
        found.extend([("mask too small", lacks), ("mask too large", exceeds)]);
        found.extend(of_calibrations(frame.hand().is_some(), said, &point.state, sigmas));
        found.insert("prior", *cost);
        Self(STATISTICS.each_ref().map(|Statistic { name, negligible, .. }| {
            let value = found.get(name)?;
            // What is not a number fits as badly as can be.
            let value = if value.is_nan() { WORST } else { value.clamp(0.0, WORST) };
            Some((value + negligible).ln())
        }))
    }
}

/// By how many of their standard deviations the calibrations of `state` differ from those `said`.
fn of_calibrations(
    in_hand: bool,
    said: &State,
    state: &State,
    prior: &PriorSettings,
) -> impl Iterator<Item = (&'static str, f64)> + use<> {
    let off = state.calibration_deviation(said);
    let joints = said.joints.len();
    let [scale, bias, _, _, focal, _] = std::array::from_fn(|k| off[6 + joints + k].abs());
    let mut found = vec![
        ("depth scale", scale / prior.depth_scale),
        ("depth bias", bias / prior.depth_bias),
        ("focal length", focal / prior.focal_scale),
    ];
    if in_hand {
        found.push(("hand position", off.rows(0, 3).norm() / prior.hand_translation));
        if joints > 0 {
            found.push(("joint position", off.rows(6, joints).amax() / prior.joints));
        }
    }
    found.into_iter()
}

/// Root mean square of the mean residuals of patches; `None` if no patch is full.
fn of_patches(residuals: &[([usize; 2], f64)]) -> Option<f64> {
    let mut patches: BTreeMap<[usize; 2], (f64, usize)> = BTreeMap::new();
    for (place, residual) in residuals {
        let (sum, count) = patches.entry(place.map(|at| at / PATCH)).or_default();
        *sum += residual.clamp(-FAR, FAR);
        *count += 1;
    }
    let full = patches.values().filter(|(_, count)| *count > FULL);
    let squares: Vec<f64> = full.map(|(sum, count)| (sum / *count as f64).powi(2)).collect();
    (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

/// Median size of residuals.
fn size(residuals: &[([usize; 2], f64)]) -> Option<f64> {
    median(residuals.iter().map(|(_, residual)| residual.abs()))
}

/// Size of the median residual.
fn offset(residuals: &[([usize; 2], f64)]) -> Option<f64> {
    median(residuals.iter().map(|(_, residual)| *residual)).map(f64::abs)
}
