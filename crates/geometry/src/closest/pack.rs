//! Eight triangles at a time, in single precision: how far is each of them, to within a known error?

use nalgebra::Vector3;
use wide::f32x8;

/// Triangles measured together.
pub(super) const LANES: usize = 8;

/// A query point in every lane, from the center of the mesh \[m\].
pub(super) type Point8 = [f32x8; 3];

/// Up to eight triangles, each in a frame of its own: from corner `a`, x runs along the longest side, y in the plane
/// towards the third corner, z along the normal. There the distance is that to a triangle in the plane
/// (0, 0), (`base`, 0), third corner, and no rounding depends on how thin the triangle is.
#[derive(Clone, Debug)]
pub(super) struct Pack {
    a: [f32x8; 3],
    axes: [[f32x8; 3]; 3],
    base: f32x8,
    /// Unit vectors along the second side, up from the end of the base, and along the third, up from its start.
    up: [[f32x8; 2]; 2],
    /// Lengths of those sides \[m\].
    length: [f32x8; 2],
    /// Position of the first triangle in the tree's order.
    pub(super) first: u32,
    /// Lanes in use, one bit each.
    used: u32,
}

impl Pack {
    /// Packs at most [`LANES`] triangles by their corners \[m\] from the center of the mesh; the first of them is
    /// number `first` in the tree.
    pub(super) fn new(triangles: &[[Vector3<f64>; 3]], first: u32) -> Self {
        let mut columns = [[0.0f32; LANES]; 19];
        for (lane, corners) in triangles.iter().enumerate().take(LANES) {
            for (column, x) in columns.iter_mut().zip(frame(corners)) {
                column[lane] = x as f32;
            }
        }
        let c = columns.map(f32x8::from);
        Self {
            a: [c[0], c[1], c[2]],
            axes: [[c[3], c[4], c[5]], [c[6], c[7], c[8]], [c[9], c[10], c[11]]],
            base: c[12],
            up: [[c[13], c[14]], [c[15], c[16]]],
            length: [c[17], c[18]],
            first,
            used: (1 << triangles.len().min(LANES)) - 1,
        }
    }

    /// Positions of the triangles in the tree's order.
    pub(super) fn range(&self) -> std::ops::Range<usize> {
        self.first as usize..self.first as usize + self.used.count_ones() as usize
    }

    /// Squared distances \[m²\], those of unused lanes of no meaning.
    #[inline]
    pub(super) fn distances_squared(&self, p: &Point8) -> f32x8 {
        let d = [p[0] - self.a[0], p[1] - self.a[1], p[2] - self.a[2]];
        let x = dot3(&d, &self.axes[0]);
        let y = dot3(&d, &self.axes[1]);
        let z = dot3(&d, &self.axes[2]);
        let zero = f32x8::ZERO;
        // From the base, from the side at its end, and from the side at its start.
        let bx = x - clamp(x, self.base);
        let base = bx * bx + y * y;
        let (end, inside_end) = side(x - self.base, y, &self.up[0], self.length[0]);
        let (start, inside_start) = side(x, y, &self.up[1], self.length[1]);
        let inside = y.simd_gt(zero) & inside_end.simd_gt(zero) & inside_start.simd_lt(zero);
        let border = base.fast_min(end).fast_min(start);
        z * z + inside.select(zero, border)
    }

    /// A bit for each of the triangles that `squared` places within `limit` \[m²\].
    #[inline]
    pub(super) fn within(&self, squared: f32x8, limit: f32) -> u32 {
        squared.simd_le(f32x8::splat(limit)).to_bitmask() & self.used
    }
}

#[inline(always)]
pub(super) fn dot3(a: &Point8, b: &Point8) -> f32x8 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn clamp(x: f32x8, top: f32x8) -> f32x8 {
    x.fast_max(f32x8::ZERO).fast_min(top)
}

/// Squared distance of (x, y) from a side that starts at the origin, and on which side of it (x, y) lies.
#[inline(always)]
fn side(x: f32x8, y: f32x8, up: &[f32x8; 2], length: f32x8) -> (f32x8, f32x8) {
    let t = clamp(x * up[0] + y * up[1], length);
    let (rx, ry) = (x - t * up[0], y - t * up[1]);
    (rx * rx + ry * ry, up[0] * y - up[1] * x)
}

/// The numbers of one lane, in the order of [`Pack`]'s fields.
fn frame(corners: &[Vector3<f64>; 3]) -> [f64; 19] {
    let length = |i: usize| (corners[(i + 1) % 3] - corners[i]).norm_squared();
    let k = (0..3).max_by(|&i, &j| length(i).total_cmp(&length(j))).unwrap_or(0);
    let [a, b, c] = [0, 1, 2].map(|i| corners[(k + i) % 3]);
    let (ab, ac) = (b - a, c - a);
    let x = ab.try_normalize(0.0).unwrap_or_else(Vector3::x);
    let lifted = ac - x * ac.dot(&x);
    let any = Vector3::ith(x.iamin(), 1.0);
    // Twice, because the first difference may have lost all but a few digits.
    let y = [lifted, any]
        .iter()
        .filter_map(|y| y.try_normalize(0.0))
        .filter_map(|y| (y - x * y.dot(&x)).try_normalize(1e-3))
        .next()
        .unwrap_or_else(Vector3::y);
    let z = x.cross(&y);
    let (base, third) = (ab.norm(), [ac.dot(&x), ac.dot(&y)]);
    let side = |from: f64| {
        let (dx, dy) = (third[0] - from, third[1]);
        let length = dx.hypot(dy);
        if length > 0.0 { [dx / length, dy / length, length] } else { [0.0; 3] }
    };
    let (end, start) = (side(base), side(0.0));
    [
        a.x, a.y, a.z, x.x, x.y, x.z, y.x, y.y, y.z, z.x, z.y, z.z, base, end[0], end[1], start[0],
        start[1], end[2], start[2],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::closest::triangle::Triangle;
    use crate::random::SplitMix64;

    #[test]
    fn agrees_with_double_precision_however_thin_the_triangle() {
        let mut random = SplitMix64::new(23);
        let mut vector =
            |scale: f64| Vector3::from([(); 3].map(|()| scale * (random.uniform() - 0.5)));
        for case in 0..3000 {
            let (a, b) = (vector(1.0), vector(1.0));
            let c = match case % 6 {
                0 => a,
                1 => a + (b - a) * 0.3,
                2 => b + vector(1e-6),
                3 => a + (b - a) * 0.6 + vector(1e-4),
                _ => vector(1.0),
            };
            let corners = if case % 7 == 0 { [a; 3] } else { [a, b, c] };
            let pack = Pack::new(&[corners, [c, a, b]], 5);
            let p = vector(3.0);
            let lanes = [p.x, p.y, p.z].map(|x| f32x8::splat(x as f32));
            let all = pack.distances_squared(&lanes);
            let squared = all.to_array();
            assert_eq!(pack.within(all, f32::MAX), 3);
            let exact = |corners: [Vector3<f64>; 3]| {
                Triangle::new(corners.map(Into::into), 0).closest(&p).distance_squared.sqrt()
            };
            // A tenth of what the search allows for.
            assert!((f64::from(squared[0]).sqrt() - exact(corners)).abs() < 5e-7, "case {case}");
            assert!((f64::from(squared[1]).sqrt() - exact([c, a, b])).abs() < 5e-7, "case {case}");
            assert_eq!(pack.within(all, 0.0) & !3, 0);
        }
    }
}
