// What the passes hand on to each other, hypothesis by hypothesis.

// Tiles are squares of this many pixels; one thread a pixel.
const TILE: u32 = 8u;
const TILE_PIXELS: u32 = 64u;

// Larger than any image, so that a minimum can be kept as a maximum and zero means nothing seen.
const FAR_COLUMN: u32 = 0x10000000u;

struct Tally {
    // Pixels that may be covered; the first ones as FAR_COLUMN minus the column or row.
    left: atomic<u32>,
    top: atomic<u32>,
    right: atomic<u32>,
    bottom: atomic<u32>,
    segments: atomic<u32>,
    // Pieces of the outline, stored from the front, and of inner contours, stored from the back.
    outline: atomic<u32>,
    inner: atomic<u32>,
}

// All that is read back.
struct Results {
    // What would have been needed of the buffers: entries of all hypotheses, most segments and pieces of any.
    entries: atomic<u32>,
    segments: atomic<u32>,
    pieces: atomic<u32>,
    // Keeps the values apart from the atomics.
    unused: u32,
    // Sums of each hypothesis (see `residuals.wgsl`), or a picture: color, coverage and depth of each pixel.
    values: array<f32>,
}

struct Bin {
    count: atomic<u32>,
    filled: atomic<u32>,
    start: u32,
}

// A silhouette edge, directed as its visible face runs through it.
struct Segment {
    // Screen positions [px].
    a: vec2<f32>,
    b: vec2<f32>,
    // Layers gained by crossing from the side where a→b runs up the rows.
    layers: f32,
    edge: u32,
    face: u32,
    // Corner of the face where the edge starts, plus four if the face is seen from inside.
    corner: u32,
}

// A piece of a visible contour.
struct Piece {
    a: vec2<f32>,
    b: vec2<f32>,
    // The part of the edge (share of its screen length).
    range: vec2<f32>,
    // Unit normal in the image, away from the object.
    outward: vec2<f32>,
    edge: u32,
    part: u32,
    face: u32,
    corner: u32,
    // Inner contours only: the pixel next to it on the far side (index into the image), the face seen there, its 1/Z [1/m],
    // and the depth half-way between the near and the far surface [m].
    behind_pixel: u32,
    behind_face: u32,
    behind_inverse_z: f32,
    split: f32,
}

// Column, row [px], 1/Z [1/m] (0 where not in front of the camera) and Z [m] of each vertex.
@group(0) @binding(8) var<storage, read_write> screen: array<vec4<f32>>;
@group(0) @binding(9) var<storage, read_write> tallies: array<Tally>;
@group(0) @binding(10) var<storage, read_write> bins: array<Bin>;
@group(0) @binding(11) var<storage, read_write> entries: array<u32>;
// Nearest face and the bits of its 1/Z.
@group(0) @binding(12) var<storage, read_write> visible: array<vec2<u32>>;
@group(0) @binding(13) var<storage, read_write> segments: array<Segment>;
@group(0) @binding(14) var<storage, read_write> pieces: array<Piece>;
// Sums of each tile.
@group(0) @binding(15) var<storage, read_write> partials: array<f32>;
@group(0) @binding(16) var<storage, read_write> results: Results;

// First column and row, and ends, of the pixels that the model may cover.
fn covered_region(h: u32) -> vec4<u32> {
    let left = FAR_COLUMN - atomicLoad(&tallies[h].left);
    let top = FAR_COLUMN - atomicLoad(&tallies[h].top);
    let right = atomicLoad(&tallies[h].right);
    let bottom = atomicLoad(&tallies[h].bottom);
    if left >= right || top >= bottom {
        return vec4<u32>(0u);
    }
    return vec4<u32>(left, top, right, bottom);
}

// The smallest rectangle around what may be covered and what is visited anyway.
fn region_of(h: u32) -> vec4<u32> {
    let covered = covered_region(h);
    if covered.z == 0u {
        return params.bounds;
    }
    if params.bounds.z == 0u {
        return covered;
    }
    return vec4<u32>(min(covered.xy, params.bounds.xy), max(covered.zw, params.bounds.zw));
}

fn touches_tile(region: vec4<u32>, tile: vec2<u32>) -> bool {
    let low = tile * TILE;
    return all(region.zw > low) && all(region.xy < low + TILE);
}

fn tile_index(h: u32, tile: vec2<u32>) -> u32 {
    return h * params.tiles.x * params.tiles.y + tile.y * params.tiles.x + tile.x;
}

fn pixel_index(h: u32, pixel: vec2<u32>) -> u32 {
    return h * params.size.x * params.size.y + pixel.y * params.size.x + pixel.x;
}
