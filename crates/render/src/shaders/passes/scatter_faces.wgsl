// Writes the faces of each tile to its place, the third of three passes that sort faces into tiles.

#import prehend::bins::{bins, entries, saturating_add}
#import prehend::params::params
#import prehend::tile_span::tile_span
#import prehend::tiles::tile_index

@compute @workgroup_size(64)
fn scatter_faces(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.faces {
        return;
    }
    let span = tile_span(id.z, id.x);
    if !span.some {
        return;
    }
    for (var y = span.first.y; y <= span.last.y; y++) {
        for (var x = span.first.x; x <= span.last.x; x++) {
            let tile = tile_index(id.z, vec2<u32>(x, y));
            let slot = atomicAdd(&bins[tile].filled, 1u);
            let at = saturating_add(bins[tile].start, slot);
            // The first test guards against another rounding of the area than when counting.
            if slot < atomicLoad(&bins[tile].count) && at < params.entry_capacity {
                entries[at] = id.x;
            }
        }
    }
}
