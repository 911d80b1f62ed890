//! Visibility as a mode gives it to the code that all modes share: the places on faces that a pixel shows, with their weights.

use super::frame::Frame;
use super::sums::Sums;
use crate::projected::Region;

/// A place on a face that a pixel shows.
#[derive(Clone, Copy, Debug)]
pub(super) struct VisiblePart {
    pub(super) face: usize,
    /// Perspective-correct barycentric coordinates, unless the mode's options say otherwise.
    pub(super) b: [f64; 3],
    /// Its weight in the pixel's color. Parts of weight zero are not lit.
    pub(super) weight: f64,
}

/// Blend of the parts of a pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct PixelBlend {
    /// Weight of the background's color.
    pub(super) background: f64,
    pub(super) alpha: f64,
    /// The part at the pixel's center (which gives the normal and the face) and its depth \[m\].
    pub(super) center: Option<(usize, f64)>,
}

/// Derivatives of a loss by a [`VisiblePart`].
#[derive(Clone, Copy, Debug)]
pub(super) struct PartAdjoint {
    pub(super) b: [f64; 3],
    pub(super) weight: f64,
}

/// Derivatives of a loss by a [`PixelBlend`].
#[derive(Clone, Copy, Debug)]
pub(super) struct BlendAdjoint {
    pub(super) background: f64,
    pub(super) alpha: f64,
    pub(super) depth: f64,
}

/// The decisions of a mode about a scene, and the smooth functions that they leave.
///
/// Which faces and contours count at a pixel is decided once, in f32; weights and places are functions of corners and
/// intrinsics in f64.
pub(super) trait Visibility: Sync {
    /// Intermediate values of a pixel for its reverse derivative; one serves many pixels, so that its memory is reused.
    type Trace: Default;

    /// The pixels of each block of rows.
    fn regions(&self) -> Vec<Region>;

    /// Appends the parts of pixel `i` (row-major) of a block, which lies at column and row `at`. Nothing where only the
    /// background is seen.
    fn trace(
        &self,
        frame: &Frame,
        block: usize,
        i: usize,
        at: [f64; 2],
        trace: &mut Self::Trace,
        parts: &mut Vec<VisiblePart>,
    ) -> Option<PixelBlend>;

    /// Carries the derivatives by the parts of the traced pixel and by their blend back into `sums`.
    fn trace_back(
        &self,
        frame: &Frame,
        trace: &Self::Trace,
        parts: &[VisiblePart],
        by_parts: &[PartAdjoint],
        by: &BlendAdjoint,
        sums: &mut Sums,
    );
}
