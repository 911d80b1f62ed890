//! The structs shared with the shaders, field by field as in the module that declares each.
//!
//! Vectors of three take sixteen bytes there unless a scalar follows. What bytemuck takes as plain data has no gaps in it.

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3, Vec4};

/// Most levels of a texture's pyramid: enough for 8 million texels a side.
pub(super) const LEVELS: usize = 24;

/// How the unlit colors are stored.
pub(super) const ALBEDO_UNIFORM: u32 = 0;
pub(super) const ALBEDO_CORNERS: u32 = 1;
pub(super) const ALBEDO_TEXTURE: u32 = 2;

/// Robust kernels.
pub(super) const KERNEL_SQUARED: u32 = 0;
pub(super) const KERNEL_HUBER: u32 = 1;
pub(super) const KERNEL_CAUCHY: u32 = 2;
pub(super) const KERNEL_GEMAN_MCCLURE: u32 = 3;
pub(super) const KERNEL_TUKEY: u32 = 4;

/// Flags of the SoftRas mode.
pub(super) const SOFT_MODE: u32 = 1;
pub(super) const SOFT_PERSPECTIVE: u32 = 2;
pub(super) const SOFT_CLIP: u32 = 4;
pub(super) const SOFT_CULL: u32 = 8;
pub(super) const SOFT_FADE: u32 = 16;

/// Pixels along a tile's side.
pub(super) const TILE: usize = 8;

/// Wider than any image \[px\].
pub(super) const WHOLE_SIDE: u32 = 1 << 30;

/// Columns of the sums of a hypothesis.
pub(super) const SUM_COLOR: usize = 0;
pub(super) const SUM_MASK: usize = 1;
pub(super) const SUM_DEPTH: usize = 2;
pub(super) const SUM_GRADIENT: usize = 3;
pub(super) const SUM_HESSIAN: usize = 9;
pub(super) const SUM_COVERED: usize = 30;
pub(super) const SUM_CONTOUR: usize = 31;
pub(super) const SUM_HIDDEN: usize = 32;
pub(super) const SUM_MISSED: usize = 33;
pub(super) const SUM_WITH_DEPTH: usize = 34;
pub(super) const SUM_COLUMNS: usize = 35;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct Params {
    pub(super) size: [u32; 2],
    pub(super) tiles: [u32; 2],
    pub(super) focal: Vec2,
    pub(super) principal: Vec2,
    pub(super) bounds: [u32; 4],
    pub(super) vertices: u32,
    pub(super) faces: u32,
    pub(super) edges: u32,
    pub(super) hypotheses: u32,
    pub(super) entry_capacity: u32,
    pub(super) segment_capacity: u32,
    pub(super) piece_capacity: u32,
    pub(super) closed: u32,
    pub(super) albedo_kind: u32,
    pub(super) levels: u32,
    pub(super) margin: f32,
    pub(super) half_width: f32,
    pub(super) albedo: Vec3,
    pub(super) least_step: f32,
    pub(super) color_weight: f32,
    pub(super) mask_weight: f32,
    pub(super) depth_weight: f32,
    pub(super) depth_scale: f32,
    pub(super) depth_truncation: f32,
    pub(super) kernel_kind: u32,
    pub(super) kernel_scale: f32,
    pub(super) penalize_occluded: u32,
    pub(super) reach: f32,
    pub(super) blur: f32,
    pub(super) sharpness: f32,
    pub(super) depth_rate: f32,
    pub(super) farthest: f32,
    pub(super) least_area: f32,
    pub(super) faces_per_pixel: u32,
    pub(super) soft_flags: u32,
    pub(super) side: u32,
    pub(super) parts: u32,
    pub(super) squares: [u32; 2],
    pub(super) level: [[u32; 4]; LEVELS],
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct Hypothesis {
    /// Columns, the fourth entries unused; likewise below.
    pub(super) rotation: [Vec4; 3],
    pub(super) center: Vec3,
    pub(super) alive: u32,
    pub(super) camera_light: [Vec4; 3],
    pub(super) object_light: [Vec4; 3],
    pub(super) ambient: Vec3,
    pub(super) flat_light: u32,
    pub(super) offset: Vec3,
    pub(super) level: f32,
    pub(super) level_dz: f32,
    pub(super) pad: [u32; 3],
    pub(super) image_center: Vec4,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct Corner {
    pub(super) normal: Vec3,
    pub(super) pad: u32,
    pub(super) paint: Vec3,
    pub(super) pad_2: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct Edge {
    pub(super) vertices: [u32; 2],
    pub(super) face: u32,
    pub(super) other: u32,
    pub(super) corner: u32,
    pub(super) other_corner: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct TargetPixel {
    pub(super) color: Vec3,
    pub(super) coverage: f32,
    pub(super) depth: f32,
    pub(super) occluder: f32,
    pub(super) pad: [u32; 2],
}

/// The front of what is read back; floats follow.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(super) struct Usage {
    pub(super) entries: u32,
    pub(super) segments: u32,
    pub(super) pieces: u32,
    pub(super) unused: u32,
}

/// Sizes of what only the shaders read and write \[bytes\].
pub(super) const SCREEN: usize = 16;
pub(super) const TALLY: usize = 28;
pub(super) const BIN: usize = 12;
pub(super) const ENTRY: usize = 4;
pub(super) const VISIBLE: usize = 8;
pub(super) const SEGMENT: usize = 32;
pub(super) const PIECE: usize = 64;
