//! The pixels of a window of a block of rows, the quick way: those inside faces many at a time, and the colors of the others likewise.

use super::contours::ContourView;
use super::lanes::{Blended, Waiting};
use super::near::Bands;
use crate::projected::Region;
use crate::raster::MISS;
use crate::view::Sink;

/// Hands the pixels of a window of one block to a sink.
pub(super) struct Walk<'a, const DERIVATIVES: bool, S> {
    view: &'a ContourView<'a>,
    bands: &'a Bands<'a>,
    sink: &'a mut S,
    waiting: Waiting,
    blended: Blended,
}

impl<'a, const DERIVATIVES: bool, S: Sink<DERIVATIVES>> Walk<'a, DERIVATIVES, S> {
    pub(super) fn new(view: &'a ContourView, bands: &'a Bands<'a>, sink: &'a mut S) -> Self {
        Self { view, bands, sink, waiting: Waiting::new(), blended: Blended::new() }
    }

    /// The pixels of `window`; `clear` are all of the block that are in no band.
    pub(super) fn run(&mut self, window: &Region, clear: &[bool]) {
        self.sink.begin(window);
        let visible = self.bands.visible;
        let (width, whole) = (window.width(), &visible.region);
        // Columns of a row's pixels inside faces, and of the others that may count.
        let (mut inside, mut others) = (vec![0; width], vec![0; width]);
        for y in window.y0..window.y1 {
            let first = (y - whole.y0) * whole.width() + window.x0 - whole.x0;
            let row = first..first + width;
            let start = self.in_image(window.x0, y);
            let counting = self.sink.counts_if_empty(start..start + width);
            let faces = visible.face[row.clone()].iter();
            let (mut inside_count, mut other_count) = (0, 0);
            // Without branches, which would be mispredicted: kinds alternate along a row.
            for (column, ((face, clear), counts)) in
                faces.zip(&clear[row.clone()]).zip(counting).enumerate()
            {
                let hit = *face != MISS;
                inside[inside_count] = column;
                inside_count += usize::from(hit & clear);
                others[other_count] = column;
                other_count += usize::from(!clear | (!hit & counts));
            }
            self.add_inside([window.x0, y], row.start, &inside[..inside_count]);
            self.add_others([window.x0, y], &others[..other_count]);
            self.sink.end_row();
        }
        self.waiting.flush(&self.view.scene, self.sink);
        self.blended.flush(self.sink);
        self.sink.end();
    }

    /// Index of pixel (x, y) in the image.
    #[inline]
    fn in_image(&self, x: usize, y: usize) -> usize {
        y * self.view.size[0] + x
    }

    /// Pixels inside faces, in `columns` from pixel (`left`, `y`) on, which has index `first` in the block.
    #[inline]
    fn add_inside(&mut self, [left, y]: [usize; 2], first: usize, columns: &[usize]) {
        let visible = self.bands.visible;
        for column in columns {
            let (i, x) = (first + column, left + column);
            let (z, at) = (1.0 / visible.inverse_z[i], self.in_image(x, y));
            if self.sink.take_hidden(at, z) {
                continue;
            }
            self.sink.covered(at);
            if self.waiting.push((x as f32, y as f32), at, visible.face[i], z) {
                self.waiting.flush(&self.view.scene, self.sink);
            }
        }
    }

    /// Pixels at contours or that show nothing, in `columns` from pixel (`left`, `y`) on.
    #[inline]
    fn add_others(&mut self, [left, y]: [usize; 2], columns: &[usize]) {
        for column in columns {
            let x = left + column;
            let at = self.in_image(x, y);
            let (place, found) = self.bands.found(x, y);
            let Some(seen) = self.view.seen::<DERIVATIVES>(place, found) else {
                self.sink.nothing(at);
                continue;
            };
            if self.sink.take_hidden(at, seen.pixel.z) {
                continue;
            }
            self.sink.all_but_color(at, &seen);
            if self.blended.push::<DERIVATIVES>(at, &seen.pixel) {
                self.blended.flush(self.sink);
            }
        }
    }
}
