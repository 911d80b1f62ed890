// The faces in each tile; their order is left open.
#define_import_path prehend::bins

#import prehend::params::params

struct Bin {
    count: atomic<u32>,
    filled: atomic<u32>,
    start: u32,
}

@group(0) @binding(10) var<storage, read_write> bins: array<Bin>;
@group(0) @binding(11) var<storage, read_write> entries: array<u32>;

fn saturating_add(a: u32, b: u32) -> u32 {
    return a + min(b, 0xffffffffu - a);
}

// Number of entries of a tile that can be read.
fn tile_entries(tile: u32) -> u32 {
    let count = min(atomicLoad(&bins[tile].count), atomicLoad(&bins[tile].filled));
    let start = min(bins[tile].start, params.entry_capacity);
    return min(count, params.entry_capacity - start);
}
