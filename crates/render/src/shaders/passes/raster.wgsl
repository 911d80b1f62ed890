// The hard z-buffer: one workgroup a tile, one thread a pixel.

#import prehend::bins::{bins, entries, tile_entries}
#import prehend::mesh::{NONE, faces}
#import prehend::params::params
#import prehend::screen::{face_screen, signed_area}
#import prehend::tallies::region_of
#import prehend::tiles::{TILE_PIXELS, pixel_index, tile_index, touches_tile}
#import prehend::z_buffer::visible

struct RasterFace {
    // Of each side its first corner and its direction, turned so that the inside is positive.
    sides: mat3x4<f32>,
    // 1/Z of the corners over twice the area.
    inverse_z: vec3<f32>,
    face: u32,
}

var<workgroup> raster_batch: array<RasterFace, 64>;
var<workgroup> raster_count: u32;

// Both faces of an edge evaluate the same expression, so that none of its pixels is lost.
fn side(p: vec2<f32>, q: vec2<f32>, ordered: bool, sign: f32) -> vec4<f32> {
    if ordered {
        return vec4<f32>(p, sign * (q - p));
    }
    return vec4<f32>(q, -sign * (p - q));
}

fn raster_face(h: u32, face: u32) -> RasterFace {
    let ids = faces[face];
    let c = face_screen(h, face);
    let area = signed_area(c);
    let sign = select(1.0, -1.0, area < 0.0);
    var out: RasterFace;
    out.sides[0] = side(c[1].xy, c[2].xy, ids.y < ids.z, sign);
    out.sides[1] = side(c[2].xy, c[0].xy, ids.z < ids.x, sign);
    out.sides[2] = side(c[0].xy, c[1].xy, ids.x < ids.y, sign);
    out.inverse_z = vec3<f32>(c[0].z, c[1].z, c[2].z) / abs(area);
    out.face = face;
    return out;
}

fn inside_of(s: vec4<f32>, p: vec2<f32>) -> f32 {
    return s.z * (p.y - s.y) - s.w * (p.x - s.x);
}

@compute @workgroup_size(8, 8)
fn raster(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
    @builtin(global_invocation_id) id: vec3<u32>,
) {
    let h = group.z;
    let tile = tile_index(h, group.xy);
    if lane == 0u {
        raster_count = select(0u, tile_entries(tile), touches_tile(region_of(h), group.xy));
    }
    let count = workgroupUniformLoad(&raster_count);
    let p = vec2<f32>(id.xy);
    var nearest = 0.0;
    var found = NONE;
    for (var first = 0u; first < count; first += TILE_PIXELS) {
        if first + lane < count {
            raster_batch[lane] = raster_face(h, entries[bins[tile].start + first + lane]);
        }
        workgroupBarrier();
        let end = min(count - first, TILE_PIXELS);
        for (var i = 0u; i < end; i++) {
            let f = &raster_batch[i];
            let e = vec3<f32>(
                inside_of((*f).sides[0], p),
                inside_of((*f).sides[1], p),
                inside_of((*f).sides[2], p),
            );
            if all(e >= vec3<f32>(0.0)) {
                let inverse_z = dot(e, (*f).inverse_z);
                if inverse_z > nearest || (inverse_z == nearest && (*f).face < found) {
                    nearest = inverse_z;
                    found = (*f).face;
                }
            }
        }
        workgroupBarrier();
    }
    if all(id.xy < params.size) {
        visible[pixel_index(h, id.xy)] = vec2<u32>(found, bitcast<u32>(nearest));
    }
}
