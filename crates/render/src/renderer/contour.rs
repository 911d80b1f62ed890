//! The contour mode: a hard z-buffer inside, a smooth step across outlines and inner contours, with the same equations as
//! the loss of a pose.

use nalgebra::Vector3;
use prehend_autodiff::LocalFunction;
use rayon::prelude::*;

use super::frame::{Flat, Frame};
use super::geometry::{Foot, Hit, hit, hit_adjoint};
use super::sums::Sums;
use super::visibility::{Blend, BlendAdjoint, Part, PartAdjoint, Visibility};
use crate::contour::{Band, Inner, LEAST_STEP, Piece, falling_step, inner_contours, outline};
use crate::projected::Region;
use crate::raster::{MISS, Visible, rasterise};

/// Visible faces, and the contours near each pixel.
pub(super) struct Contours {
    half_width: f64,
    pub(super) outline: Vec<Piece>,
    pub(super) inner: Vec<Inner>,
    pub(super) blocks: Vec<Block>,
}

/// What is visible in a block of rows.
pub(super) struct Block {
    pub(super) visible: Visible,
    /// Outline piece and inner contour in whose band each pixel is.
    edge: Vec<u32>,
    inner: Vec<u32>,
}

/// What was decided about a pixel: which face is at its centre, and which contours are near.
#[derive(Clone, Copy)]
pub(super) struct Decision<'a> {
    pub(super) face: Option<usize>,
    pub(super) edge: Option<&'a Piece>,
    pub(super) inner: Option<&'a Inner>,
}

/// Where a part of a pixel lies on its face.
#[derive(Clone, Copy)]
enum Site {
    /// Where the ray through an image position meets it.
    Ray([f64; 2], Hit),
    /// At the foot on the contour.
    Foot,
}

/// A contour next to a pixel.
#[derive(Clone, Copy)]
struct Step {
    piece: Piece,
    foot: Foot,
    /// Of the edge in space.
    share: f64,
    /// Weight of the near side, and its derivative by the signed distance.
    alpha: f64,
    slope: f64,
}

/// The other surface at an inner contour; the nearer of it and the pixel's own has the step's weight.
#[derive(Clone, Copy)]
struct Crossing {
    step: Step,
    other: Site,
    own_is_near: bool,
}

/// All that makes a pixel: its own part, that across an inner contour, and the outline.
#[derive(Clone, Copy, Default)]
pub(super) struct Trace {
    own: Option<Site>,
    crossing: Option<Crossing>,
    edge: Option<Step>,
}

impl Trace {
    fn alpha(&self) -> f64 {
        self.edge.map_or(1.0, |edge| edge.alpha)
    }

    /// Shares of the own part and the other in the surface.
    fn shares(&self) -> [f64; 2] {
        match &self.crossing {
            None => [1.0, 0.0],
            Some(Crossing { step, own_is_near: true, .. }) => [step.alpha, 1.0 - step.alpha],
            Some(Crossing { step, .. }) => [1.0 - step.alpha, step.alpha],
        }
    }
}

impl Contours {
    pub(super) fn new(frame: &Frame, mut flat: Flat, half_width: f32) -> Self {
        let projected = frame.projected(&mut flat);
        let region = projected.region;
        let visible = rasterise(&projected, &region);
        let (mut pieces, mut inner) = (Vec::new(), Vec::new());
        if region != Region::EMPTY {
            let silhouette = outline(&projected, &region, half_width);
            pieces = silhouette.outline;
            // Small steps between parts of one object are folds; the border between two objects is a contour.
            let least = |near: u32, far: u32| {
                let (near, far) = (frame.body_of(near as usize), frame.body_of(far as usize));
                let radius = frame.bodies[near].model.radius();
                (near == far).then_some(LEAST_STEP * radius as f32)
            };
            inner = inner_contours(&projected, &visible, silhouette.covered, least);
        }
        let blocks = visible.into_par_iter().map(|visible| {
            let edge = Band::new(pieces.iter(), &visible.region, half_width).piece;
            let inner_pieces = inner.iter().map(|inner: &Inner| &inner.piece);
            let inner = Band::new(inner_pieces, &visible.region, half_width).piece;
            Block { visible, edge, inner }
        });
        let blocks = blocks.collect();
        Self { half_width: f64::from(half_width), outline: pieces, inner, blocks }
    }

    pub(super) fn decision(&self, block: usize, i: usize) -> Decision<'_> {
        let block = &self.blocks[block];
        let face = block.visible.face[i];
        Decision {
            face: (face != MISS).then_some(face as usize),
            edge: self.outline.get(block.edge[i] as usize),
            inner: self.inner.get(block.inner[i] as usize),
        }
    }

    /// The step across a contour at a pixel inside (`side` −1) or outside (1).
    #[inline]
    fn step(&self, frame: &Frame, piece: &Piece, pixel: [f64; 2], side: f64) -> Step {
        let range = piece.range.map(f64::from);
        let foot = Foot { pixel, range, outward: piece.outward.map(f64::from), side };
        let [share, distance] = foot.evaluate(foot_inputs(frame, piece));
        let (alpha, slope) = falling_step(distance, self.half_width);
        Step { piece: *piece, foot, share, alpha, slope }
    }
}

/// Whether the pixel of face `own` at depth `z` shows the near side of a contour, and not what lies behind.
#[inline]
fn is_near(frame: &Frame, inner: &Inner, own: usize, z: f64) -> bool {
    let (.., behind, _) = inner.behind;
    let [own, near, far] =
        [own, inner.piece.face as usize, behind as usize].map(|face| frame.body_of(face));
    // Where two objects touch, depth does not tell.
    if near != far && (own == near || own == far) {
        own == near
    } else {
        z <= f64::from(inner.split)
    }
}

/// What [`Foot`] is a function of.
#[inline]
fn foot_inputs(frame: &Frame, piece: &Piece) -> [f64; 10] {
    let corners = frame.corners(piece.face as usize);
    let [a, b] = piece.corners.map(|c| corners[c as usize]);
    let camera = &frame.camera;
    [a.x, a.y, a.z, b.x, b.y, b.z, camera.fx, camera.fy, camera.cx, camera.cy]
}

/// The part of weight `weight` where the ray through an image position meets a face.
#[inline]
fn at_pixel(frame: &Frame, face: usize, at: [f64; 2], weight: f64) -> (Part, Hit) {
    let hit = hit(&frame.corners(face), &frame.camera.ray(at[0], at[1]));
    (Part { face, b: hit.b, weight }, hit)
}

/// That at the foot on a contour.
#[inline]
fn at_foot(step: &Step, weight: f64) -> Part {
    let mut b = [0.0; 3];
    b[step.piece.corners[0] as usize] = 1.0 - step.share;
    b[step.piece.corners[1] as usize] = step.share;
    Part { face: step.piece.face as usize, b, weight }
}

/// Carries the adjoint of a signed distance back, and those of barycentric coordinates of its foot.
#[inline]
fn step_back(frame: &Frame, step: &Step, by_b: [f64; 3], by_distance: f64, sums: &mut Sums) {
    let corners = step.piece.corners.map(|c| c as usize);
    let by_share = by_b[corners[1]] - by_b[corners[0]];
    if by_share == 0.0 && by_distance == 0.0 {
        return;
    }
    let (_, [of_share, of_distance]) = step.foot.linearise(foot_inputs(frame, &step.piece));
    let by = |i: usize| by_share * of_share[i] + by_distance * of_distance[i];
    let face = sums.face(step.piece.face as usize);
    face.position[corners[0]] += Vector3::new(by(0), by(1), by(2));
    face.position[corners[1]] += Vector3::new(by(3), by(4), by(5));
    (0..4).for_each(|i| sums.intrinsics[i] += by(6 + i));
}

/// Carries the adjoints of a hit back.
#[inline]
fn hit_back(
    frame: &Frame,
    face: usize,
    [u, v]: [f64; 2],
    hit: &Hit,
    by_b: [f64; 3],
    by_z: f64,
    sums: &mut Sums,
) {
    let camera = &frame.camera;
    let ray = camera.ray(u, v);
    let Some(by) = hit_adjoint(&frame.corners(face), &ray, hit, by_b, by_z) else { return };
    let of_face = sums.face(face);
    (0..3).for_each(|k| of_face.position[k] += by.corners[k]);
    // The ray is ((u − cx)/fx, (v − cy)/fy, 1).
    let (by_cx, by_cy) = (-by.ray.x / camera.fx, -by.ray.y / camera.fy);
    let by_intrinsics = [by_cx * ray.x, by_cy * ray.y, by_cx, by_cy];
    (0..4).for_each(|i| sums.intrinsics[i] += by_intrinsics[i]);
}

impl Visibility for Contours {
    type Trace = Trace;

    fn regions(&self) -> Vec<Region> {
        self.blocks.iter().map(|block| block.visible.region).collect()
    }

    #[inline]
    fn trace(
        &self,
        frame: &Frame,
        block: usize,
        i: usize,
        at: [f64; 2],
        trace: &mut Trace,
        parts: &mut Vec<Part>,
    ) -> Option<Blend> {
        let decision = self.decision(block, i);
        let Some(face) = decision.face else {
            let edge = self.step(frame, decision.edge?, at, 1.0);
            *trace = Trace { own: Some(Site::Foot), crossing: None, edge: Some(edge) };
            parts.push(at_foot(&edge, edge.alpha));
            return Some(Blend { background: 1.0 - edge.alpha, alpha: edge.alpha, center: None });
        };
        let (own, hit) = at_pixel(frame, face, at, 1.0);
        *trace = Trace { own: Some(Site::Ray(at, hit)), ..Trace::default() };
        trace.edge = decision.edge.map(|piece| self.step(frame, piece, at, -1.0));
        let alpha = trace.alpha();
        parts.push(own);
        if let Some(inner) = decision.inner {
            // The pixel shows the far surface beyond the contour, and the near one before it.
            let own_is_near = is_near(frame, inner, face, hit.z);
            let side = if own_is_near { -1.0 } else { 1.0 };
            let step = self.step(frame, &inner.piece, at, side);
            let (part, other) = if own_is_near {
                let (u, v, face, _) = inner.behind;
                let behind = [f64::from(u), f64::from(v)];
                let (part, hit) = at_pixel(frame, face as usize, behind, 0.0);
                (part, Site::Ray(behind, hit))
            } else {
                (at_foot(&step, 0.0), Site::Foot)
            };
            trace.crossing = Some(Crossing { step, other, own_is_near });
            parts.push(part);
        }
        for (part, share) in parts.iter_mut().zip(trace.shares()) {
            part.weight = alpha * share;
        }
        Some(Blend { background: 1.0 - alpha, alpha, center: Some((0, hit.z)) })
    }

    #[inline]
    fn trace_back(
        &self,
        frame: &Frame,
        trace: &Trace,
        parts: &[Part],
        by_parts: &[PartAdjoint],
        by: &BlendAdjoint,
        sums: &mut Sums,
    ) {
        let Some(own) = &trace.own else { return };
        let shares = trace.shares().into_iter();
        let by_surface: f64 = shares.zip(by_parts).map(|(share, by)| share * by.weight).sum();
        let by_edge = trace.edge.map_or(0.0, |e| e.slope * (by_surface - by.background + by.alpha));
        if let (Some(crossing), [by_own, by_other]) = (&trace.crossing, by_parts) {
            let step = &crossing.step;
            let sign = if crossing.own_is_near { 1.0 } else { -1.0 };
            let by_step = step.slope * sign * trace.alpha() * (by_own.weight - by_other.weight);
            let by_foot = match &crossing.other {
                Site::Ray(at, hit) => {
                    hit_back(frame, parts[1].face, *at, hit, by_other.b, 0.0, sums);
                    [0.0; 3]
                }
                Site::Foot => by_other.b,
            };
            step_back(frame, step, by_foot, by_step, sums);
        }
        let by_foot = match own {
            Site::Ray(at, hit) => {
                hit_back(frame, parts[0].face, *at, hit, by_parts[0].b, by.depth, sums);
                [0.0; 3]
            }
            Site::Foot => by_parts[0].b,
        };
        if let Some(edge) = &trace.edge {
            step_back(frame, edge, by_foot, by_edge, sums);
        }
    }
}
