// Sorts the faces of each hypothesis into tiles: count, scan, scatter. The order within a tile is left open.

// First and last tile of the pixel centers in the box around a face and its reach.
struct TileSpan {
    first: vec2<u32>,
    last: vec2<u32>,
    some: bool,
}

fn tile_span(h: u32, face: u32) -> TileSpan {
    let c = face_screen(h, face);
    var span = TileSpan(vec2<u32>(0u), vec2<u32>(0u), false);
    let soft = (params.soft_flags & SOFT_MODE) != 0u;
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

fn saturating_add(a: u32, b: u32) -> u32 {
    return a + min(b, 0xffffffffu - a);
}

var<workgroup> scan_sums: array<u32, 256>;
var<workgroup> scan_base: u32;

// Gives each tile its place in the pool of entries that all hypotheses share.
@compute @workgroup_size(256)
fn scan_bins(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let h = group.z;
    let tiles = params.tiles.x * params.tiles.y;
    let share = (tiles + 255u) / 256u;
    let first = min(lane * share, tiles);
    let last = min(first + share, tiles);
    var own = 0u;
    for (var t = first; t < last; t++) {
        own = saturating_add(own, atomicLoad(&bins[h * tiles + t].count));
    }
    scan_sums[lane] = own;
    workgroupBarrier();
    var before = 0u;
    for (var i = 0u; i < lane; i++) {
        before = saturating_add(before, scan_sums[i]);
    }
    if lane == 255u {
        // The pool's total must not wrap around unseen.
        let total = min(saturating_add(before, own), 0xffffffffu / params.hypotheses);
        scan_base = atomicAdd(&results.entries, total);
    }
    workgroupBarrier();
    var start = saturating_add(scan_base, before);
    for (var t = first; t < last; t++) {
        bins[h * tiles + t].start = start;
        start = saturating_add(start, atomicLoad(&bins[h * tiles + t].count));
    }
}

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

// Number of entries of a tile that can be read.
fn tile_entries(tile: u32) -> u32 {
    let count = min(atomicLoad(&bins[tile].count), atomicLoad(&bins[tile].filled));
    let start = min(bins[tile].start, params.entry_capacity);
    return min(count, params.entry_capacity - start);
}
