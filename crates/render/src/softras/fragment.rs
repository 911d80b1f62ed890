//! Fragments: faces as seen from pixels.

use super::face::Face;
use super::number::Number;
use super::settings::Settings;

/// A face as seen from a pixel center p.
///
/// With the corners v_i relative to p, the edge functions are E_0 = v_1 × v_2, E_1 = v_2 × v_0 and E_2 = v_0 × v_1
/// (positive inside), the weights W_i = s_i E_i with s_i = 1/Z_i if the perspective is corrected and s_i = 1 if not,
/// clamped to zero from below if coordinates are clipped, and b_i = W_i / Σ W_j.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fragment<T> {
    /// Barycentric coordinates of the surface point.
    pub(crate) b: [T; 3],
    /// Σ b_i Z_i \[m\].
    pub(crate) z: T,
    /// Squared distance to the nearest of the three edges \[px²\], negative inside.
    pub(crate) distance: T,
    /// Barycentric coordinates, in the image, of the nearest point on the edges.
    pub(crate) foot: [T; 3],
    /// From the pixel center to that point \[px\].
    pub(crate) to_foot: [T; 2],
    /// One over the sum of the weights.
    pub(crate) inverse_sum: T,
    /// 1 where the weight depends on the corners, 0 where it is clamped.
    pub(crate) active: [T; 3],
    /// 1 where the sum of the weights does, 0 where it is at its lower bound.
    pub(crate) sum_active: T,
}

/// Lanes in which the face counts, and those whose pixel center lies inside it.
#[derive(Clone, Copy)]
pub(crate) struct Extent<M> {
    pub(crate) kept: M,
    pub(crate) inside: M,
}

#[inline(always)]
fn cross<T: Number>(a: [T; 2], b: [T; 2]) -> T {
    a[0] * b[1] - a[1] * b[0]
}

/// The point of an edge that is nearest to a pixel.
#[derive(Clone, Copy)]
struct NearestPoint<T> {
    /// Share of the edge.
    share: T,
    /// From the pixel \[px\].
    offset: [T; 2],
    squared: T,
}

impl<T: Number> NearestPoint<T> {
    #[inline(always)]
    fn or(self, other_instead: T::Mask, other: Self) -> Self {
        Self {
            share: T::pick(other_instead, other.share, self.share),
            offset: [
                T::pick(other_instead, other.offset[0], self.offset[0]),
                T::pick(other_instead, other.offset[1], self.offset[1]),
            ],
            squared: T::pick(other_instead, other.squared, self.squared),
        }
    }
}

impl Face {
    /// On edge `edge`, whose first end lies at `start` from the pixel.
    #[inline(always)]
    fn foot<T: Number>(&self, edge: usize, start: [T; 2]) -> NearestPoint<T> {
        let is = |value: f32| start[0].like(value);
        let [x, y] = self.edge[edge];
        let (x, y) = (is(x), is(y));
        let t =
            is(self.short[edge]) - (start[0] * x + start[1] * y) * is(self.inverse_length[edge]);
        let t = T::pick(is(0.0).below(t), t, is(0.0));
        let share = T::pick(t.below(is(1.0)), t, is(1.0));
        let offset = [start[0] + share * x, start[1] + share * y];
        NearestPoint { share, offset, squared: offset[0] * offset[0] + offset[1] * offset[1] }
    }
}

impl<T: Number> Fragment<T> {
    /// The fragments of `face` at pixels (column, row). Without branches and calls of closures from elsewhere, so that all
    /// of it is compiled for the vector instructions at hand.
    #[inline(always)]
    pub(crate) fn new(
        face: &Face,
        column: T,
        row: T,
        settings: &Settings,
    ) -> (Self, Extent<T::Mask>) {
        let is = |value: f32| column.like(value);
        let (zero, one) = (is(0.0), is(1.0));
        // Exact: both are whole numbers.
        let (x, y) = (column - is(face.base[0]), row - is(face.base[1]));
        let [c0, c1, c2] = face.corner;
        let v0 = [is(c0[0]) - x, is(c0[1]) - y];
        let v1 = [is(c1[0]) - x, is(c1[1]) - y];
        let v2 = [is(c2[0]) - x, is(c2[1]) - y];
        let raw0 = is(face.share[0]) * cross(v1, v2);
        let raw1 = is(face.share[1]) * cross(v2, v0);
        let raw2 = is(face.share[2]) * cross(v0, v1);
        let inside = zero.below(raw0) & zero.below(raw1) & zero.below(raw2);
        let least = is(settings.least_weight);
        let free = [raw0.at_least(least), raw1.at_least(least), raw2.at_least(least)];
        let w0 = T::pick(free[0], raw0, least);
        let w1 = T::pick(free[1], raw1, least);
        let w2 = T::pick(free[2], raw2, least);
        let (sum, least_sum) = (w0 + w1 + w2, is(face.least_sum));
        let sum_is_free = least_sum.below(sum);
        let sum = T::pick(sum_is_free, sum, least_sum);
        // Divisions, so that a point clamped to a corner has its coordinates and depth exactly: ties between the faces
        // around a corner stay ties.
        let b = [w0 / sum, w1 / sum, w2 / sum];
        let z = b[0] * is(face.z[0]) + b[1] * is(face.z[1]) + b[2] * is(face.z[2]);

        let [first, second, third] = [face.foot(0, v0), face.foot(1, v0), face.foot(2, v1)];
        let (t, u) = (first.share, one - first.share);
        let (mut foot, mut near) = ([u, t, zero], first);
        let (t, u, nearer) = (second.share, one - second.share, second.squared.below(near.squared));
        foot = [
            T::pick(nearer, u, foot[0]),
            T::pick(nearer, zero, foot[1]),
            T::pick(nearer, t, foot[2]),
        ];
        near = near.or(nearer, second);
        let (t, u, nearer) = (third.share, one - third.share, third.squared.below(near.squared));
        foot = [
            T::pick(nearer, zero, foot[0]),
            T::pick(nearer, u, foot[1]),
            T::pick(nearer, t, foot[2]),
        ];
        near = near.or(nearer, third);
        let squared = near.squared;
        let fragment = Self {
            b,
            z,
            distance: T::pick(inside, -squared, squared),
            foot,
            to_foot: near.offset,
            inverse_sum: one / sum,
            active: [
                T::pick(free[0], one, zero),
                T::pick(free[1], one, zero),
                T::pick(free[2], one, zero),
            ],
            sum_active: T::pick(sum_is_free, one, zero),
        };
        let kept = (inside | squared.below(is(settings.blur))) & z.at_least(zero);
        (fragment, Extent { kept, inside })
    }
}
