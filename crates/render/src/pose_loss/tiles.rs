//! Sums by tiles of the image.

use std::ops::Range;

use super::loss::Linearized;
use super::sums::Sums;

/// Share of one square tile of the image in a loss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tile {
    /// How many tiles are left of it.
    pub column: usize,
    /// How many tiles are above it.
    pub row: usize,
    /// Its share of the loss, with derivatives by a twist of what it shows alone.
    pub at: Linearized,
}

/// How an image is cut into square tiles, from its upper left corner on.
#[derive(Clone, Copy)]
pub(super) struct Tiling {
    side: usize,
}

impl Tiling {
    /// One tile for all.
    pub(super) const WHOLE: Self = Self { side: usize::MAX };

    /// Tiles of `side` pixels, at least one.
    pub(super) fn new(side: usize) -> Self {
        Self { side: side.max(1) }
    }

    /// The parts of `range`, of columns or of rows, that lie in one tile each.
    pub(super) fn cut(self, range: Range<usize>) -> impl Iterator<Item = Range<usize>> {
        let mut from = range.start;
        std::iter::from_fn(move || {
            let to = (from / self.side + 1).saturating_mul(self.side).min(range.end);
            let part = from..to;
            from = to;
            (!part.is_empty()).then_some(part)
        })
    }
}

/// Sums over the pixels of some tiles.
pub(super) struct TileSums {
    pub(super) tiling: Tiling,
    /// Column and row of a tile, and its sums.
    sums: Vec<([usize; 2], Sums)>,
}

impl TileSums {
    pub(super) fn new(tiling: Tiling) -> Self {
        Self { tiling, sums: Vec::new() }
    }

    /// The place of the sums of the tile that has pixel (x, y).
    pub(super) fn place(&mut self, x: usize, y: usize) -> usize {
        let tile = [x / self.tiling.side, y / self.tiling.side];
        let known = self.sums.iter().position(|(other, _)| *other == tile);
        known.unwrap_or_else(|| {
            self.sums.push((tile, Sums::new()));
            self.sums.len() - 1
        })
    }

    /// The sums at a place.
    #[inline]
    pub(super) fn at(&mut self, place: usize) -> &mut Sums {
        &mut self.sums[place].1
    }
}

impl IntoIterator for TileSums {
    type Item = ([usize; 2], Sums);
    type IntoIter = std::vec::IntoIter<Self::Item>;

    fn into_iter(self) -> Self::IntoIter {
        self.sums.into_iter()
    }
}
