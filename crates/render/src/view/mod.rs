//! A posed object as a mode shows it, and who looks at it.

mod patch;
mod pixel;

use std::ops::Range;

pub(crate) use patch::{LANES, Lane, Patch, get, put};
pub(crate) use pixel::{Pixel, Row, Seen, scaled_sum};

use crate::projected::Region;

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

    /// Hands the pixels of one block to `sink`. A view that has a quicker way than pixel by pixel writes its own.
    fn feed<const DERIVATIVES: bool>(&self, block: usize, sink: &mut impl Sink<DERIVATIVES>) {
        let last = self.right().wrapping_sub(1);
        self.visit::<DERIVATIVES>(block, |x, y, seen| {
            sink.pixel(x, y, seen);
            if x == last {
                sink.end_row();
            }
        });
    }
}

/// Consumer of the pixels of a view.
///
/// A view hands over each pixel of a block once: all by [`pixel`](Self::pixel), or window by window in another way. There, an
/// empty pixel comes by [`nothing`](Self::nothing), if [that counts](Self::counts_if_empty). Any other begins with its depth. Unless it is
/// [hidden](Self::take_hidden), either [`covered`](Self::covered) and later a [`patch`](Self::patch) with the pixel follow, or
/// [`all_but_color`](Self::all_but_color) and later [`colors`](Self::colors) with it. `at` is the index of a pixel in the image, which is
/// as large as that of the view's camera.
pub(crate) trait Sink<const DERIVATIVES: bool> {
    /// A pixel, and what is seen there of the object, if anything.
    fn pixel(&mut self, x: usize, y: usize, seen: Option<Seen>);

    /// After the last pixel of a row, or of a row of a window.
    fn end_row(&mut self);

    /// The windows of a block, one after the other.
    fn windows(&self, block: &Region) -> Vec<Region>;

    /// Before the first pixel of a window.
    fn begin(&mut self, window: &Region);

    /// After the last pixel of a window.
    fn end(&mut self);

    /// True for each of these pixels that has to be handed over if it is empty.
    fn counts_if_empty(&self, at: Range<usize>) -> impl Iterator<Item = bool>;

    /// Nothing is seen here.
    fn nothing(&mut self, at: usize);

    /// The surface here has depth `z` \[m\]. True if something else hides it: then the pixel is done.
    fn take_hidden(&mut self, at: usize, z: f32) -> bool;

    /// The object covers this pixel, whose values come in a patch.
    fn covered(&mut self, at: usize);

    /// Pixels that it covers.
    fn patch(&mut self, patch: &Patch);

    /// Values of this pixel, but for its color.
    fn all_but_color(&mut self, at: usize, seen: &Seen);

    /// The colors of such pixels.
    fn colors(&mut self, patch: &Patch);
}
