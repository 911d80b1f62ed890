//! Drawing one face of some size: pixels of a row side by side.

use super::{Visible, centres, span};
use crate::projected::{Projected, signed_area};

/// Pixels side by side.
const LANES: usize = 8;

impl Visible {
    /// Draws one face, with a higher index than all before, where it is nearer than what is there; of equals the first
    /// stays.
    #[inline(always)]
    pub(super) fn draw(&mut self, projected: &Projected, face: u32) {
        let corners @ [a, b, c] = projected.corners(face as usize);
        let region = self.region;
        let Some((y0, y1)) = centres(span(a[1], b[1], c[1]), region.y0, region.y1) else { return };
        let Some((x0, x1)) = centres(span(a[0], b[0], c[0]), region.x0, region.x1) else { return };
        let scale = 1.0 / signed_area(&corners);
        let width = region.width();
        for y in y0..=y1 {
            let row = (y - region.y0) * width;
            let (inverse_z, faces) =
                (&mut self.inverse_z[row..row + width], &mut self.face[row..row + width]);
            let mut x = x0 - region.x0;
            let end = x1 - region.x0;
            while x <= end {
                // Faces next to each other read and write the same whole chunks: the processor passes on what was just
                // written only as it was written. (The last chunk of a row overlaps the one before.)
                let first = (x / LANES * LANES).min(width.saturating_sub(LANES));
                let start = (first + region.x0, y);
                let (inverse_z, faces) = (&mut inverse_z[first..], &mut faces[first..]);
                match (inverse_z.first_chunk_mut(), faces.first_chunk_mut()) {
                    (Some(z), Some(f)) => {
                        draw_chunk::<LANES>(&corners, scale, start, face, z, f);
                    }
                    // The whole block is narrow.
                    _ => {
                        for (x, (z, f)) in inverse_z.iter_mut().zip(faces).enumerate() {
                            let start = (start.0 + x, y);
                            let (z, f) = (std::array::from_mut(z), std::array::from_mut(f));
                            draw_chunk::<1>(&corners, scale, start, face, z, f);
                        }
                    }
                }
                x = first + LANES;
            }
        }
    }
}

/// Draws a face at `N` pixels from (x, y) on, where it is nearer than what is there.
#[inline(always)]
fn draw_chunk<const N: usize>(
    [a, b, c]: &[[f32; 3]; 3],
    scale: f32,
    (x, y): (usize, usize),
    face: u32,
    inverse_z: &mut [f32; N],
    faces: &mut [u32; N],
) {
    let (px, py) = (x as f32, y as f32);
    let (ay, by, cy) = (a[1] - py, b[1] - py, c[1] - py);
    for j in 0..N {
        let px = px + j as f32;
        let (ax, bx, cx) = (a[0] - px, b[0] - px, c[0] - px);
        // The other face of an edge has exactly the opposite number, so that none of its pixels is lost.
        let e0 = (bx * cy - by * cx) * scale;
        let e1 = (cx * ay - cy * ax) * scale;
        let e2 = (ax * by - ay * bx) * scale;
        let here = e0 * a[2] + e1 * b[2] + e2 * c[2];
        let covered = (e0 >= 0.0) & (e1 >= 0.0) & (e2 >= 0.0);
        let here = if covered { here } else { 0.0 };
        // Maxima, as a choice between new and old would become a masked store, which is slow on some processors. (A
        // missing face counts as zero.)
        let next = if here > inverse_z[j] { face + 1 } else { 0 };
        faces[j] = faces[j].wrapping_add(1).max(next).wrapping_sub(1);
        inverse_z[j] = inverse_z[j].max(here);
    }
}
