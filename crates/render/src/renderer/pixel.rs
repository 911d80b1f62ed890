//! One pixel of the contour mode, forward and reverse: the same equations as the loss of a pose, over any background.

use nalgebra::Vector3;
use prehend_autodiff::LocalFunction;

use super::buffers::PixelAdjoint;
use super::geometry::{Foot, Hit, hit, hit_adjoint};
use super::sums::Sums;
use super::surface::{Lit, Sample};
use crate::contour::{Inner, Piece};
use crate::shading::{Chunks, Shader};

/// What was decided about a pixel: which face is at its centre, and which contours are near.
#[derive(Clone, Copy)]
pub(super) struct Decision<'a> {
    pub(super) x: usize,
    pub(super) y: usize,
    pub(super) face: Option<usize>,
    pub(super) edge: Option<&'a Piece>,
    pub(super) inner: Option<&'a Inner>,
    pub(super) half_width: f64,
}

/// A rendered pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pixel {
    pub(super) color: [f64; 3],
    pub(super) alpha: f64,
    pub(super) depth: f64,
    pub(super) normal: Vector3<f64>,
}

/// Where a sample of a pixel lies on its face.
#[derive(Clone, Copy)]
enum Place {
    /// At an image position.
    Ray([f64; 2], Hit),
    /// At the foot on the contour.
    Foot,
}

/// A contour next to a pixel.
#[derive(Clone, Copy)]
struct Step<'a> {
    piece: &'a Piece,
    foot: Foot,
    share: f64,
    /// Weight of the near side, and its derivative by the signed distance.
    alpha: f64,
    slope: f64,
}

/// The two sides of an inner contour; one is the pixel's own surface.
struct Crossing<'a> {
    step: Step<'a>,
    other: Sample,
    other_place: Place,
    own_is_near: bool,
}

/// All that makes a pixel.
struct Traced<'a> {
    own: Sample,
    own_place: Place,
    crossing: Option<Crossing<'a>>,
    edge: Option<Step<'a>>,
    /// Colour before it is blended with the background.
    surface: [f64; 3],
}

/// The smooth step from 1 at −w to 0 at +w, and its derivative.
#[inline]
fn falling_step(s: f64, w: f64) -> (f64, f64) {
    let x = ((w - s) / (2.0 * w)).clamp(0.0, 1.0);
    (x * x * (3.0 - 2.0 * x), -3.0 * x * (1.0 - x) / w)
}

#[inline]
fn mix(share: f64, a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|c| share * a[c] + (1.0 - share) * b[c])
}

#[inline]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl<Sh: Shader> Lit<'_, Sh> {
    /// The pixel, or nothing where only the background is seen.
    #[inline]
    pub(super) fn pixel(&self, decision: &Decision) -> Option<Pixel> {
        let traced = self.trace(decision)?;
        let alpha = traced.edge.map_or(1.0, |edge| edge.alpha);
        let (depth, normal) = match traced.own_place {
            Place::Ray(_, hit) => (hit.z, traced.own.point.normal),
            Place::Foot => (0.0, Vector3::zeros()),
        };
        Some(Pixel { color: mix(alpha, traced.surface, self.background), alpha, depth, normal })
    }

    /// Carries the adjoints of a pixel back into `sums`.
    #[inline]
    pub(super) fn pixel_back(
        &self,
        decision: &Decision,
        by: &PixelAdjoint,
        chunks: &Chunks,
        sums: &mut Sums,
    ) {
        let Some(traced) = self.trace(decision) else {
            (0..3).for_each(|c| sums.background[c] += by.color[c]);
            return;
        };
        let alpha = traced.edge.map_or(1.0, |edge| edge.alpha);
        let by_surface = by.color.map(|v| alpha * v);
        let mut by_distance = 0.0;
        if let Some(edge) = &traced.edge {
            (0..3).for_each(|c| sums.background[c] += (1.0 - alpha) * by.color[c]);
            let step = [0, 1, 2].map(|c| traced.surface[c] - self.background[c]);
            by_distance = edge.slope * (dot(by.color, step) + by.alpha);
        }
        let mut by_own = by_surface;
        if let Some(crossing) = &traced.crossing {
            let share = crossing.step.alpha;
            let (own, other, sign) = match crossing.own_is_near {
                true => (share, 1.0 - share, 1.0),
                false => (1.0 - share, share, -1.0),
            };
            by_own = by_surface.map(|v| own * v);
            let by_other = by_surface.map(|v| other * v);
            let step = [0, 1, 2].map(|c| traced.own.color[c] - crossing.other.color[c]);
            let by_step = crossing.step.slope * sign * dot(by_surface, step);
            let by_b = self.sample_back(&crossing.other, chunks, by_other, Vector3::zeros(), sums);
            match &crossing.other_place {
                Place::Ray(at, hit) => {
                    self.hit_back(crossing.other.face, *at, hit, by_b, 0.0, sums);
                    self.step_back(&crossing.step, None, by_step, sums);
                }
                Place::Foot => self.step_back(&crossing.step, Some(by_b), by_step, sums),
            }
        }
        match &traced.own_place {
            Place::Ray(at, hit) => {
                let by_b = self.sample_back(&traced.own, chunks, by_own, by.normal, sums);
                self.hit_back(traced.own.face, *at, hit, by_b, by.depth, sums);
                if let Some(edge) = &traced.edge {
                    self.step_back(edge, None, by_distance, sums);
                }
            }
            Place::Foot => {
                let by_b = self.sample_back(&traced.own, chunks, by_own, Vector3::zeros(), sums);
                if let Some(edge) = &traced.edge {
                    self.step_back(edge, Some(by_b), by_distance, sums);
                }
            }
        }
    }

    #[inline]
    fn trace<'a>(&self, decision: &Decision<'a>) -> Option<Traced<'a>> {
        let pixel = [decision.x as f64, decision.y as f64];
        let w = decision.half_width;
        let Some(face) = decision.face else {
            let edge = self.step(decision.edge?, pixel, 1.0, w);
            let own = self.at_foot(&edge);
            let surface = own.color;
            return Some(Traced {
                own,
                own_place: Place::Foot,
                crossing: None,
                edge: Some(edge),
                surface,
            });
        };
        let (own, at) = self.at_pixel(face, pixel);
        let crossing = decision.inner.map(|inner| {
            // The pixel shows the far surface beyond the contour, and the near one before it.
            let own_is_near = at.z <= f64::from(inner.split);
            let side = if own_is_near { -1.0 } else { 1.0 };
            let step = self.step(&inner.piece, pixel, side, w);
            let (other, other_place) = if own_is_near {
                let (u, v, face, _) = inner.behind;
                let behind = [f64::from(u), f64::from(v)];
                let (sample, hit) = self.at_pixel(face as usize, behind);
                (sample, Place::Ray(behind, hit))
            } else {
                (self.at_foot(&step), Place::Foot)
            };
            Crossing { step, other, other_place, own_is_near }
        });
        let surface = crossing.as_ref().map_or(own.color, |crossing| {
            let (near, far) = match crossing.own_is_near {
                true => (own.color, crossing.other.color),
                false => (crossing.other.color, own.color),
            };
            mix(crossing.step.alpha, near, far)
        });
        let edge = decision.edge.map(|piece| self.step(piece, pixel, -1.0, w));
        Some(Traced { own, own_place: Place::Ray(pixel, at), crossing, edge, surface })
    }

    #[inline]
    fn at_pixel(&self, face: usize, [u, v]: [f64; 2]) -> (Sample, Hit) {
        let hit = hit(&self.frame.corners(face), &self.frame.camera.ray(u, v));
        (self.sample(face, hit.b), hit)
    }

    #[inline]
    fn at_foot(&self, step: &Step) -> Sample {
        let mut b = [0.0; 3];
        b[step.piece.corners[0] as usize] = 1.0 - step.share;
        b[step.piece.corners[1] as usize] = step.share;
        self.sample(step.piece.face as usize, b)
    }

    #[inline]
    fn step<'a>(&self, piece: &'a Piece, pixel: [f64; 2], side: f64, w: f64) -> Step<'a> {
        let range = piece.range.map(f64::from);
        let foot = Foot { pixel, range, outward: piece.outward.map(f64::from), side };
        let [share, distance] = foot.evaluate(self.foot_inputs(piece));
        let (alpha, slope) = falling_step(distance, w);
        Step { piece, foot, share, alpha, slope }
    }

    /// What [`Foot`] is a function of.
    #[inline]
    fn foot_inputs(&self, piece: &Piece) -> [f64; 10] {
        let corners = self.frame.corners(piece.face as usize);
        let [a, b] = piece.corners.map(|c| corners[c as usize]);
        let camera = &self.frame.camera;
        [a.x, a.y, a.z, b.x, b.y, b.z, camera.fx, camera.fy, camera.cx, camera.cy]
    }

    /// Carries the adjoint of a signed distance back, and those of barycentric coordinates of its foot.
    #[inline]
    fn step_back(&self, step: &Step, by_b: Option<[f64; 3]>, by_distance: f64, sums: &mut Sums) {
        let corners = step.piece.corners.map(|c| c as usize);
        let by_share = by_b.map_or(0.0, |by_b| by_b[corners[1]] - by_b[corners[0]]);
        if by_share == 0.0 && by_distance == 0.0 {
            return;
        }
        let (_, [of_share, of_distance]) = step.foot.linearise(self.foot_inputs(step.piece));
        let by = |i: usize| by_share * of_share[i] + by_distance * of_distance[i];
        let face = sums.face(step.piece.face as usize);
        face.position[corners[0]] += Vector3::new(by(0), by(1), by(2));
        face.position[corners[1]] += Vector3::new(by(3), by(4), by(5));
        (0..4).for_each(|i| sums.intrinsics[i] += by(6 + i));
    }

    /// Carries the adjoints of a hit back.
    #[inline]
    fn hit_back(
        &self,
        face: usize,
        [u, v]: [f64; 2],
        hit: &Hit,
        by_b: [f64; 3],
        by_z: f64,
        sums: &mut Sums,
    ) {
        let camera = &self.frame.camera;
        let ray = camera.ray(u, v);
        let corners = self.frame.corners(face);
        let Some(by) = hit_adjoint(&corners, &ray, hit, by_b, by_z) else { return };
        let of_face = sums.face(face);
        (0..3).for_each(|k| of_face.position[k] += by.corners[k]);
        // The ray is ((u − cx)/fx, (v − cy)/fy, 1).
        let (by_cx, by_cy) = (-by.ray.x / camera.fx, -by.ray.y / camera.fy);
        let by_intrinsics = [by_cx * ray.x, by_cy * ray.y, by_cx, by_cy];
        (0..4).for_each(|i| sums.intrinsics[i] += by_intrinsics[i]);
    }
}
