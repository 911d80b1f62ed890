//! The contour mode: a hard z-buffer inside, a smooth step across outlines and inner contours, with the same equations as
//! the loss of a pose.

use glam::vec2;
use nalgebra::Vector3;
use prehend_autodiff::{Fwd, LocalFunction};
use rayon::prelude::*;

use super::frame::{Flat, Frame};
use super::geometry::{Hit, ScreenFoot, hit, hit_adjoint};
use super::sums::Sums;
use super::visibility::{BlendAdjoint, PartAdjoint, PixelBlend, Visibility, VisiblePart};
use crate::contour::{
    Band, Crease, Inner, LEAST_STEP, Piece, creases, falling_step, inner_contours, outline,
};
use crate::mode::ContourOptions;
use crate::projected::Region;
use crate::raster::{MISS, Visible, rasterize};

/// Visible faces, and the contours near each pixel.
pub(super) struct Contours {
    half_width: f64,
    pub(super) outline: Vec<Piece>,
    pub(super) inner: Vec<Inner>,
    creases: Vec<Crease>,
    pub(super) blocks: Vec<ContourBlock>,
}

/// Visible faces and nearby contours of a block of rows.
pub(super) struct ContourBlock {
    pub(super) visible: Visible,
    /// Outline piece, inner contour and crease in whose band each pixel is.
    edge: Vec<u32>,
    inner: Vec<u32>,
    crease: Vec<u32>,
    /// The side of the crease: −1, 1, or 0 where the pixel shows another surface.
    side: Vec<f32>,
}

/// Face at a pixel's center, and the contours near it.
#[derive(Clone, Copy)]
pub(super) struct Decision<'a> {
    pub(super) face: Option<usize>,
    pub(super) edge: Option<&'a Piece>,
    pub(super) inner: Option<&'a Inner>,
    /// With the side that the pixel is on.
    pub(super) crease: Option<(&'a Crease, f32)>,
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
    foot: ScreenFoot,
    /// Share of the edge in space at the foot.
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

/// A crease next to a pixel.
#[derive(Clone, Copy)]
struct Fold {
    /// Its weight is the share of the jump that the pixel gains. On the side of the pixel.
    step: Step,
    /// The edge as the face beyond has it.
    beyond: Piece,
}

/// All that makes a pixel: its own part, that across an inner contour, what lies beyond a crease, and the outline.
#[derive(Clone, Copy, Default)]
pub(super) struct Trace {
    own: Option<Site>,
    crossing: Option<Crossing>,
    fold: Option<Fold>,
    edge: Option<Step>,
}

impl Trace {
    fn alpha(&self) -> f64 {
        self.edge.map_or(1.0, |edge| edge.alpha)
    }

    /// Shares of the own part and the one across an inner contour in the surface.
    fn sides(&self) -> [f64; 2] {
        match &self.crossing {
            None => [1.0, 0.0],
            Some(Crossing { step, own_is_near: true, .. }) => [step.alpha, 1.0 - step.alpha],
            Some(Crossing { step, .. }) => [1.0 - step.alpha, step.alpha],
        }
    }

    /// Shares of all parts in the surface: of the sides, and of the two faces at a crease.
    fn shares(&self) -> impl Iterator<Item = f64> {
        let [own, other] = self.sides();
        let jump = self.fold.map_or(0.0, |fold| own * fold.step.alpha);
        let sides = [Some(own), self.crossing.map(|_| other)];
        let fold = self.fold.map(|_| [-jump, jump]);
        sides.into_iter().flatten().chain(fold.into_iter().flatten())
    }
}

impl Contours {
    pub(super) fn new(frame: &Frame, mut flat: Flat, options: &ContourOptions) -> Self {
        let half_width = options.drawn_half_width();
        let edges = std::mem::take(&mut flat.creases);
        let projected = frame.projected(&mut flat);
        let region = projected.region;
        let visible = rasterize(&projected, &region);
        let (mut pieces, mut inner, mut folds) = (Vec::new(), Vec::new(), Vec::new());
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
            if options.creases {
                let least = |face: u32| {
                    let body = &frame.bodies[frame.body_of(face as usize)];
                    LEAST_STEP * body.model.radius() as f32
                };
                let edges = edges.iter();
                folds = creases(&projected, &visible, edges, &region, half_width, least);
            }
        }
        let blocks = visible.into_par_iter().map(|visible| {
            let edge = Band::new(pieces.iter(), &visible.region, half_width).piece;
            let inner_pieces = inner.iter().map(|inner: &Inner| &inner.piece);
            let inner = Band::new(inner_pieces, &visible.region, half_width).piece;
            let pieces = folds.iter().map(|fold: &Crease| &fold.piece);
            let crease = Band::new(pieces, &visible.region, half_width).piece;
            let side = |(i, index): (usize, &u32)| {
                let (Some(fold), true) = (folds.get(*index as usize), visible.face[i] != MISS)
                else {
                    return 0.0;
                };
                let (x, y) = visible.position(i);
                let at = vec2(x as f32, y as f32);
                let foot = fold.piece.foot(at);
                fold.side(&projected, at, &foot, visible.inverse_z[i]).unwrap_or(0.0)
            };
            let side = crease.iter().enumerate().map(side).collect();
            ContourBlock { visible, edge, inner, crease, side }
        });
        let blocks = blocks.collect();
        Self { half_width: f64::from(half_width), outline: pieces, inner, creases: folds, blocks }
    }

    pub(super) fn decision(&self, block: usize, i: usize) -> Decision<'_> {
        let block = &self.blocks[block];
        let face = block.visible.face[i];
        Decision {
            face: (face != MISS).then_some(face as usize),
            edge: self.outline.get(block.edge[i] as usize),
            inner: self.inner.get(block.inner[i] as usize),
            crease: self
                .creases
                .get(block.crease[i] as usize)
                .filter(|_| block.side[i] != 0.0)
                .map(|crease| (crease, block.side[i])),
        }
    }

    /// The step across a contour at a pixel inside (`side` −1) or outside (1).
    #[inline]
    fn step(&self, frame: &Frame, piece: &Piece, pixel: [f64; 2], side: f64) -> Step {
        let range = piece.range.map(f64::from);
        let foot =
            ScreenFoot { pixel, range, outward: piece.outward.to_array().map(f64::from), side };
        let [share, distance] = foot.evaluate(foot_inputs(frame, piece));
        let (alpha, slope) = falling_step(distance, self.half_width);
        Step { piece: *piece, foot, share, alpha, slope }
    }

    /// The jump at a crease next to a pixel on the given side.
    #[inline]
    fn fold(&self, frame: &Frame, crease: &Crease, pixel: [f64; 2], side: f32) -> Fold {
        let side = f64::from(side);
        let mut step = self.step(frame, &crease.piece, pixel, side);
        let mut beyond = crease.reversed();
        // The share falls on both sides alike, by the distance without its sign.
        if side > 0.0 {
            std::mem::swap(&mut step.piece, &mut beyond);
        } else {
            step.alpha = 1.0 - step.alpha;
            step.slope = -step.slope;
        }
        Fold { step, beyond }
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

/// Inputs of [`ScreenFoot`]: both ends of the edge, camera frame \[m\], and fx, fy, cx, cy \[px\].
#[inline]
fn foot_inputs(frame: &Frame, piece: &Piece) -> [f64; 10] {
    let corners = frame.corners(piece.face as usize);
    let [a, b] = piece.corners.map(|c| corners[c as usize]);
    let camera = &frame.camera;
    [a.x, a.y, a.z, b.x, b.y, b.z, camera.fx, camera.fy, camera.cx, camera.cy]
}

/// The part of weight `weight` where the ray through an image position meets a face.
#[inline]
fn at_pixel(frame: &Frame, face: usize, at: [f64; 2], weight: f64) -> (VisiblePart, Hit) {
    let hit = hit(&frame.corners(face), &frame.camera.ray(at[0], at[1]));
    (VisiblePart { face, b: hit.b, weight }, hit)
}

/// That at the foot on a contour.
#[inline]
fn at_foot(piece: &Piece, share: f64, weight: f64) -> VisiblePart {
    let mut b = [0.0; 3];
    b[piece.corners[0] as usize] = 1.0 - share;
    b[piece.corners[1] as usize] = share;
    VisiblePart { face: piece.face as usize, b, weight }
}

/// The adjoint of the foot's share of its edge, from those of its barycentric coordinates.
#[inline]
fn by_share(piece: &Piece, by_b: [f64; 3]) -> f64 {
    by_b[piece.corners[1] as usize] - by_b[piece.corners[0] as usize]
}

/// Carries the adjoints of a signed distance and of the foot's share of its edge back.
#[inline]
fn step_back(frame: &Frame, step: &Step, by_share: f64, by_distance: f64, sums: &mut Sums) {
    let corners = step.piece.corners.map(|c| c as usize);
    if by_share == 0.0 && by_distance == 0.0 {
        return;
    }
    let inputs = Fwd::<10>::variables(foot_inputs(frame, &step.piece));
    let [share, distance] = step.foot.evaluate(inputs).map(|result| result.derivative);
    let by = |i: usize| by_share * share[i] + by_distance * distance[i];
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
        parts: &mut Vec<VisiblePart>,
    ) -> Option<PixelBlend> {
        let decision = self.decision(block, i);
        let Some(face) = decision.face else {
            let edge = self.step(frame, decision.edge?, at, 1.0);
            *trace = Trace { own: Some(Site::Foot), edge: Some(edge), ..Trace::default() };
            parts.push(at_foot(&edge.piece, edge.share, edge.alpha));
            return Some(PixelBlend {
                background: 1.0 - edge.alpha,
                alpha: edge.alpha,
                center: None,
            });
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
                let (behind, face, _) = inner.behind;
                let behind = behind.to_array().map(f64::from);
                let (part, hit) = at_pixel(frame, face as usize, behind, 0.0);
                (part, Site::Ray(behind, hit))
            } else {
                (at_foot(&step.piece, step.share, 0.0), Site::Foot)
            };
            trace.crossing = Some(Crossing { step, other, own_is_near });
            parts.push(part);
        }
        if let Some((crease, side)) = decision.crease {
            let fold = self.fold(frame, crease, at, side);
            parts.extend([fold.step.piece, fold.beyond].map(|p| at_foot(&p, fold.step.share, 0.0)));
            trace.fold = Some(fold);
        }
        for (part, share) in parts.iter_mut().zip(trace.shares()) {
            part.weight = alpha * share;
        }
        Some(PixelBlend { background: 1.0 - alpha, alpha, center: Some((0, hit.z)) })
    }

    #[inline]
    fn trace_back(
        &self,
        frame: &Frame,
        trace: &Trace,
        parts: &[VisiblePart],
        by_parts: &[PartAdjoint],
        by: &BlendAdjoint,
        sums: &mut Sums,
    ) {
        let Some(own) = &trace.own else { return };
        let by_surface: f64 =
            trace.shares().zip(by_parts).map(|(share, by)| share * by.weight).sum();
        let by_edge = trace.edge.map_or(0.0, |e| e.slope * (by_surface - by.background + by.alpha));
        let mut by_own = by_parts[0].weight;
        if let (Some(fold), [.., by_here, by_beyond]) = (&trace.fold, by_parts) {
            let step = &fold.step;
            let by_jump = by_beyond.weight - by_here.weight;
            by_own += step.alpha * by_jump;
            let by_foot = by_share(&step.piece, by_here.b) + by_share(&fold.beyond, by_beyond.b);
            let by_distance = step.slope * trace.sides()[0] * trace.alpha() * by_jump;
            step_back(frame, step, by_foot, by_distance, sums);
        }
        if let (Some(crossing), Some(by_other)) = (&trace.crossing, by_parts.get(1)) {
            let step = &crossing.step;
            let sign = if crossing.own_is_near { 1.0 } else { -1.0 };
            let by_step = step.slope * sign * trace.alpha() * (by_own - by_other.weight);
            let by_foot = match &crossing.other {
                Site::Ray(at, hit) => {
                    hit_back(frame, parts[1].face, *at, hit, by_other.b, 0.0, sums);
                    0.0
                }
                Site::Foot => by_share(&step.piece, by_other.b),
            };
            step_back(frame, step, by_foot, by_step, sums);
        }
        let by_foot = match own {
            Site::Ray(at, hit) => {
                hit_back(frame, parts[0].face, *at, hit, by_parts[0].b, by.depth, sums);
                0.0
            }
            Site::Foot => trace.edge.map_or(0.0, |e| by_share(&e.piece, by_parts[0].b)),
        };
        if let Some(edge) = &trace.edge {
            step_back(frame, edge, by_foot, by_edge, sums);
        }
    }
}
