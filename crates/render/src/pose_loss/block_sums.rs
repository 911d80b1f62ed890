//! The sums of the residuals of a view, by tile.

use std::collections::BTreeMap;
use std::ops::Range;

use rayon::prelude::*;

use super::residuals::Residuals;
use super::sums::{LaneSums, Sums};
use super::tiles::{TileSums, Tiling};
use crate::projected::Region;
use crate::view::{Patch, Seen, Sink, View};

impl Residuals<'_> {
    /// Sums the residuals over the pixels of a view by tiles, block by block in parallel, added up in a fixed order.
    pub(super) fn by_tiles<const DERIVATIVES: bool>(
        &self,
        view: &impl View,
        tiling: Tiling,
    ) -> BTreeMap<[usize; 2], Sums> {
        let blocks: Vec<TileSums> = (0..view.blocks())
            .into_par_iter()
            .map(|block| {
                let mut sums = BlockSums::new(*self, tiling);
                view.feed::<DERIVATIVES>(block, &mut sums);
                sums.tiles
            })
            .collect();
        let mut total = BTreeMap::new();
        for (tile, sums) in blocks.into_iter().flatten() {
            total.entry(tile).or_insert_with(Sums::new).merge(&sums);
        }
        total
    }
}

/// Sums the residuals of one block of pixels.
struct BlockSums<'a> {
    residuals: Residuals<'a>,
    tiles: TileSums,
    /// Place of the tile at hand, and sums of its pixels side by side.
    tile: usize,
    lanes: LaneSums,
}

impl<'a> BlockSums<'a> {
    fn new(residuals: Residuals<'a>, tiling: Tiling) -> Self {
        Self { residuals, tiles: TileSums::new(tiling), tile: 0, lanes: LaneSums::new() }
    }
}

impl<const DERIVATIVES: bool> Sink<DERIVATIVES> for BlockSums<'_> {
    #[inline]
    fn pixel(&mut self, x: usize, y: usize, seen: Option<Seen>) {
        let at = y * self.residuals.target.camera.width + x;
        let tile = self.tiles.place(x, y);
        if tile != self.tile {
            // Its part of the row ends here.
            Sink::<DERIVATIVES>::end_row(self);
            self.tile = tile;
        }
        self.residuals.add::<DERIVATIVES>(self.tiles.at(self.tile), at, seen);
    }

    fn end_row(&mut self) {
        if DERIVATIVES {
            self.tiles.at(self.tile).end_row();
        }
    }

    fn windows(&self, block: &Region) -> Vec<Region> {
        let tiling = self.tiles.tiling;
        let window = |rows: Range<usize>, columns: Range<usize>| Region {
            x0: columns.start,
            x1: columns.end,
            y0: rows.start,
            y1: rows.end,
        };
        let row = |rows: Range<usize>| {
            tiling.cut(block.x0..block.x1).map(move |columns| window(rows.clone(), columns))
        };
        tiling.cut(block.y0..block.y1).flat_map(row).collect()
    }

    fn begin(&mut self, window: &Region) {
        self.tile = self.tiles.place(window.x0, window.y0);
        self.lanes = LaneSums::new();
    }

    fn end(&mut self) {
        self.tiles.at(self.tile).absorb(&self.lanes);
    }

    #[inline]
    fn counts_if_empty(&self, at: Range<usize>) -> impl Iterator<Item = bool> {
        self.residuals.missed_if_empty(at)
    }

    #[inline]
    fn nothing(&mut self, at: usize) {
        self.residuals.add_nothing(self.tiles.at(self.tile), at);
    }

    #[inline]
    fn take_hidden(&mut self, at: usize, z: f32) -> bool {
        self.residuals.hidden(self.tiles.at(self.tile), at, z)
    }

    #[inline]
    fn covered(&mut self, at: usize) {
        self.residuals.count_covered(self.tiles.at(self.tile), at);
    }

    #[inline(always)]
    fn patch(&mut self, patch: &Patch) {
        self.residuals.add_patch::<DERIVATIVES>(&mut self.lanes, patch);
    }

    #[inline]
    fn all_but_color(&mut self, at: usize, seen: &Seen) {
        self.residuals.add_but_color::<DERIVATIVES>(self.tiles.at(self.tile), at, seen);
    }

    #[inline(always)]
    fn colors(&mut self, patch: &Patch) {
        self.residuals.add_colors::<DERIVATIVES>(&mut self.lanes, patch);
    }
}
