//! A gain and an offset of each color channel that change with the pose, and are eliminated.
//!
//! For each pose the loss is minimized over them. By the envelope theorem the gradient of that minimum is the plain one of
//! the corrected picture, and its Gauss–Newton matrix is the Schur complement of the corrections in the joint normal
//! equations.

use nalgebra::{Matrix2, Matrix6, Matrix6x2, Vector2};
use rayon::prelude::*;

use super::pixel::{Pixel, Seen, View, scaled_sum};
use super::residuals::Residuals;
use super::sums::Sums;

/// A correction of the rendered object's colors: `gain * color + offset` in each channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affine {
    /// Factor of each channel, at least 0: no light turns bright into dark.
    pub gain: [f64; 3],
    /// Added to each channel.
    pub offset: [f64; 3],
}

impl Default for Affine {
    /// No correction.
    fn default() -> Self {
        Self { gain: [1.0; 3], offset: [0.0; 3] }
    }
}

/// Pull towards no correction, relative to the pixels' own: decides between gain and offset for an object of one color.
const PULL: f64 = 1e-9;

/// Rounds of reweighting with a robust kernel at most, and the change of a correction that ends them.
const ROUNDS: usize = 20;
const SETTLED: f64 = 1e-6;

/// Sums of the loss minimized over the correction.
pub(crate) struct Corrected {
    pub(crate) sums: Sums,
    pub(crate) affine: Affine,
    /// What eliminating the correction takes from Σ w JᵀJ.
    pub(crate) reduction: Matrix6<f64>,
}

/// The normal equations of one channel: Σ w of the squares and products of what gain and offset multiply (color and
/// coverage), of these with the observed color, and of these with the rows.
#[derive(Clone, Copy, Default)]
struct Channel {
    square: Matrix2<f64>,
    right: Vector2<f64>,
    cross: Matrix6x2<f64>,
}

type Channels = [Channel; 3];

/// Color and coverage of a pixel before the correction.
type Raw = ([f32; 3], f32);

fn merged(all: Vec<Channels>) -> Channels {
    let mut total = Channels::default();
    for part in all {
        for (a, b) in total.iter_mut().zip(part) {
            a.square += b.square;
            a.right += b.right;
            a.cross += b.cross;
        }
    }
    total
}

impl Affine {
    fn apply<const DERIVATIVES: bool>(&self, pixel: &mut Pixel) {
        for k in 0..3 {
            let (gain, offset) = (self.gain[k] as f32, self.offset[k] as f32);
            pixel.color[k] = gain * pixel.color[k] + offset * pixel.coverage;
            if DERIVATIVES {
                pixel.color_rows[k] =
                    scaled_sum(gain, &pixel.color_rows[k], offset, &pixel.coverage_row);
            }
        }
    }
}

impl Residuals<'_> {
    /// Sums the residuals of a view under the correction that makes their cost least.
    pub(crate) fn corrected<const DERIVATIVES: bool>(&self, view: &impl View) -> Corrected {
        let affine = self.fit(view);
        let blocks: Vec<(Sums, Channels)> = (0..view.blocks())
            .into_par_iter()
            .map(|block| self.block::<DERIVATIVES>(view, block, &affine))
            .collect();
        let mut sums = Sums::new();
        blocks.iter().for_each(|(part, _)| sums.merge(part));
        let mut reduction = Matrix6::zeros();
        let channels = merged(blocks.into_iter().map(|(_, channels)| channels).collect());
        for (channel, gain) in channels.iter().zip(affine.gain) {
            let mut square = pulled(&channel.square);
            let mut cross = channel.cross;
            if gain == 0.0 {
                // At its bound, and so no longer free.
                square[(0, 1)] = 0.0;
                square[(1, 0)] = 0.0;
                cross.column_mut(0).fill(0.0);
            }
            if let Some(inverse) = square.try_inverse() {
                reduction += cross * inverse * cross.transpose();
            }
        }
        Corrected { sums, affine, reduction }
    }

    fn block<const DERIVATIVES: bool>(
        &self,
        view: &impl View,
        block: usize,
        affine: &Affine,
    ) -> (Sums, Channels) {
        let mut sums = Sums::new();
        let mut channels = Channels::default();
        let width = self.target.camera.width;
        let last = view.right().wrapping_sub(1);
        view.visit::<DERIVATIVES>(block, |x, y, mut seen| {
            let at = y * width + x;
            if let Some(Seen { pixel, .. }) = &mut seen {
                let raw = (pixel.color, pixel.coverage);
                affine.apply::<DERIVATIVES>(pixel);
                if DERIVATIVES && !self.target.hides(at, pixel.z) {
                    self.add_channels::<true>(&mut channels, at, raw, pixel);
                }
            }
            self.add::<DERIVATIVES>(&mut sums, at, seen);
            if DERIVATIVES && x == last {
                sums.end_row();
            }
        });
        (sums, channels)
    }

    /// Index, color and coverage of the pixels that show the object, block by block.
    fn drawn(&self, view: &impl View) -> Vec<Vec<(usize, Raw)>> {
        let width = self.target.camera.width;
        let blocks = (0..view.blocks()).into_par_iter().map(|block| {
            let mut pixels = Vec::new();
            view.visit::<false>(block, |x, y, seen| {
                let at = y * width + x;
                if let Some(Seen { pixel, .. }) = seen
                    && !self.target.hides(at, pixel.z)
                {
                    pixels.push((at, (pixel.color, pixel.coverage)));
                }
            });
            pixels
        });
        blocks.collect()
    }

    /// The best correction: least squares in closed form, reweighted for a robust kernel.
    fn fit(&self, view: &impl View) -> Affine {
        let mut affine = Affine::default();
        if self.options.color_weight <= 0.0 {
            return affine;
        }
        let drawn = self.drawn(view);
        for _ in 0..ROUNDS {
            let blocks = drawn.par_iter().map(|pixels| {
                let mut channels = Channels::default();
                for (at, raw) in pixels {
                    let (color, coverage) = *raw;
                    let mut pixel = Pixel { color, coverage, ..Pixel::default() };
                    affine.apply::<false>(&mut pixel);
                    self.add_channels::<false>(&mut channels, *at, *raw, &pixel);
                }
                channels
            });
            let mut change = 0.0f64;
            for (k, channel) in merged(blocks.collect()).iter().enumerate() {
                let square = pulled(&channel.square);
                let pull = square - channel.square;
                let right = channel.right + pull * Vector2::new(1.0, 0.0);
                let Some(mut best) = square.try_inverse().map(|inverse| inverse * right) else {
                    continue;
                };
                if best[0] < 0.0 {
                    best = Vector2::new(0.0, right[1] / square[(1, 1)]);
                }
                if best.iter().all(|v| v.is_finite()) {
                    let new = (best[0], best[1]);
                    change = change.max((new.0 - affine.gain[k]).abs());
                    change = change.max((new.1 - affine.offset[k]).abs());
                    (affine.gain[k], affine.offset[k]) = new;
                }
            }
            if change < SETTLED || self.options.robust.is_square() {
                break;
            }
        }
        affine
    }

    /// Adds a pixel that is `raw` before, and `pixel` after the correction.
    fn add_channels<const DERIVATIVES: bool>(
        &self,
        channels: &mut Channels,
        at: usize,
        raw: Raw,
        pixel: &Pixel,
    ) {
        let observed = self.target.color[at];
        for (k, channel) in channels.iter_mut().enumerate() {
            let (_, weight) = self.options.robust.cost(pixel.color[k] - observed[k]);
            let weight = self.options.color_weight * f64::from(weight);
            let entry = Vector2::new(f64::from(raw.0[k]), f64::from(raw.1));
            channel.square += entry * entry.transpose() * weight;
            channel.right += entry * (weight * f64::from(observed[k]));
            if DERIVATIVES {
                for (i, v) in pixel.color_rows[k].iter().enumerate() {
                    let scaled = weight * f64::from(*v);
                    channel.cross[(i, 0)] += scaled * entry[0];
                    channel.cross[(i, 1)] += scaled * entry[1];
                }
            }
        }
    }
}

/// With the pull on the diagonal.
fn pulled(square: &Matrix2<f64>) -> Matrix2<f64> {
    square + Matrix2::identity() * (PULL * square.trace()).max(f64::MIN_POSITIVE)
}
