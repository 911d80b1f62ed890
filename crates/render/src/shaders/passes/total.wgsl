// Adds up the tiles of each square and hypothesis in a fixed order, one workgroup a square, and notes what the work buffers
// would have needed.

#import prehend::params::params
#import prehend::results::{note_needs, results}
#import prehend::squares::part_index
#import prehend::sums::{SUM_COLUMNS, partials}
#import prehend::tallies::region_of
#import prehend::tiles::TILE

// Threads of a column share the tiles.
const TOTAL_GROUPS: u32 = 7u;

var<workgroup> group_sums: array<f32, 245>;

@compute @workgroup_size(256)
fn total(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let h = group.z;
    let square = group.xy;
    let column = lane % SUM_COLUMNS;
    let share = lane / SUM_COLUMNS;
    if share < TOTAL_GROUPS {
        let region = region_of(h);
        let start = max(region.xy, square * params.side);
        let end = max(min(region.zw, (square + 1u) * params.side), start);
        let low = start / TILE;
        let high = (end + TILE - 1u) / TILE;
        let columns = high.x - low.x;
        let count = select(0u, columns * (high.y - low.y), all(start < end));
        var sum = 0.0;
        // What rounding lost so far (Kahan summation).
        var lost = 0.0;
        for (var i = share; i < count; i += TOTAL_GROUPS) {
            let tile = low + vec2<u32>(i % columns, i / columns);
            let value = partials[part_index(h, tile, square) * SUM_COLUMNS + column] - lost;
            let next = sum + value;
            lost = (next - sum) - value;
            sum = next;
        }
        group_sums[lane] = sum;
    }
    workgroupBarrier();
    if lane < SUM_COLUMNS {
        let place = (h * params.squares.y + square.y) * params.squares.x + square.x;
        var sum = 0.0;
        for (var i = 0u; i < TOTAL_GROUPS; i++) {
            sum += group_sums[i * SUM_COLUMNS + lane];
        }
        results.values[place * SUM_COLUMNS + lane] = sum;
    }
    if lane == 0u && all(square == vec2<u32>(0u)) {
        note_needs(h);
    }
}
