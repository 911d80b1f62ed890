//! The faces that may count in each square of the image.

use super::face::Face;
use super::run::RUN;
use crate::projected::Region;

/// The faces that may count in each tile of [`RUN`] by [`RUN`] pixels of a region, in ascending order.
pub(crate) struct FaceTiles {
    columns: usize,
    faces: Vec<Vec<u32>>,
}

impl FaceTiles {
    pub(crate) fn new(faces: &[Face], region: &Region) -> Self {
        let columns = region.width().div_ceil(RUN);
        let mut tiles = vec![Vec::new(); columns * (region.y1 - region.y0).div_ceil(RUN)];
        for (index, face) in faces.iter().enumerate() {
            let [left, right, top, bottom] = face.bounds;
            for y in between(top, bottom, region.y0, region.y1) {
                for x in between(left, right, region.x0, region.x1) {
                    tiles[y * columns + x].push(index as u32);
                }
            }
        }
        Self { columns, faces: tiles }
    }

    /// The tiles of each [`RUN`] rows of pixels, from left to right.
    pub(crate) fn rows(&self) -> std::slice::Chunks<'_, Vec<u32>> {
        self.faces.chunks(self.columns.max(1))
    }
}

/// The tiles (of [`RUN`] pixels from `first` on) that lie between two places, if any.
fn between(low: f32, high: f32, first: usize, end: usize) -> std::ops::Range<usize> {
    if first >= end || high < first as f32 || low >= end as f32 {
        return 0..0;
    }
    // Casts to integers saturate.
    let tile = |v: f32| (v as usize).clamp(first, end - 1).saturating_sub(first) / RUN;
    tile(low)..tile(high) + 1
}
