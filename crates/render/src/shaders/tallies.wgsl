// Counters of each hypothesis, and the pixels that it may cover.
#define_import_path prehend::tallies

#import prehend::params::params

// Larger than any image, so that a minimum can be kept as a maximum and zero means nothing seen.
const FAR_COLUMN: u32 = 0x10000000u;

// Filled by atomics, zero at first.
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

@group(0) @binding(9) var<storage, read_write> tallies: array<Tally>;

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
