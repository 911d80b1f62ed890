//! Values of a pixel that shows the posed object, in either mode.

/// A derivative by the twist (translation, rotation).
pub(crate) type Row = [f32; 6];

/// `p a + q b`.
#[inline(always)]
pub(crate) fn scaled_sum(p: f32, a: &Row, q: f32, b: &Row) -> Row {
    std::array::from_fn(|i| p * a[i] + q * b[i])
}

/// Color and coverage of a pixel after blending with the black background, the depth of the surface there, and their
/// derivatives by the twist.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pixel {
    /// α C.
    pub(crate) color: [f32; 3],
    /// α: one inside, one half on the outline, zero outside.
    pub(crate) coverage: f32,
    /// Z of the surface, or outside of the nearest outline point \[m\].
    pub(crate) z: f32,
    /// Weight of the depth here: one inside, falling to zero at the outline, where depth says little.
    pub(crate) depth_weight: f32,
    pub(crate) color_rows: [Row; 3],
    pub(crate) coverage_row: Row,
    pub(crate) z_row: Row,
    pub(crate) depth_weight_row: Row,
}

impl Pixel {
    /// Multiplies a color that is not blended yet by the coverage.
    #[inline(always)]
    pub(crate) fn fade<const DERIVATIVES: bool>(&mut self) {
        for (color, row) in self.color.iter_mut().zip(&mut self.color_rows) {
            if DERIVATIVES {
                *row = scaled_sum(self.coverage, row, *color, &self.coverage_row);
            }
            *color *= self.coverage;
        }
    }
}

/// A pixel with what kind of pixel it is.
pub(crate) struct Seen {
    pub(crate) pixel: Pixel,
    /// A face covers the pixel's center.
    pub(crate) hit: bool,
    /// The center lies within the contour band.
    pub(crate) near_outline: bool,
}
