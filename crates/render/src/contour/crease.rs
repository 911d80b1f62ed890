//! Creases: edges in view at which the color of the surface jumps, because normals, texture coordinates or colors do.

use glam::Vec2;

use super::outline::{Foot, Piece};
use super::scene::ContourScene;
use crate::model::{Edge, NONE};
use crate::projected::{Projected, Region, edge_functions};
use crate::raster::{SeenFace, Visible};
use crate::view::Pixel;

/// A piece of a visible crease, directed as the one of its two faces runs through it that `outward` points away from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crease {
    pub(crate) piece: Piece,
    /// The face beyond, and its corners at the start and the end of the edge.
    pub(crate) other: u32,
    pub(crate) other_corners: [u8; 2],
}

/// The visible pieces of `edges` that come within `margin` pixels of `region`.
///
/// A piece shows unless another surface is more than `least` \[m\] nearer at its middle, for the given face.
pub(crate) fn creases<'a>(
    projected: &Projected,
    visible: &[Visible],
    edges: impl Iterator<Item = &'a Edge>,
    region: &Region,
    margin: f32,
    least: impl Fn(u32) -> f32,
) -> Vec<Crease> {
    let mut out = Vec::new();
    for edge in edges {
        let facing = projected.facing[edge.face as usize];
        if edge.other == NONE || facing == 0 || facing != projected.facing[edge.other as usize] {
            continue;
        }
        let [a, b] = edge.vertices.map(|v| projected.screen[v as usize]);
        let ends = [a, b].map(|end| end.truncate());
        let whole = Piece::whole(edge.face, edge.corner, ends, facing);
        for piece in whole.into_iter().flat_map(|whole| whole.cut(region, margin)) {
            let t = piece.middle();
            let z = 1.0 / (a.z + t * (b.z - a.z));
            let nearest = Visible::seen(visible, piece.at(t));
            if nearest
                .is_none_or(|SeenFace { inverse_z, .. }| 1.0 / inverse_z > z - least(edge.face))
            {
                // The other face runs through the edge the other way.
                let other_corners = [(edge.other_corner + 1) % 3, edge.other_corner];
                out.push(Crease { piece, other: edge.other, other_corners });
            }
        }
    }
    out
}

impl Crease {
    /// Edge as the face beyond has it.
    pub(crate) fn reversed(&self) -> Piece {
        Piece { face: self.other, corners: self.other_corners, ..self.piece }
    }

    /// On which side of the crease a pixel is (−1 that of the piece's own face, 1 the other), given its foot on the
    /// crease; and whether the surface that it shows, of inverse depth `inverse_z`, is the one with the crease.
    #[inline]
    pub(crate) fn side(
        &self,
        projected: &Projected,
        at: Vec2,
        foot: &Foot,
        inverse_z: f32,
    ) -> Option<f32> {
        let across = foot.offset.dot(self.piece.outward);
        let (side, face) = if across > 0.0 { (1.0, self.other) } else { (-1.0, self.piece.face) };
        // 1/Z is linear in the image: that of the face's plane, continued to the pixel.
        let corners = projected.corners(face as usize);
        let e = edge_functions(corners, at);
        let sum = e[0] * corners[0].z + e[1] * corners[1].z + e[2] * corners[2].z;
        let plane = sum / (e[0] + e[1] + e[2]);
        ((plane - inverse_z).abs() < SAME * inverse_z).then_some(side)
    }
}

/// Depths that differ by less than this share may lie on one surface.
const SAME: f32 = 0.01;

impl ContourScene<'_> {
    /// Blends in what lies beyond a crease, at a pixel that shows `own` of this
    /// inverse depth.
    ///
    /// The color of the surface jumps at the crease by that of the foot, so the pixel gains as much of the jump as its
    /// distance says.
    pub(crate) fn soften<const DERIVATIVES: bool>(
        &self,
        at: Vec2,
        inverse_z: f32,
        own: &mut Pixel,
        crease: &Crease,
    ) {
        let foot = crease.piece.foot(at);
        let projected = &self.posed.projected;
        let Some(side) = crease.side(projected, at, &foot, inverse_z) else { return };
        let (here, beyond) = (crease.piece, crease.reversed());
        let (here, beyond) = if side < 0.0 { (here, beyond) } else { (beyond, here) };
        let here = self.at_foot::<DERIVATIVES>(&here, &foot);
        let beyond = self.at_foot::<DERIVATIVES>(&beyond, &foot);
        let step = self.drawing.step;
        let (share, slope) = step.at(foot.distance_squared.sqrt(), crease.piece.outward);
        let jump = [0, 1, 2].map(|k| beyond.color[k] - here.color[k]);
        own.color.iter_mut().zip(jump).for_each(|(color, jump)| *color += share * jump);
        if DERIVATIVES {
            let ds = self.distance_row(&crease.piece, &foot, side);
            for (k, jump) in jump.into_iter().enumerate() {
                let step = side * slope * jump;
                let rows = beyond.color_rows[k].iter().zip(&here.color_rows[k]).zip(&ds);
                for (own, ((beyond, here), ds)) in own.color_rows[k].iter_mut().zip(rows) {
                    *own += share * (beyond - here) + step * ds;
                }
            }
        }
    }
}
