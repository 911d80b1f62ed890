//! Face at each pixel of a block of rows, and the contours and creases within whose bands the pixel lies.

use super::contours::ContourView;
use super::crease::Crease;
use super::inner::Inner;
use super::outline::{Band, Piece};
use crate::model::NONE;
use crate::projected::Region;
use crate::raster::{MISS, Visible};

/// A pixel, and the outline near it and its neighbors.
#[derive(Clone, Copy)]
pub(super) struct NearPlace<'a> {
    pub(super) x: usize,
    pub(super) y: usize,
    pub(super) band: &'a Band,
    /// The pixel's index in the band.
    pub(super) at: usize,
}

/// Face and contours at a pixel.
#[derive(Clone, Copy)]
pub(super) enum Found<'a> {
    Nothing,
    /// The object is not here, but its outline is near.
    Outside(&'a Piece),
    /// A face, far from contours.
    Face(NearHit),
    /// A face near contours or a crease.
    Border(NearHit, Near<'a>),
}

/// The contours and the crease within whose bands a pixel lies.
#[derive(Clone, Copy)]
pub(super) struct Near<'a> {
    pub(super) edge: Option<&'a Piece>,
    pub(super) inner: Option<&'a Inner>,
    pub(super) crease: Option<&'a Crease>,
}

/// A visible face.
#[derive(Clone, Copy)]
pub(super) struct NearHit {
    pub(super) face: u32,
    pub(super) inverse_z: f32,
}

/// The bands of one block of rows. Its pixels are counted row by row.
pub(super) struct Bands<'a> {
    view: &'a ContourView<'a>,
    pub(super) visible: &'a Visible,
    outline: Band,
    /// The first pixel's index in the outline's band, which has a row more above and below where slopes look at neighbors.
    start: usize,
    /// Bands of inner contours and of creases, if there are any.
    inner: Option<Band>,
    crease: Option<Band>,
}

impl<'a> Bands<'a> {
    pub(super) fn new(view: &'a ContourView, block: usize) -> Self {
        let visible = &view.visible[block];
        let width = view.scene.drawing.step.reach();
        let rows = visible.region;
        // Pixels over whose area slopes are taken look at their neighbors.
        let beyond = usize::from(view.scene.drawing.footprint);
        let around = Region { y0: rows.y0.saturating_sub(beyond), y1: rows.y1 + beyond, ..rows };
        // A contour between a pixel and the next is less than a pixel away.
        let inner_width = if view.scene.drawing.footprint { width.max(1.0) } else { width };
        let inner_pieces = view.inner.iter().map(|inner| &inner.piece);
        let crease_pieces = view.creases.iter().map(|crease| &crease.piece);
        Self {
            view,
            visible,
            outline: Band::new(view.pieces.iter(), &around, width),
            start: (rows.y0 - around.y0) * rows.width(),
            inner: (!view.inner.is_empty()).then(|| Band::new(inner_pieces, &rows, inner_width)),
            crease: (!view.creases.is_empty()).then(|| Band::new(crease_pieces, &rows, width)),
        }
    }

    /// True for each pixel in no band.
    pub(super) fn clear(&self) -> Vec<bool> {
        let count = self.visible.face.len();
        let outline = &self.outline.piece[self.start..self.start + count];
        let mut clear: Vec<bool> = outline.iter().map(|piece| *piece == NONE).collect();
        for band in [&self.inner, &self.crease].into_iter().flatten() {
            clear.iter_mut().zip(&band.piece).for_each(|(clear, piece)| *clear &= *piece == NONE);
        }
        clear
    }

    /// Face and contours at pixel (x, y) of the image, within the block.
    #[inline]
    pub(super) fn found(&self, x: usize, y: usize) -> (NearPlace<'_>, Found<'a>) {
        let Region { x0, y0, .. } = self.visible.region;
        let i = (y - y0) * self.visible.region.width() + x - x0;
        let place = NearPlace { x, y, band: &self.outline, at: self.start + i };
        let index_in =
            |band: &Option<Band>| band.as_ref().map_or(NONE, |band| band.piece[i]) as usize;
        let edge = self.view.pieces.get(self.outline.piece[place.at] as usize);
        let inner = self.view.inner.get(index_in(&self.inner));
        let crease = self.view.creases.get(index_in(&self.crease));
        let hit = NearHit { face: self.visible.face[i], inverse_z: self.visible.inverse_z[i] };
        let found = match (hit.face, edge, inner, crease) {
            (MISS, None, ..) => Found::Nothing,
            (MISS, Some(piece), ..) => Found::Outside(piece),
            (_, None, None, None) => Found::Face(hit),
            _ => Found::Border(hit, Near { edge, inner, crease }),
        };
        (place, found)
    }
}
