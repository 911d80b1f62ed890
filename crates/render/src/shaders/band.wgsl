// For each pixel of a tile, the nearest piece of a list, if within the band.
#define_import_path prehend::band

#import prehend::contour::{contour_pixel, foot_of}
#import prehend::mesh::NONE
#import prehend::params::params
#import prehend::pieces::pieces
#import prehend::pixel::Pixel
#import prehend::tallies::{region_of, tallies}
#import prehend::tiles::{TILE, TILE_PIXELS, pixel_index, touches_tile}
#import prehend::z_buffer::visible

struct BandPiece {
    a: vec2<f32>,
    b: vec2<f32>,
    range: vec2<f32>,
    edge: u32,
    part: u32,
    index: u32,
}

var<workgroup> band_batch: array<BandPiece, 64>;
var<workgroup> band_batch_count: atomic<u32>;
var<workgroup> band_end: u32;

// Whether a piece comes within the band of any pixel of a tile.
fn reaches_tile(piece: u32, tile: vec2<u32>) -> bool {
    let d = pieces[piece].b - pieces[piece].a;
    let p = pieces[piece].a + pieces[piece].range.x * d;
    let q = pieces[piece].a + pieces[piece].range.y * d;
    // Rounding must not lose a pixel; those beyond the band are told by their distance.
    let reach = params.half_width + 0.01;
    let low = vec2<f32>(tile * TILE);
    let high = low + f32(TILE - 1u);
    return all(max(p, q) + reach >= low) && all(min(p, q) - reach <= high);
}

// To be called by a whole workgroup. Searches the pieces from `first` on; ties go to the lower edge, then the lower part.
fn nearest_piece(lane: u32, tile: vec2<u32>, p: vec2<f32>, first: u32, count: u32) -> u32 {
    var found = NONE;
    var best = params.half_width * params.half_width;
    var best_edge = 0u;
    var best_part = 0u;
    if lane == 0u {
        band_end = count;
    }
    let end = workgroupUniformLoad(&band_end);
    for (var start = 0u; start < end; start += TILE_PIXELS) {
        if lane == 0u {
            atomicStore(&band_batch_count, 0u);
        }
        workgroupBarrier();
        if start + lane < end {
            let piece = first + start + lane;
            if reaches_tile(piece, tile) {
                let slot = atomicAdd(&band_batch_count, 1u);
                band_batch[slot] = BandPiece(
                    pieces[piece].a,
                    pieces[piece].b,
                    pieces[piece].range,
                    pieces[piece].edge,
                    pieces[piece].part,
                    piece,
                );
            }
        }
        workgroupBarrier();
        let batch = atomicLoad(&band_batch_count);
        for (var i = 0u; i < batch; i++) {
            let piece = &band_batch[i];
            let d = foot_of((*piece).a, (*piece).b, (*piece).range, p).distance_squared;
            let earlier = (*piece).edge < best_edge
                || ((*piece).edge == best_edge && (*piece).part < best_part);
            if d < best || (d == best && found != NONE && earlier) {
                best = d;
                best_edge = (*piece).edge;
                best_part = (*piece).part;
                found = (*piece).index;
            }
        }
        workgroupBarrier();
    }
    return found;
}

// The pixel of this thread in the contour mode; to be called by a whole workgroup.
fn seen_in_contour_mode(h: u32, lane: u32, tile: vec2<u32>, pixel: vec2<u32>) -> Pixel {
    let active_tile = touches_tile(region_of(h), tile);
    let outlines = select(0u, min(atomicLoad(&tallies[h].outline), params.piece_capacity), active_tile);
    let inners = select(0u, min(atomicLoad(&tallies[h].inner), params.piece_capacity), active_tile);
    let p = vec2<f32>(pixel);
    let first = h * params.piece_capacity;
    let outline = nearest_piece(lane, tile, p, first, outlines);
    let inner = nearest_piece(lane, tile, p, first + params.piece_capacity - inners, inners);
    var out: Pixel;
    if active_tile && all(pixel < params.size) {
        out = contour_pixel(h, p, visible[pixel_index(h, pixel)], outline, inner);
    }
    return out;
}
