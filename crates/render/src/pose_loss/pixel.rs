//! What a pixel shows of the posed object, in either mode.

use super::residuals::Residuals;
use super::tiles::TileSums;

/// A derivative by the twist (translation, rotation).
pub(crate) type Row = [f32; 6];

/// `p a + q b`.
#[inline(always)]
pub(crate) fn scaled_sum(p: f32, a: &Row, q: f32, b: &Row) -> Row {
    std::array::from_fn(|i| p * a[i] + q * b[i])
}

/// What a pixel shows of the object: color and coverage after blending with the black background, the
/// depth of the surface there, and their derivatives by the twist.
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

/// A pixel with what kind of pixel it is.
pub(crate) struct Seen {
    pub(crate) pixel: Pixel,
    /// A face covers the pixel's center.
    pub(crate) hit: bool,
    /// The center lies within the contour band.
    pub(crate) near_outline: bool,
}

/// A posed, lit model as a mode shows it.
pub(crate) trait View: Sync {
    /// The number of blocks of rows, each a task of its own.
    fn blocks(&self) -> usize;

    /// One past the last column visited.
    fn right(&self) -> usize;

    /// Calls `each` for every pixel of one block, row by row, with its column and row and what is seen of the object
    /// there, if anything.
    fn visit<const DERIVATIVES: bool>(
        &self,
        block: usize,
        each: impl FnMut(usize, usize, Option<Seen>),
    );

    /// Calls `each` for every pixel of one block whose center shows a face, with its column and row, the face (of the
    /// model's faces drawn) and the unit normal there (camera frame).
    fn faces(&self, block: usize, each: impl FnMut(usize, usize, u32, [f32; 3]));

    /// Adds the residuals of one block. A view that has a quicker way than pixel by pixel writes its own.
    fn sum<const DERIVATIVES: bool>(
        &self,
        block: usize,
        residuals: &Residuals,
        sums: &mut TileSums,
    ) {
        let last = self.right().wrapping_sub(1);
        let width = residuals.target.camera.width;
        self.visit::<DERIVATIVES>(block, |x, y, seen| {
            residuals.add::<DERIVATIVES>(sums.at(x, y), y * width + x, seen);
            if DERIVATIVES && x == last {
                sums.end_row();
            }
        });
    }
}
