// Gives each tile its place in the pool of entries that all hypotheses share, the second of three passes that sort faces
// into tiles.

#import prehend::bins::{bins, saturating_add}
#import prehend::params::params
#import prehend::results::results

var<workgroup> scan_sums: array<u32, 256>;
var<workgroup> scan_base: u32;

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
