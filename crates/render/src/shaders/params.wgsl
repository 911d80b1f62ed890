// The settings of a session and of a call. The struct mirrors `backend/gpu/layout.rs`; a test compares sizes and offsets.
#define_import_path prehend::params

// How the unlit colors are stored.
const ALBEDO_UNIFORM: u32 = 0u;
const ALBEDO_CORNERS: u32 = 1u;
const ALBEDO_TEXTURE: u32 = 2u;

// Robust kernels of a color residual.
const KERNEL_SQUARED: u32 = 0u;
const KERNEL_HUBER: u32 = 1u;
const KERNEL_CAUCHY: u32 = 2u;
const KERNEL_GEMAN_MCCLURE: u32 = 3u;
const KERNEL_TUKEY: u32 = 4u;

// Flags of the SoftRas mode.
const SOFT_MODE: u32 = 1u;
const SOFT_PERSPECTIVE: u32 = 2u;
const SOFT_CLIP: u32 = 4u;
const SOFT_CULL: u32 = 8u;
const SOFT_FADE: u32 = 16u;

// `Params.faces_per_pixel` is no larger.
const MOST_FACES: u32 = 64u;

struct Params {
    // Columns and rows of the image, and of the grid of tiles.
    size: vec2<u32>,
    tiles: vec2<u32>,
    focal: vec2<f32>,
    principal: vec2<f32>,
    // Pixels that are visited besides those that the model may cover: first column and row, ends.
    bounds: vec4<u32>,
    vertices: u32,
    faces: u32,
    edges: u32,
    hypotheses: u32,
    // Places in the work buffers: face references of all tiles, segments and pieces of a hypothesis.
    entry_capacity: u32,
    segment_capacity: u32,
    piece_capacity: u32,
    closed: u32,
    albedo_kind: u32,
    levels: u32,
    // Pixels around the projected model that may be covered, the half-width of the contour band [px], and the least depth
    // step of an inner contour [m].
    margin: f32,
    half_width: f32,
    albedo: vec3<f32>,
    least_step: f32,
    color_weight: f32,
    mask_weight: f32,
    // Zero leaves depth out.
    depth_weight: f32,
    depth_scale: f32,
    depth_truncation: f32,
    kernel_kind: u32,
    kernel_scale: f32,
    penalize_occluded: u32,
    // SoftRas, in pixels: how far beyond its border a face may be kept [px], and its square [px²]; 1/σ [1/px²]; how fast the
    // logarithm of a weight falls with depth [1/m], and the depth of the background [m]; the least double area of a face and
    // squared length of an edge [px²].
    reach: f32,
    blur: f32,
    sharpness: f32,
    depth_rate: f32,
    farthest: f32,
    least_area: f32,
    faces_per_pixel: u32,
    soft_flags: u32,
    // Sums are asked for by squares of the image, so wide [px]; so many columns and rows of them; a tile lies in at most so many
    // across, and as many down. One square for the whole image is wider than any.
    side: u32,
    parts: u32,
    squares: vec2<u32>,
    // Of each level of the texture: first texel, columns, rows.
    level: array<vec4<u32>, 24>,
}

@group(0) @binding(0) var<uniform> params: Params;

// Whether a flag of the SoftRas mode is set.
fn soft_flag(flag: u32) -> bool {
    return (params.soft_flags & flag) != 0u;
}
