//! Slopes of the image over a whole pixel.

use glam::{Vec2, vec2};

use super::contours::ContourView;
use super::drawing::DrawStep;
use super::inner::Inner;
use super::interior::add_level;
use super::near::{NearHit, NearPlace};
use super::outline::Foot;
use super::scene::ContourScene;
use crate::projected::barycentric;
use crate::raster::Visible;
use crate::shading::surface::{Shaded, shade};
use crate::view::{Row, scaled_sum};

/// The faces seen at the pixels to the left, to the right, above and below of the same surface; the face at hand where there
/// is none of it, and nothing beyond the border of the image.
pub(super) type Around = [Option<u32>; 4];

/// Where these pixels are.
const STEPS: [Vec2; 4] = [Vec2::NEG_X, Vec2::X, Vec2::NEG_Y, Vec2::Y];

impl ContourView<'_> {
    /// Faces around a pixel that shows `face` at depth `z` \[m\], near this inner contour, if any.
    pub(super) fn around(
        &self,
        place: &NearPlace,
        face: u32,
        z: f32,
        inner: Option<&Inner>,
    ) -> Around {
        STEPS.map(|step| {
            let (dx, dy) = (step.x as i64, step.y as i64);
            let (x, y) = (place.x as i64 + dx, place.y as i64 + dy);
            let [width, height] = self.size;
            if !(0..width as i64).contains(&x) || !(0..height as i64).contains(&y) {
                return None;
            }
            let Some(hit) = self.seen_at(x, y) else {
                // Outside the object the nearest piece of the outline is seen.
                let at = place.at as i64 + dy * self.region.width() as i64 + dx;
                let inside = (self.region.x0 as i64..self.region.x1 as i64).contains(&x);
                let piece = usize::try_from(at).ok().and_then(|at| place.band.piece.get(at));
                let piece = piece.filter(|_| inside).and_then(|i| self.pieces.get(*i as usize));
                return Some(piece.map_or(face, |piece| piece.face));
            };
            // On the other side of an inner contour there is another surface.
            let same = inner.is_none_or(|i| (1.0 / hit.inverse_z > i.split) == (z > i.split));
            Some(if same { hit.face } else { face })
        })
    }

    /// The near and the far surface at an inner contour, where `face` is seen at this depth.
    pub(super) fn layers(&self, place: &NearPlace, face: u32, z: f32, inner: &Inner) -> Layers {
        let (_, behind, inverse_z) = inner.behind;
        let beyond = z > inner.split;
        let [near, far] = if beyond { [inner.piece.face, face] } else { [face, behind] };
        let far_z = if beyond { z } else { 1.0 / inverse_z };
        // Depths before and behind all contours tell the sides apart.
        let layer = |face: u32, side: f32| Layer {
            face,
            around: self.around(place, face, side, Some(inner)),
        };
        Layers { near: layer(near, 0.0), far: layer(far, f32::INFINITY), far_z }
    }

    fn seen_at(&self, x: i64, y: i64) -> Option<NearHit> {
        let (x, y) = (usize::try_from(x).ok()?, usize::try_from(y).ok()?);
        Visible::at(&self.visible, x, y).map(|(face, inverse_z)| NearHit { face, inverse_z })
    }
}

/// Surroundings of a pixel that a face covers.
pub(super) enum Beside {
    /// Faces of its own surface.
    Surface(Around),
    /// Near and far surface, where an inner contour is near and cuts pixels.
    Layers(Layers),
}

/// The two surfaces that an inner contour divides.
pub(super) struct Layers {
    pub(super) near: Layer,
    pub(super) far: Layer,
    /// Depth of the far one at the pixel \[m\].
    pub(super) far_z: f32,
}

/// One of them.
pub(super) struct Layer {
    pub(super) face: u32,
    pub(super) around: Around,
}

/// A straight contour through a pixel, which hides what is beyond.
pub(super) struct Cut {
    /// Signed distance of the pixel from it \[px\], positive outside, and its unit normal.
    pub(super) distance: f32,
    pub(super) outward: Vec2,
    /// The surface's color at it.
    pub(super) color: [f32; 3],
}

impl Cut {
    /// The share of a side of the pixel that is on this side of the contour.
    fn left_of(&self, step: Vec2) -> f32 {
        let across = self.outward.dot(step);
        let along = (self.outward.x * step.y).abs() + (self.outward.y * step.x).abs();
        let distance = self.distance + 0.5 * across;
        (0.5 - distance / along.max(1e-6)).clamp(0.0, 1.0)
    }
}

impl ContourScene<'_> {
    /// Rows of the color of the pixel `at` of depth `z` that shows `face` as `shaded`, from the differences of the colors seen
    /// at its opposite sides.
    ///
    /// At its center the slope of a print, or of the light on a narrow bevel, says little about a pixel as large as its details,
    /// and jumps from pixel to pixel. The differences of pixels side by side add up to that between the sides of all of
    /// them, and that is what the mean over an area changes by when what it shows moves. Two faces that meet between two
    /// pixels each have half a say in the color there, so a jump of color counts, too.
    ///
    /// With a contour `cut` through the pixel, only the part inside counts; the caller adds the motion of the contour.
    pub(super) fn rows_over_footprint(
        &self,
        at: Vec2,
        z: f32,
        face: u32,
        around: &Around,
        shaded: &Shaded,
        cut: Option<&Cut>,
    ) -> [Row; 3] {
        let mut sides = [[0.0f32; 3]; 4];
        for (side, (step, &beside)) in sides.iter_mut().zip(STEPS.iter().zip(around)) {
            let border = at + 0.5 * step;
            *side = self.within(face, border);
            if let Some(beside) = beside.filter(|beside| *beside != face) {
                let other = self.within(beside, border);
                (0..3).for_each(|k| side[k] = 0.5 * (side[k] + other[k]));
            }
        }
        if around.contains(&None) {
            self.continue_over_border(face, at, around, &mut sides);
        }
        if let Some(cut) = cut {
            // The sides that are left and the contour itself close a polygon, so that a uniform color has no slope.
            for (side, step) in sides.iter_mut().zip(STEPS) {
                let share = cut.left_of(step);
                (0..3).for_each(|k| side[k] = share * (side[k] - cut.color[k]));
            }
        }
        let [left, right, top, bottom] = sides;
        let point = self.posed.ray(at) * z;
        let arm = self.level_arm();
        let area = cut.map_or(1.0, |cut| DrawStep::Square.at(cut.distance, cut.outward).0);
        std::array::from_fn(|k| {
            let slope = vec2(right[k] - left[k], bottom[k] - top[k]);
            let mut row = self.image_motion(slope, point).map(|v| -v);
            (0..3).for_each(|i| row[i + 3] += area * shaded.turning[k][i]);
            add_level(&mut row, area * shaded.level[k] * self.posed.level_dz, arm);
            row
        })
    }

    /// Nothing is known of what is beyond the border of the image: there the slope goes on as it comes from the other side.
    fn continue_over_border(
        &self,
        face: u32,
        at: Vec2,
        around: &Around,
        sides: &mut [[f32; 3]; 4],
    ) {
        let center = self.within(face, at);
        for (side, opposite) in [(0, 1), (1, 0), (2, 3), (3, 2)] {
            if around[side].is_none() && around[opposite].is_some() {
                sides[side] = [0, 1, 2].map(|k| 2.0 * center[k] - sides[opposite][k]);
            }
        }
    }

    /// Rows of the color of a pixel through which an inner contour runs: those of the part of it that shows the near surface,
    /// and of the part that shows the far one. The border of both moves with the contour, whose signed distance has row `ds`.
    pub(super) fn rows_across(
        &self,
        at: Vec2,
        inner: &Inner,
        foot: &Foot,
        side: f32,
        Layers { near, far, far_z }: &Layers,
        ds: &Row,
    ) -> [Row; 3] {
        let (distance, outward) = (side * foot.distance_squared.sqrt(), inner.piece.outward);
        let (b, point, _) = self.on_edge(&inner.piece, foot.t);
        let edge = inner.piece.face as usize;
        let shaded = shade::<true>(&self.posed, &self.lighting, edge, b);
        let here = shaded.color;
        let cut = Cut { distance, outward, color: here };
        let mut rows =
            self.rows_over_footprint(at, point.z, near.face, &near.around, &shaded, Some(&cut));
        let beyond = self.within(far.face, at - foot.offset);
        let b = self.clamped(far.face, at);
        let shaded = shade::<true>(&self.posed, &self.lighting, far.face as usize, b);
        let complement = Cut { distance: -distance, outward: -outward, color: beyond };
        let cut = Some(&complement);
        let behind = self.rows_over_footprint(at, *far_z, far.face, &far.around, &shaded, cut);
        let (_, slope) = DrawStep::Square.at(distance, outward);
        for k in 0..3 {
            let jump = slope * (here[k] - beyond[k]);
            let moved = scaled_sum(1.0, &behind[k], jump, ds);
            rows[k] = scaled_sum(1.0, &rows[k], 1.0, &moved);
        }
        rows
    }

    /// Barycentric coordinates of the point of a face that is seen at a point of the image, or next to it on its border.
    fn clamped(&self, face: u32, at: Vec2) -> [f32; 3] {
        let b = barycentric(self.posed.projected.corners(face as usize), at);
        let b = b.map(|v| v.max(0.0));
        let sum = b[0] + b[1] + b[2];
        b.map(|v| v / sum)
    }

    /// The color there.
    fn within(&self, face: u32, at: Vec2) -> [f32; 3] {
        let b = self.clamped(face, at);
        shade::<false>(&self.posed, &self.lighting, face as usize, b).color
    }
}
