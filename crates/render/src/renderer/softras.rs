//! The SoftRas mode: the faces of all objects as one set, blended by depth ([`crate::softras`] has the equations).

use nalgebra::Point3;
use rayon::prelude::*;

use super::fragment::Fragment;
use super::frame::{Flat, Frame};
use super::sums::Sums;
use super::visibility::{BlendAdjoint, PartAdjoint, PixelBlend, Visibility, VisiblePart};
use crate::model::NONE;
use crate::projected::Region;
use crate::softras::{
    BACKGROUND, Drawn, Face, FaceTiles, LEAST_SHARE, RUN, Run, Settings, Wide, project,
};

/// The faces that count at each pixel.
pub(super) struct SoftFaces {
    settings: Settings,
    /// Column, row \[px\] and Z \[m\] of the vertices; Z is 0 where it is not in front of the camera.
    screen: Vec<[f64; 3]>,
    pub(super) blocks: Vec<SoftBlock>,
}

/// The faces that count at the pixels of some rows.
pub(super) struct SoftBlock {
    pub(super) region: Region,
    /// Where the faces of each pixel start in `faces`, and the end.
    start: Vec<u32>,
    faces: Vec<u32>,
    /// The nearest that contains the pixel's center, or [`NONE`].
    inside: Vec<u32>,
}

/// A face at the pixel at hand, with p = sigmoid(−d/σ) and 1 − p.
#[derive(Clone, Copy)]
struct Spread {
    fragment: Fragment,
    presence: f64,
    absence: f64,
}

/// Fragments of a pixel and their blend, for the reverse derivative.
#[derive(Default)]
pub(super) struct Trace {
    spreads: Vec<Spread>,
    /// Π (1 − p).
    clear: f64,
    /// The background's share of the color.
    background: f64,
    /// The face whose depth all weights but the background's are relative to.
    drifting: Option<usize>,
    center: Option<usize>,
}

impl SoftFaces {
    /// Decides which faces count, and on which side each is lit.
    pub(super) fn new(frame: &mut Frame, flat: &Flat, settings: Settings) -> Self {
        let vertices = frame.position.iter().map(|p| Point3::from(*p));
        let screen = project(&frame.camera, vertices, &flat.screen);
        let mut facing = std::mem::take(&mut frame.facing);
        let closed = |face: usize| frame.bodies[frame.body_of(face)].model.closed;
        let Drawn { faces, ids } =
            Drawn::new(&frame.faces, &screen, closed, &mut facing, &settings);
        frame.facing = facing;
        let blocks = blocks(&faces, &ids, &flat.region, &settings);
        Self { settings, screen, blocks }
    }

    /// The faces of a pixel, and the one at its center.
    pub(super) fn decision(&self, block: usize, i: usize) -> (&[u32], Option<u32>) {
        let block = &self.blocks[block];
        let faces = &block.faces[block.start[i] as usize..block.start[i + 1] as usize];
        let inside = block.inside[i];
        (faces, (inside != NONE).then_some(inside))
    }

    #[inline]
    pub(super) fn fragment(&self, frame: &Frame, face: usize, at: [f64; 2]) -> Fragment {
        let corners = frame.faces[face].map(|v| self.screen[v as usize]);
        Fragment::new(&corners, at, &self.settings)
    }
}

fn blocks(faces: &[Face], ids: &[u32], region: &Region, settings: &Settings) -> Vec<SoftBlock> {
    let tiles = FaceTiles::new(faces, region);
    let arch = pulp::Arch::new();
    let block = |(y, tiles): (usize, &[Vec<u32>])| {
        let y0 = region.y0 + y * RUN;
        let region = Region { y0, y1: (y0 + RUN).min(region.y1), ..*region };
        let block = SoftBlock { region, start: vec![0], faces: Vec::new(), inside: Vec::new() };
        arch.dispatch(Collect { faces, ids, settings, tiles, block })
    };
    let rows: Vec<&[Vec<u32>]> = tiles.rows().collect();
    rows.into_par_iter().enumerate().map(block).collect()
}

/// The choice of faces for the pixels of a block, compiled for each set of vector instructions.
struct Collect<'a> {
    faces: &'a [Face],
    ids: &'a [u32],
    settings: &'a Settings,
    tiles: &'a [Vec<u32>],
    block: SoftBlock,
}

impl pulp::WithSimd for Collect<'_> {
    type Output = SoftBlock;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) -> SoftBlock {
        let Self { faces, ids, settings, tiles, mut block } = self;
        let region = block.region;
        let mut run = Run::new(Wide::zero(simd));
        for y in region.y0..region.y1 {
            let near = |index: &&u32| faces[**index as usize].touches_row(y);
            for (tile, indices) in tiles.iter().enumerate() {
                let first = region.x0 + tile * RUN;
                let end = (first + RUN).min(region.x1);
                for x0 in (first..end).step_by(S::F32_LANES) {
                    run.collect(faces, indices.iter().filter(near).copied(), [x0, y], settings);
                    for lane in 0..S::F32_LANES.min(end - x0) {
                        let inside = run.inside(lane);
                        block.inside.push(inside.map_or(NONE, |index| ids[index as usize]));
                        block.faces.extend(run.faces(lane).map(|index| ids[index as usize]));
                        block.start.push(block.faces.len() as u32);
                    }
                }
            }
        }
        block
    }
}

impl Visibility for SoftFaces {
    type Trace = Trace;

    fn regions(&self) -> Vec<Region> {
        self.blocks.iter().map(|block| block.region).collect()
    }

    /// With w = p exp((ζ − ζ_max)/γ), the shares are w/(Σ w + δ), and δ/(Σ w + δ) that of the background.
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
        let (faces, inside) = self.decision(block, i);
        if faces.is_empty() {
            return None;
        }
        let settings = &self.settings;
        let (sharpness, rate) = (f64::from(settings.sharpness), f64::from(settings.depth_rate));
        let farthest = f64::from(settings.farthest);
        trace.spreads.clear();
        trace.clear = 1.0;
        let (mut nearest, mut least) = (0, f64::INFINITY);
        for (k, &face) in faces.iter().enumerate() {
            let fragment = self.fragment(frame, face as usize, at);
            let ratio = fragment.distance * sharpness;
            let (presence, absence) = (1.0 / (1.0 + ratio.exp()), 1.0 / (1.0 + (-ratio).exp()));
            trace.clear *= absence;
            trace.spreads.push(Spread { fragment, presence, absence });
            if fragment.z < least {
                (nearest, least) = (k, fragment.z);
            }
        }
        let reference = least.min(farthest);
        let mut background = ((reference - farthest) * rate).exp();
        let bounded = background <= BACKGROUND;
        background = background.max(BACKGROUND);
        let mut sum = background;
        for (spread, &face) in trace.spreads.iter().zip(faces) {
            let Fragment { b, z, .. } = spread.fragment;
            let weight = spread.presence * ((reference - z) * rate).exp();
            sum += weight;
            parts.push(VisiblePart { face: face as usize, b, weight });
        }
        for part in parts.iter_mut() {
            let share = part.weight / sum;
            part.weight = if share > f64::from(LEAST_SHARE) { share } else { 0.0 };
        }
        trace.background = background / sum;
        trace.drifting = (bounded && least < farthest).then_some(nearest);
        trace.center = inside.map(|face| {
            let place = faces.iter().position(|f| *f == face);
            place.unwrap_or_else(|| {
                // Hidden behind as many faces as count.
                let fragment = self.fragment(frame, face as usize, at);
                parts.push(VisiblePart { face: face as usize, b: fragment.b, weight: 0.0 });
                trace.spreads.push(Spread { fragment, presence: 0.0, absence: 1.0 });
                parts.len() - 1
            })
        });
        let center = trace.center.map(|k| (k, trace.spreads[k].fragment.z));
        Some(PixelBlend { background: trace.background, alpha: 1.0 - trace.clear, center })
    }

    /// With the shares ω: d ln w = −(1 − p)/σ dd − dz/(γ (z_far − z_near)), dω_k = ω_k (d ln w_k − Σ ω_j d ln w_j), and
    /// dα = −(1 − α) Σ p/σ dd.
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
        let settings = &self.settings;
        let (sharpness, rate) = (f64::from(settings.sharpness), f64::from(settings.depth_rate));
        let shares = parts.iter().zip(by_parts);
        let mean = trace.background * by.background
            + shares.map(|(part, by)| part.weight * by.weight).sum::<f64>();
        for (k, ((part, by_part), spread)) in
            parts.iter().zip(by_parts).zip(&trace.spreads).enumerate()
        {
            let cover = trace.clear * spread.presence;
            let is_center = trace.center == Some(k);
            if part.weight == 0.0 && cover <= f64::from(LEAST_SHARE) && !is_center {
                continue;
            }
            let by_log = part.weight * (by_part.weight - mean);
            let by_distance = -sharpness * (spread.absence * by_log + cover * by.alpha);
            let mut by_z = -rate * by_log;
            if trace.drifting == Some(k) {
                by_z -= rate * trace.background * (by.background - mean);
            }
            if is_center {
                by_z += by.depth;
            }
            let by_corners = spread.fragment.pull_back(by_part.b, by_z, by_distance);
            projection_back(frame, part.face, &by_corners, sums);
        }
    }
}

/// Carries derivatives by columns, rows and depths of a face's corners back.
#[inline]
fn projection_back(frame: &Frame, face: usize, by: &[[f64; 3]; 3], sums: &mut Sums) {
    let camera = &frame.camera;
    let corners = frame.corners(face);
    let of_face = sums.face(face);
    let mut by_intrinsics = [0.0; 4];
    for ((position, p), [u, v, z]) in of_face.position.iter_mut().zip(&corners).zip(by) {
        let (along_x, along_y) = (u / p.z, v / p.z);
        let (by_x, by_y) = (camera.fx * along_x, camera.fy * along_y);
        position.x += by_x;
        position.y += by_y;
        position.z += z - (by_x * p.x + by_y * p.y) / p.z;
        let own = [along_x * p.x, along_y * p.y, *u, *v];
        (0..4).for_each(|i| by_intrinsics[i] += own[i]);
    }
    (0..4).for_each(|i| sums.intrinsics[i] += by_intrinsics[i]);
}
