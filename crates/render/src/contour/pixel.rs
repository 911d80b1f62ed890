//! The blended value of one pixel and its derivatives by the pose.

use glam::{Vec2, Vec3};

use super::drawing::{DrawStep, falling_step};
use super::footprint::{Around, Beside, Cut};
use super::interior::{InteriorMotion, add_level, row};
use super::near::Near;
use super::outline::{Foot, Piece};
use super::scene::ContourScene;
use crate::projected::barycentric;
use crate::shading::surface::{Shaded, shade};
use crate::view::{Pixel, Row, scaled_sum};

impl ContourScene<'_> {
    /// The pixel `at` that `face` covers, with what is near.
    #[inline]
    pub(super) fn inside<const DERIVATIVES: bool>(
        &self,
        at: Vec2,
        face: u32,
        inverse_z: f32,
        Near { edge, inner, crease }: Near,
        beside: Option<&Beside>,
    ) -> Pixel {
        let (around, layers) = match beside {
            Some(Beside::Surface(around)) => (Some(around), None),
            Some(Beside::Layers(layers)) => (None, Some(layers)),
            None => (None, None),
        };
        // Of a pixel through which a contour runs only a part counts, whose rows come below.
        let cut = around.filter(|_| inner.is_none() && edge.is_some());
        let cut = cut.filter(|_| self.drawing.step == DrawStep::Square);
        let whole = around.filter(|_| cut.is_none());
        let mut pixel = self.interior::<DERIVATIVES>(at, face, inverse_z, whole);
        if let Some(crease) = crease {
            self.soften::<DERIVATIVES>(at, inverse_z, &mut pixel, crease);
        }
        if let Some(inner) = inner {
            pixel = self.cross::<DERIVATIVES>(at, pixel, inner, layers);
        }
        if let Some(piece) = edge {
            let foot = piece.foot(at);
            let cut = cut.map(|around| (face, around));
            self.blend::<DERIVATIVES>(at, piece, &foot, -1.0, cut, &mut pixel);
        }
        pixel
    }

    /// The pixel `at` that no face covers, next to the outline: it shows the color of the nearest outline point.
    #[inline]
    pub(super) fn outside<const DERIVATIVES: bool>(
        &self,
        at: Vec2,
        piece: &Piece,
        around: Option<&Around>,
    ) -> Pixel {
        let foot = piece.foot(at);
        let mut pixel = self.at_foot::<DERIVATIVES>(piece, &foot);
        let cut = around.filter(|_| self.drawing.step == DrawStep::Square);
        let cut = cut.map(|around| (piece.face, around));
        self.blend::<DERIVATIVES>(at, piece, &foot, 1.0, cut, &mut pixel);
        pixel
    }

    /// The unblended pixel `at` of a face. Its rows are those at its center, or over its area if what is `around` is given.
    #[inline]
    pub(super) fn interior<const DERIVATIVES: bool>(
        &self,
        at: Vec2,
        face: u32,
        inverse_z: f32,
        around: Option<&Around>,
    ) -> Pixel {
        let (index, face) = (face, face as usize);
        let b = barycentric(self.posed.projected.corners(face), at);
        let shaded = shade::<DERIVATIVES>(&self.posed, &self.lighting, face, b);
        let z = 1.0 / inverse_z;
        let mut pixel =
            Pixel { color: shaded.color, coverage: 1.0, z, depth_weight: 1.0, ..Pixel::default() };
        if DERIVATIVES {
            let corners = self.posed.model.faces[face].map(|v| self.posed.position[v as usize]);
            let ray = self.posed.ray(at);
            let motion = InteriorMotion::new(&corners, b, ray, z, self.twist_center);
            let arm = self.level_arm();
            for k in 0..3 {
                pixel.color_rows[k] = motion.color_row(&shaded, k);
                let level = shaded.level[k] * self.posed.level_dz;
                add_level(&mut pixel.color_rows[k], level, arm);
            }
            pixel.z_row = motion.z_row;
            if let Some(around) = around {
                pixel.color_rows = self.rows_over_footprint(at, z, index, around, &shaded, None);
            }
        }
        pixel
    }

    /// The unblended color of the foot on a contour.
    #[inline]
    pub(super) fn at_foot<const DERIVATIVES: bool>(&self, piece: &Piece, foot: &Foot) -> Pixel {
        let (b, point, ends) = self.on_edge(piece, foot.t);
        let shaded = shade::<DERIVATIVES>(&self.posed, &self.lighting, piece.face as usize, b);
        let mut pixel = Pixel {
            color: shaded.color,
            coverage: 1.0,
            z: point.z,
            depth_weight: 1.0,
            ..Pixel::default()
        };
        if DERIVATIVES {
            let slide = self.slide(piece, foot, point, ends);
            self.foot_rows(piece, &shaded, &slide, &mut pixel);
        }
        pixel
    }

    /// Rows of the color of an outline point, whose material point slides along the edge by `slide`.
    #[inline]
    fn foot_rows(&self, piece: &Piece, shaded: &Shaded, slide: &Row, pixel: &mut Pixel) {
        let arm = self.level_arm();
        for k in 0..3 {
            // Moving along the edge by dt changes the coordinates of its two corners by -dt and +dt.
            let at =
                |corner: u8| if corner == 0 { 0.0 } else { shaded.along[corner as usize - 1][k] };
            let along = at(piece.corners[1]) - at(piece.corners[0]);
            let out = &mut pixel.color_rows[k];
            *out = slide.map(|v| along * v);
            (0..3).for_each(|i| out[i + 3] += shaded.turning[k][i]);
            add_level(out, shaded.level[k] * self.posed.level_dz, arm);
        }
    }

    /// Fades the pixel by its signed distance to the outline (`side` is −1 inside, 1 outside).
    #[inline]
    fn blend<const DERIVATIVES: bool>(
        &self,
        at: Vec2,
        piece: &Piece,
        foot: &Foot,
        side: f32,
        cut: Option<(u32, &Around)>,
        pixel: &mut Pixel,
    ) {
        let distance = foot.distance_squared.sqrt();
        let s = side * distance;
        let step = self.drawing.step;
        let (alpha, slope) = step.at(s, piece.outward);
        let w = step.reach();
        // The same step, compressed to the inner half of the band.
        let (outer, outer_slope) = falling_step(2.0 * s + w, w);
        let color = pixel.color;
        pixel.color = color.map(|c| alpha * c);
        pixel.coverage = alpha;
        let weight = pixel.depth_weight;
        pixel.depth_weight = outer * weight;
        if !DERIVATIVES {
            return;
        }
        let ds = self.distance_row(piece, foot, side);
        let mut edge = color;
        match cut {
            Some((face, around)) => {
                let (b, point, _) = self.on_edge(piece, foot.t);
                let shaded = shade::<true>(&self.posed, &self.lighting, piece.face as usize, b);
                edge = shaded.color;
                let cut = Cut { distance: s, outward: piece.outward, color: edge };
                pixel.color_rows =
                    self.rows_over_footprint(at, point.z, face, around, &shaded, Some(&cut));
            }
            _ => pixel.color_rows.iter_mut().for_each(|rows| *rows = rows.map(|v| alpha * v)),
        }
        for (rows, c) in pixel.color_rows.iter_mut().zip(edge) {
            *rows = scaled_sum(1.0, rows, slope * c, &ds);
        }
        pixel.coverage_row = ds.map(|v| slope * v);
        pixel.depth_weight_row =
            scaled_sum(outer, &pixel.depth_weight_row, 2.0 * outer_slope * weight, &ds);
    }

    /// Row of the signed distance to a contour at its foot (`side` is −1 inside, 1 outside).
    #[inline]
    pub(super) fn distance_row(&self, piece: &Piece, foot: &Foot, side: f32) -> Row {
        let distance = foot.distance_squared.sqrt();
        let outward = if distance > 1e-3 { foot.offset * side / distance } else { piece.outward };
        let (_, point, _) = self.on_edge(piece, foot.t);
        // The foot moves by J v along the outward normal, and the signed distance shrinks by as much.
        self.image_motion(outward, point).map(|v| -v)
    }

    /// Barycentric coordinates and camera-frame position at screen share `t` of an edge, and its ends.
    #[inline]
    pub(super) fn on_edge(&self, piece: &Piece, t: f32) -> ([f32; 3], Vec3, [Vec3; 2]) {
        let face = self.posed.model.faces[piece.face as usize];
        let ids = piece.corners.map(|c| face[c as usize] as usize);
        let ends = ids.map(|v| self.posed.position[v]);
        let (wa, wb) = (
            (1.0 - t) * self.posed.projected.screen[ids[0]].z,
            t * self.posed.projected.screen[ids[1]].z,
        );
        let share = wb / (wa + wb);
        let mut b = [0.0; 3];
        b[piece.corners[0] as usize] = 1.0 - share;
        b[piece.corners[1] as usize] = share;
        (b, ends[0] + (ends[1] - ends[0]) * share, ends)
    }

    /// Motion of the image of `point` along the image direction `direction` \[px\] by the twist.
    #[inline]
    pub(super) fn image_motion(&self, direction: Vec2, point: Vec3) -> Row {
        let a = self.image_gradient(direction, point);
        row(a, (point - self.twist_center).cross(a))
    }

    /// Gradient by the point of its image position along `direction`.
    #[inline]
    fn image_gradient(&self, direction: Vec2, point: Vec3) -> Vec3 {
        let by = self.posed.focal * direction;
        by.extend(-by.dot(point.truncate()) / point.z) / point.z
    }

    /// How far the material point under the foot slides along its edge (share of the edge in space).
    ///
    /// The foot stays where (π(E) − p)·τ = 0 with the edge's image direction τ; differentiating this gives
    /// dt = (−τ·dπ(E) + s n·(dπ(B) − dπ(A))/ℓ) / (τ·J(B − A)), and zero at an end of the edge.
    #[inline]
    fn slide(&self, piece: &Piece, foot: &Foot, point: Vec3, ends: [Vec3; 2]) -> Row {
        if foot.t <= piece.range[0] || foot.t >= piece.range[1] {
            return [0.0; 6];
        }
        let d = piece.b - piece.a;
        let length = d.x.hypot(d.y);
        let tau = d / length;
        let speed = self.image_gradient(tau, point).dot(ends[1] - ends[0]);
        let along = self.image_motion(tau, point);
        // The offset from foot to pixel is s n, and perpendicular to τ.
        let turn_a = self.image_motion(foot.offset, ends[0]);
        let turn_b = self.image_motion(foot.offset, ends[1]);
        let mut out = [0.0; 6];
        for i in 0..6 {
            out[i] = (-along[i] + (turn_b[i] - turn_a[i]) / length) / speed;
        }
        out
    }
}
