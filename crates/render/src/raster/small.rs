//! Drawing many faces: those of a fine mesh cover hardly a pixel each, so they are treated side by side, without branches.

use glam::vec3;
use pulp::{Arch, NullaryFnOnce};

use super::{Visible, span};
use crate::projected::{Projected, signed_area};

/// Faces side by side.
const LANES: usize = 32;

/// Faces may cover at most so many pixel centers across and down to be treated here.
const ACROSS: usize = 3;

impl Visible {
    /// Draws `faces` in their order.
    pub(super) fn draw_all(&mut self, projected: &Projected, faces: &[u32]) {
        Arch::new().dispatch(DrawAll { visible: self, projected, faces });
    }
}

struct DrawAll<'a> {
    visible: &'a mut Visible,
    projected: &'a Projected<'a>,
    faces: &'a [u32],
}

impl NullaryFnOnce for DrawAll<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { visible, projected, faces } = self;
        let mut side_by_side = SideBySide::new();
        for faces in faces.chunks(LANES) {
            side_by_side.gather(projected, faces);
            side_by_side.cover(visible);
            for (l, &face) in faces.iter().enumerate() {
                if side_by_side.large[l] {
                    visible.draw(projected, face);
                } else {
                    side_by_side.write(visible, l, face);
                }
            }
        }
    }
}

struct SideBySide {
    corners: [[f32; LANES]; 9],
    large: [bool; LANES],
    /// The first pixel center that may be covered.
    first: [i32; LANES],
    /// A bit for each of the centers from there on that is covered, row by row.
    covered: [u32; LANES],
    /// 1/Z at these centers.
    inverse_z: [[f32; LANES]; ACROSS * ACROSS],
}

impl SideBySide {
    #[inline(always)]
    fn new() -> Self {
        Self {
            corners: [[0.0; LANES]; 9],
            large: [false; LANES],
            first: [0; LANES],
            covered: [0; LANES],
            inverse_z: [[0.0; LANES]; ACROSS * ACROSS],
        }
    }

    #[inline(always)]
    fn gather(&mut self, projected: &Projected, faces: &[u32]) {
        for (l, &face) in faces.iter().enumerate() {
            let [a, b, c] = projected.corners(face as usize);
            let corners = [a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z];
            self.corners.iter_mut().zip(corners).for_each(|(lanes, value)| lanes[l] = value);
        }
    }

    /// Covered pixel centers and their 1/Z, by the expressions for large faces.
    #[inline(always)]
    fn cover(&mut self, visible: &Visible) {
        let region = &visible.region;
        let (left, right) = (region.x0 as f32, region.x1 as f32 - 1.0);
        let (top, bottom) = (region.y0 as f32, region.y1 as f32 - 1.0);
        let width = region.width() as i32;
        for l in 0..LANES {
            let corner = |k: usize| {
                vec3(self.corners[3 * k][l], self.corners[3 * k + 1][l], self.corners[3 * k + 2][l])
            };
            let (a, b, c) = (corner(0), corner(1), corner(2));
            let [x_low, x_high] = span(a.x, b.x, c.x);
            let [y_low, y_high] = span(a.y, b.y, c.y);
            let (x_low, y_low) = (x_low.max(left).min(right), y_low.max(top).min(bottom));
            let x0 = whole_above(x_low);
            let y0 = whole_above(y_low);
            let reach = ACROSS as f32;
            self.large[l] = (x_high >= x0 + reach) | (y_high >= y0 + reach);
            let scale = 1.0 / signed_area([a, b, c]);
            let mut all = 0;
            for i in 0..ACROSS {
                for j in 0..ACROSS {
                    let (px, py) = (x0 + j as f32, y0 + i as f32);
                    let (ax, bx, cx) = (a.x - px, b.x - px, c.x - px);
                    let (ay, by, cy) = (a.y - py, b.y - py, c.y - py);
                    let e0 = (bx * cy - by * cx) * scale;
                    let e1 = (cx * ay - cy * ax) * scale;
                    let e2 = (ax * by - ay * bx) * scale;
                    let inverse_z = e0 * a.z + e1 * b.z + e2 * c.z;
                    let covered =
                        (e0 >= 0.0) & (e1 >= 0.0) & (e2 >= 0.0) & (px <= right) & (py <= bottom);
                    self.inverse_z[i * ACROSS + j][l] = inverse_z;
                    all |= u32::from(covered) << (i * ACROSS + j);
                }
            }
            self.covered[l] = all;
            self.first[l] = (y0 - top) as i32 * width + (x0 - left) as i32;
        }
    }

    /// Keeps the face of lane `l` where it is nearer than what is there.
    #[inline(always)]
    fn write(&self, visible: &mut Visible, l: usize, face: u32) {
        let width = visible.region.width();
        let mut left = self.covered[l];
        while left != 0 {
            let k = left.trailing_zeros() as usize;
            left &= left - 1;
            let at = self.first[l] as usize + k / ACROSS * width + k % ACROSS;
            let inverse_z = self.inverse_z[k][l];
            if inverse_z > visible.inverse_z[at] {
                visible.inverse_z[at] = inverse_z;
                visible.face[at] = face;
            }
        }
    }
}

/// The smallest whole number not below `v` ≥ 0.
#[inline(always)]
fn whole_above(v: f32) -> f32 {
    let whole = v as i32 as f32;
    whole + if whole < v { 1.0 } else { 0.0 }
}
