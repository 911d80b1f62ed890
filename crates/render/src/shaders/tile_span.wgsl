// The tiles that a face may reach.
#define_import_path prehend::tile_span

#import prehend::hypotheses::hypotheses
#import prehend::params::{SOFT_MODE, params, soft_flag}
#import prehend::screen::{face_screen, facing_of}
#import prehend::soft_face::is_soft_face
#import prehend::tallies::region_of
#import prehend::tiles::TILE

// First and last tile of the pixel centers in the box around a face and its reach.
struct TileSpan {
    first: vec2<u32>,
    last: vec2<u32>,
    some: bool,
}

fn tile_span(h: u32, face: u32) -> TileSpan {
    let c = face_screen(h, face);
    var span = TileSpan(vec2<u32>(0u), vec2<u32>(0u), false);
    let soft = soft_flag(SOFT_MODE);
    if (soft && !is_soft_face(c)) || (!soft && facing_of(c) == 0) {
        return span;
    }
    let region = region_of(h);
    let base = hypotheses[h].image_center.xy;
    let low = min(min(c[0].xy, c[1].xy), c[2].xy) + base - params.reach;
    let high = max(max(c[0].xy, c[1].xy), c[2].xy) + base + params.reach;
    let first = max(ceil(low), vec2<f32>(region.xy));
    let last = min(floor(high), vec2<f32>(region.zw) - 1.0);
    // Most faces of a fine mesh lie between pixel centers.
    if all(first <= last) {
        span.some = true;
        span.first = vec2<u32>(first) / TILE;
        span.last = vec2<u32>(last) / TILE;
    }
    return span;
}
