// What goes back to the processor.
#define_import_path prehend::results

#import prehend::tallies::tallies

struct Results {
    // What would have been needed of the buffers: entries of all hypotheses, most segments and pieces of any.
    entries: atomic<u32>,
    segments: atomic<u32>,
    pieces: atomic<u32>,
    // Keeps the values apart from the atomics.
    unused: u32,
    // Sums of each square of each hypothesis (see `sums.wgsl`).
    values: array<f32>,
}

@group(0) @binding(16) var<storage, read_write> results: Results;

// Notes what a hypothesis would have needed of the buffers of segments and pieces.
fn note_needs(h: u32) {
    atomicMax(&results.segments, atomicLoad(&tallies[h].segments));
    let outline = atomicLoad(&tallies[h].outline);
    atomicMax(&results.pieces, outline + atomicLoad(&tallies[h].inner));
}
