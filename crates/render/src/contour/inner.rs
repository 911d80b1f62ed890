//! Inner contours: where the object hides farther parts of itself.

use glam::Vec2;

use super::outline::Piece;
use crate::projected::Projected;
use crate::raster::Visible;

/// Depth steps below this share of the model's radius are folds of the surface, not contours.
pub(crate) const LEAST_STEP: f32 = 0.02;

/// A piece of a visible inner contour.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Inner {
    pub(crate) piece: Piece,
    /// The pixel next to it on the far side, the face seen there and its 1/Z \[1/m\].
    pub(crate) behind: (Vec2, u32, f32),
    /// Half-way between the near and the far surface \[m\].
    pub(crate) split: f32,
}

/// Picks the visible inner contours among silhouette pieces that are not part of the outline: the surface seen one
/// pixel outside is farther than the edge by more than `least` \[m\], and one pixel inside it is not.
///
/// `least` is given the faces at the edge and outside. It is None for those of different objects, whose border is a
/// contour whatever the step (they may touch there), if it is the edge's own object that is seen inside.
pub(crate) fn inner_contours(
    projected: &Projected,
    visible: &[Visible],
    pieces: Vec<Piece>,
    least: impl Fn(u32, u32) -> Option<f32>,
) -> Vec<Inner> {
    let select = |piece: Piece| {
        let t = piece.middle();
        let face = projected.faces[piece.face as usize];
        let [wa, wb] = piece.corners.map(|c| projected.screen[face[c as usize] as usize].z);
        let z = 1.0 / (wa + t * (wb - wa));
        let beside = |distance: f32| Visible::seen(visible, piece.at(t) + distance * piece.outward);
        let (behind, front) = (beside(1.0)?, beside(-1.0)?);
        let step = 1.0 / behind.inverse_z - z;
        let split = z + 0.5 * step;
        let shown = match least(piece.face, behind.face) {
            Some(least) => step > least && 1.0 / front.inverse_z < split,
            None => least(piece.face, front.face).is_some(),
        };
        let behind = (behind.at, behind.face, behind.inverse_z);
        shown.then_some(Inner { piece, behind, split })
    };
    pieces.into_iter().filter_map(select).collect()
}
