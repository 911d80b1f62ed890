//! One pixel, forward and reverse, whatever the mode.

use nalgebra::Vector3;

use super::sums::Sums;
use super::surface::Lit;
use super::visibility::{BlendAdjoint, PartAdjoint, Visibility, VisiblePart};
use crate::shading::{Chunks, Shader};

/// A rendered pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct RenderedPixel {
    pub(super) color: [f64; 3],
    pub(super) alpha: f64,
    pub(super) depth: f64,
    pub(super) normal: Vector3<f64>,
    pub(super) face: Option<usize>,
}

/// The adjoints of one pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct PixelAdjoint {
    pub(super) color: [f64; 3],
    pub(super) alpha: f64,
    pub(super) depth: f64,
    pub(super) normal: Vector3<f64>,
}

impl PixelAdjoint {
    #[inline]
    pub(super) fn is_zero(&self) -> bool {
        self.color == [0.0; 3]
            && self.alpha == 0.0
            && self.depth == 0.0
            && self.normal == Vector3::zeros()
    }
}

/// A pixel of a block: its index, column and row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) block: usize,
    pub(super) i: usize,
    pub(super) x: usize,
    pub(super) y: usize,
}

/// Room for the pixel at hand.
pub(super) struct Scratch<V: Visibility> {
    parts: Vec<VisiblePart>,
    by_parts: Vec<PartAdjoint>,
    trace: V::Trace,
}

impl<V: Visibility> Default for Scratch<V> {
    fn default() -> Self {
        Self { parts: Vec::new(), by_parts: Vec::new(), trace: V::Trace::default() }
    }
}

#[inline]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl<Sh: Shader> Lit<'_, Sh> {
    /// The pixel, or nothing where only the background is seen.
    #[inline]
    pub(super) fn pixel<V: Visibility>(
        &self,
        visibility: &V,
        place: Place,
        scratch: &mut Scratch<V>,
    ) -> Option<RenderedPixel> {
        let Scratch { parts, trace, .. } = scratch;
        let at = [place.x as f64, place.y as f64];
        parts.clear();
        let blend = visibility.trace(self.frame, place.block, place.i, at, trace, parts)?;
        let mut pixel = RenderedPixel {
            color: self.background.map(|c| blend.background * c),
            alpha: blend.alpha,
            depth: 0.0,
            normal: Vector3::zeros(),
            face: None,
        };
        for (k, part) in parts.iter().enumerate() {
            let center = blend.center.filter(|(center, _)| *center == k);
            if part.weight == 0.0 && center.is_none() {
                continue;
            }
            let sample = self.sample(part.face, part.b);
            (0..3).for_each(|c| pixel.color[c] += part.weight * sample.color[c]);
            if let Some((_, z)) = center {
                (pixel.depth, pixel.normal) = (z, sample.point.normal);
                pixel.face = Some(part.face);
            }
        }
        Some(pixel)
    }

    /// Carries the adjoints of a pixel back into `sums`.
    #[inline]
    pub(super) fn pixel_back<V: Visibility>(
        &self,
        visibility: &V,
        place: Place,
        by: &PixelAdjoint,
        scratch: &mut Scratch<V>,
        chunks: &Chunks,
        sums: &mut Sums,
    ) {
        let Scratch { parts, by_parts, trace } = scratch;
        let at = [place.x as f64, place.y as f64];
        parts.clear();
        let blend = visibility.trace(self.frame, place.block, place.i, at, trace, parts);
        let share = blend.map_or(1.0, |blend| blend.background);
        (0..3).for_each(|c| sums.background[c] += share * by.color[c]);
        let Some(blend) = blend else { return };
        by_parts.clear();
        for (k, part) in parts.iter().enumerate() {
            let is_center = blend.center.is_some_and(|(center, _)| center == k);
            let mut by_part = PartAdjoint { b: [0.0; 3], weight: 0.0 };
            if part.weight != 0.0 || is_center {
                let sample = self.sample(part.face, part.b);
                let by_normal = if is_center { by.normal } else { Vector3::zeros() };
                let by_color = by.color.map(|v| part.weight * v);
                by_part.b = self.sample_back(&sample, chunks, by_color, by_normal, sums);
                by_part.weight = dot(by.color, sample.color);
            }
            by_parts.push(by_part);
        }
        let background = dot(by.color, self.background);
        let by_blend = BlendAdjoint { background, alpha: by.alpha, depth: by.depth };
        visibility.trace_back(self.frame, trace, parts, by_parts, &by_blend, sums);
    }
}
