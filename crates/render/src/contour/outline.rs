//! The outline of a posed mesh: silhouette edges that separate it from the background.

use glam::{Vec2, vec2};

use super::layers::{Layers, Segment};
use crate::model::{Edge, NONE};
use crate::projected::{Projected, Region};

/// Longest piece of an edge that is judged as a whole \[px\].
const PIECE: f32 = 4.0;
/// How far outside an edge it is probed for other parts of the object \[px\]: small against a pixel, large against
/// the rounding of coordinates.
const PROBE: f32 = 0.02;

/// A piece of the outline.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piece {
    /// The visible face at the edge, and the corners between which the edge runs.
    pub(crate) face: u32,
    pub(crate) corners: [u8; 2],
    /// Screen positions of the whole edge's ends \[px\].
    pub(crate) a: Vec2,
    pub(crate) b: Vec2,
    /// The part of the edge (share of its screen length) that belongs to the outline.
    pub(crate) range: [f32; 2],
    /// Unit normal in the image, away from the object.
    pub(crate) outward: Vec2,
}

/// The point of a piece next to a pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Foot {
    /// Share of the edge's screen length.
    pub(crate) t: f32,
    /// From the foot to the pixel \[px\].
    pub(crate) offset: Vec2,
    pub(crate) distance_squared: f32,
}

impl Piece {
    /// The whole edge from `corner` of `face` on, between these places in the image \[px\]; none of a very short edge, which is
    /// spanned by its neighbors' ends.
    pub(super) fn whole(face: u32, corner: u8, [a, b]: [Vec2; 2], facing: i8) -> Option<Self> {
        let d = b - a;
        let length = d.x.hypot(d.y);
        let outward = f32::from(facing) * d.perp() / length;
        let corners = [corner, (corner + 1) % 3];
        let has_length = length > 1e-4 && length.is_finite();
        has_length.then_some(Self { face, corners, a, b, range: [0.0, 1.0], outward })
    }

    /// The pieces of a whole edge that come within `margin` pixels of `region`.
    pub(super) fn cut(self, region: &Region, margin: f32) -> impl Iterator<Item = Self> {
        let d = self.b - self.a;
        let length = d.x.hypot(d.y);
        let pieces = clip(&self, region, margin).map(|[start, end]| {
            let count = ((end - start) * length / PIECE).ceil().max(1.0);
            let at = move |j: f32| start + (end - start) * j / count;
            let range = move |i: usize| [at(i as f32), at(i as f32 + 1.0)];
            (0..count as usize).map(move |i| Self { range: range(i), ..self })
        });
        pieces.into_iter().flatten()
    }

    /// Share of the edge's screen length in its middle.
    #[inline]
    pub(super) fn middle(&self) -> f32 {
        0.5 * (self.range[0] + self.range[1])
    }

    #[inline]
    pub(crate) fn foot(&self, at: Vec2) -> Foot {
        let (d, r) = (self.b - self.a, at - self.a);
        let t = (r.dot(d) / d.dot(d)).max(self.range[0]).min(self.range[1]);
        let offset = r - t * d;
        Foot { t, offset, distance_squared: offset.dot(offset) }
    }

    /// The point at a share of the edge's screen length.
    #[inline]
    pub(crate) fn at(&self, t: f32) -> Vec2 {
        self.a + t * (self.b - self.a)
    }
}

/// Pieces of silhouette edges.
#[derive(Default)]
pub(crate) struct Silhouette {
    /// With nothing of the object just outside.
    pub(crate) outline: Vec<Piece>,
    /// All others, hidden or not.
    pub(crate) covered: Vec<Piece>,
}

/// The pieces of the silhouette that come within `margin` pixels of `region`.
///
/// An edge is a silhouette where exactly one of its faces is drawn, or one is seen from outside and the
/// other from inside. The oriented silhouette is the boundary of the drawn faces, so its winding number about an image
/// point is the number of layers there; a piece is part of the outline if there are none just outside it.
pub(crate) fn outline(projected: &Projected, region: &Region, margin: f32) -> Silhouette {
    let mut segments = Vec::new();
    let mut candidates = Vec::new();
    for (edge, own, other) in silhouette_edges(projected) {
        // A drawn face has all its corners in front of the camera.
        let [a, b] = edge.vertices.map(|v| projected.screen[v as usize].truncate());
        let layers = f32::from(other) - f32::from(own);
        segments.push(Segment { a, b, layers });
        candidates.extend(match own == 1 || other == 0 {
            true => Piece::whole(edge.face, edge.corner, [a, b], own),
            false => Piece::whole(edge.other, edge.other_corner, [b, a], other),
        });
    }
    let layers = Layers::new(&segments, region, margin + 1.0);
    let mut silhouette = Silhouette::default();
    for piece in candidates.into_iter().flat_map(|edge: Piece| edge.cut(region, margin)) {
        let free = layers.at(piece.at(piece.middle()) + PROBE * piece.outward) < 0.5;
        let list = if free { &mut silhouette.outline } else { &mut silhouette.covered };
        list.push(piece);
    }
    silhouette
}

/// The edges between faces that do not both face the same way, with how the one and the other do: a loop of its own, short enough
/// to stay in registers.
fn silhouette_edges<'a>(projected: &Projected<'a>) -> Vec<(&'a Edge, i8, i8)> {
    let facing = projected.facing.as_slice();
    let faced = |edge: &'a Edge| {
        let own = facing[edge.face as usize];
        let other = if edge.other == NONE { 0 } else { facing[edge.other as usize] };
        (own != other).then_some((edge, own, other))
    };
    projected.edges.iter().filter_map(faced).collect()
}

/// The share of an edge within `margin` of `region`.
fn clip(edge: &Piece, region: &Region, margin: f32) -> Option<[f32; 2]> {
    let (mut start, mut end) = (0.0f32, 1.0f32);
    let bounds = [(region.x0, region.x1), (region.y0, region.y1)];
    for (k, (low, high)) in bounds.into_iter().enumerate() {
        let (low, high) = (low as f32 - margin, high as f32 - 1.0 + margin);
        let d = edge.b[k] - edge.a[k];
        if d.abs() < 1e-6 {
            if edge.a[k] < low || edge.a[k] > high {
                return None;
            }
            continue;
        }
        let (t0, t1) = ((low - edge.a[k]) / d, (high - edge.a[k]) / d);
        start = start.max(t0.min(t1));
        end = end.min(t0.max(t1));
    }
    (start < end).then_some([start, end])
}

/// For each pixel of some rows, the nearest piece of the outline, if within the band.
pub(crate) struct Band {
    pub(crate) distance_squared: Vec<f32>,
    pub(crate) piece: Vec<u32>,
}

impl Band {
    pub(crate) fn new<'a>(
        pieces: impl Iterator<Item = &'a Piece>,
        rows: &Region,
        half_width: f32,
    ) -> Self {
        let width = rows.width();
        let count = width * (rows.y1 - rows.y0);
        let limit = half_width * half_width;
        let mut band = Self { distance_squared: vec![limit; count], piece: vec![NONE; count] };
        for (index, piece) in pieces.enumerate() {
            let ends = piece.range.map(|t| piece.at(t));
            let span = |[p, q]: [f32; 2], first: usize, last: usize| {
                let low = (p.min(q) - half_width).ceil().max(first as f32);
                let high = (p.max(q) + half_width).floor().min(last as f32 - 1.0);
                (low <= high).then(|| low as usize..high as usize + 1)
            };
            let Some(ys) = span(ends.map(|end| end.y), rows.y0, rows.y1) else { continue };
            let Some(xs) = span(ends.map(|end| end.x), rows.x0, rows.x1) else { continue };
            for y in ys {
                let row = (y - rows.y0) * width;
                for x in xs.clone() {
                    let d = piece.foot(vec2(x as f32, y as f32)).distance_squared;
                    let at = row + x - rows.x0;
                    if d < band.distance_squared[at] {
                        band.distance_squared[at] = d;
                        band.piece[at] = index as u32;
                    }
                }
            }
        }
        band
    }
}
