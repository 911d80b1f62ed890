// What a session uploads: the settings, the hypotheses, the model and the target. The structs mirror
// `backend/gpu/layout.rs`; a test compares sizes and offsets.

const NONE: u32 = 0xffffffffu;

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
    // Of each level of the texture: first texel, columns, rows.
    level: array<vec4<u32>, 24>,
}

struct Hypothesis {
    // Rotation from the mesh into the camera frame, by columns.
    rotation: mat3x3<f32>,
    // The model's center in the camera frame [m], about which twists turn.
    center: vec3<f32>,
    // Whether everything is finite.
    alive: u32,
    // Directional light of each channel in the camera frame, and in the mesh frame.
    camera_light: mat3x3<f32>,
    object_light: mat3x3<f32>,
    ambient: vec3<f32>,
    // No channel depends on the normal.
    flat_light: u32,
    offset: vec3<f32>,
    // Pyramid level of the texture, and its derivative by the center's Z.
    level: f32,
    level_dz: f32,
    // The projected center: its pixel, which screen positions are relative to, and the rest [px]. Zero in the contour mode,
    // where screen positions are those of the image.
    image_center: vec4<f32>,
}

struct Corner {
    normal: vec3<f32>,
    // Color, or texture coordinates.
    paint: vec3<f32>,
}

struct Edge {
    vertices: vec2<u32>,
    face: u32,
    other: u32,
    corner: u32,
    other_corner: u32,
}

struct TargetPixel {
    color: vec3<f32>,
    coverage: f32,
    // Zero where there is none.
    depth: f32,
    occluder: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> hypotheses: array<Hypothesis>;
@group(0) @binding(2) var<storage, read> positions: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> faces: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read> corners: array<Corner>;
@group(0) @binding(5) var<storage, read> edges: array<Edge>;
// 21 bits a channel.
@group(0) @binding(6) var<storage, read> texels: array<vec2<u32>>;
@group(0) @binding(7) var<storage, read> goal: array<TargetPixel>;
