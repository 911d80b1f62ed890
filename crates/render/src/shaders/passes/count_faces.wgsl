// Counts the faces of each tile, the first of three passes that sort faces into tiles.

#import prehend::bins::bins
#import prehend::params::params
#import prehend::tile_span::tile_span
#import prehend::tiles::tile_index

@compute @workgroup_size(64)
fn count_faces(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.faces {
        return;
    }
    let span = tile_span(id.z, id.x);
    if !span.some {
        return;
    }
    for (var y = span.first.y; y <= span.last.y; y++) {
        for (var x = span.first.x; x <= span.last.x; x++) {
            atomicAdd(&bins[tile_index(id.z, vec2<u32>(x, y))].count, 1u);
        }
    }
}
