//! Projected triangles: all that visibility needs to know.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::camera::Camera;
use crate::model::Edge;

/// Vertices or faces that are worth a task of their own.
pub(crate) const TASK: usize = 1024;

/// A rectangle of pixels; the upper ends are exclusive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Region {
    pub(crate) x0: usize,
    pub(crate) y0: usize,
    pub(crate) x1: usize,
    pub(crate) y1: usize,
}

impl Region {
    pub(crate) const EMPTY: Self = Self { x0: 0, y0: 0, x1: 0, y1: 0 };

    /// Smallest rectangle around the set pixels of a mask, which are looked at side by side, in a tenth of the time.
    pub(crate) fn around_mask(width: usize, pixels: &[bool]) -> Option<Self> {
        let mut rows = pixels.chunks(width.max(1));
        let has_any = |row: &[bool]| row.iter().fold(false, |any, set| any | set);
        let y0 = rows.position(has_any)?;
        let y1 = rows.rposition(has_any).map_or(y0 + 1, |row| y0 + 2 + row);
        let mut columns = vec![false; width];
        for row in pixels[y0 * width..(y1 * width).min(pixels.len())].chunks(width) {
            columns.iter_mut().zip(row).for_each(|(any, set)| *any |= set);
        }
        let x0 = columns.iter().position(|any| *any)?;
        let x1 = columns.iter().rposition(|any| *any).map_or(x0, |last| last + 1);
        Some(Self { x0, y0, x1, y1 })
    }

    pub(crate) fn width(&self) -> usize {
        self.x1 - self.x0
    }

    /// Its pixels in an image of `width` columns.
    pub(crate) fn indices(&self, width: usize) -> impl Iterator<Item = usize> + use<> {
        let Self { x0, y0, x1, y1 } = *self;
        (y0..y1).flat_map(move |y| y * width + x0..y * width + x1)
    }

    /// The rectangle that it touches in an image whose pixels are blocks of `factor` by `factor`, incomplete ones cut off.
    pub(crate) fn reduced(&self, factor: usize, width: usize, height: usize) -> Self {
        let Self { x0, y0, x1, y1 } = *self;
        let end = |last: usize, size: usize| last.div_ceil(factor).min(size);
        let (x1, y1) = (end(x1, width), end(y1, height));
        Self { x0: (x0 / factor).min(x1), y0: (y0 / factor).min(y1), x1, y1 }
    }

    /// Rectangle in an image of `factor` times the resolution.
    pub(crate) fn scaled(&self, factor: usize) -> Self {
        let Self { x0, y0, x1, y1 } = *self;
        Self { x0: x0 * factor, y0: y0 * factor, x1: x1 * factor, y1: y1 * factor }
    }

    /// The smallest rectangle around both.
    pub(crate) fn union(&self, other: &Self) -> Self {
        if *self == Self::EMPTY {
            return *other;
        }
        if *other == Self::EMPTY {
            return *self;
        }
        Self {
            x0: self.x0.min(other.x0),
            y0: self.y0.min(other.y0),
            x1: self.x1.max(other.x1),
            y1: self.y1.max(other.y1),
        }
    }
}

/// The faces and edges of one or several surfaces, projected into the image.
pub(crate) struct Projected<'a> {
    pub(crate) faces: &'a [[u32; 3]],
    pub(crate) edges: &'a [Edge],
    /// Column, row \[px\] and 1/Z \[1/m\] of each vertex; 1/Z is 0 where it is not in front of the camera.
    pub(crate) screen: Vec<Vec3>,
    /// Per face: 1 seen from outside, -1 seen from inside, 0 not drawn.
    pub(crate) facing: Vec<i8>,
    /// Pixels that may be covered.
    pub(crate) region: Region,
}

impl<'a> Projected<'a> {
    /// `closed` says of a face whether it is drawn from outside only; `margin` pixels are added around the covered
    /// region.
    pub(crate) fn new(
        faces: &'a [[u32; 3]],
        edges: &'a [Edge],
        closed: impl Fn(usize) -> bool + Sync,
        screen: Vec<Vec3>,
        camera: &Camera,
        margin: f32,
    ) -> Self {
        // A plain loop in each task: a closure for each face, which rayon does not inline, is a tenth of the work.
        let facings = || {
            let mut facings = vec![0; faces.len()];
            let tasks = facings.par_chunks_mut(TASK).zip(faces.par_chunks(TASK)).enumerate();
            tasks.for_each(|(task, (facings, faces))| {
                for ((index, out), face) in (TASK * task..).zip(facings).zip(faces) {
                    *out = facing(&screen, face, closed(index));
                }
            });
            facings
        };
        let (facing, region) = rayon::join(facings, || region(&screen, camera, margin));
        Self { faces, edges, screen, facing, region }
    }

    /// Screen positions of a face's corners.
    #[inline(always)]
    pub(crate) fn corners(&self, face: usize) -> [Vec3; 3] {
        let [a, b, c] = self.faces[face];
        [self.screen[a as usize], self.screen[b as usize], self.screen[c as usize]]
    }
}

/// Twice the signed area of a screen triangle \[px²\]; negative where its outside is seen.
#[inline(always)]
pub(crate) fn signed_area([a, b, c]: [Vec3; 3]) -> f32 {
    (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)
}

#[inline(always)]
fn facing(screen: &[Vec3], &[a, b, c]: &[u32; 3], closed: bool) -> i8 {
    let corners @ [a, b, c] = [screen[a as usize], screen[b as usize], screen[c as usize]];
    let drawn = (a.z != 0.0) & (b.z != 0.0) & (c.z != 0.0);
    let area = signed_area(corners);
    let sign = i8::from(area < 0.0) - i8::from((area > 0.0) & !closed);
    if drawn { sign } else { 0 }
}

fn region(screen: &[Vec3], camera: &Camera, margin: f32) -> Region {
    let (mut low, mut high) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
    for p in screen.iter().filter(|p| p.z > 0.0) {
        low = low.min(p.truncate());
        high = high.max(p.truncate());
    }
    // Float-to-integer casts saturate, so far-off projections clip to the image.
    let start = |v: f32| (v - margin).ceil().max(0.0) as usize;
    let end = |v: f32, size: usize| ((v + margin).floor() + 1.0).clamp(0.0, size as f32) as usize;
    let region = Region {
        x0: start(low.x),
        y0: start(low.y),
        x1: end(high.x, camera.width),
        y1: end(high.y, camera.height),
    };
    if region.x0 < region.x1 && region.y0 < region.y1 { region } else { Region::EMPTY }
}

/// Twice the signed areas that a point of the image spans with the sides of a screen triangle, opposite each corner.
#[inline(always)]
pub(crate) fn edge_functions(corners: [Vec3; 3], at: Vec2) -> [f32; 3] {
    let [a, b, c] = corners.map(|corner| corner.truncate() - at);
    [b.perp_dot(c), c.perp_dot(a), a.perp_dot(b)]
}

/// Perspective-correct barycentric coordinates of a point of the image on a face with these corners (column, row, 1/Z).
#[inline(always)]
pub(crate) fn barycentric(corners: [Vec3; 3], at: Vec2) -> [f32; 3] {
    let [a, b, c] = edge_functions(corners, at);
    let weights = [a * corners[0].z, b * corners[1].z, c * corners[2].z];
    let sum = weights[0] + weights[1] + weights[2];
    // The reciprocal of a subnormal number is infinite.
    let scale = if sum.abs() < f32::MIN_POSITIVE { 0.0 } else { 1.0 / sum };
    let (second, third) = (weights[1] * scale, weights[2] * scale);
    [1.0 - second - third, second, third]
}
