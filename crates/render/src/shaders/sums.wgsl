// Sums over the pixels of a tile.
#define_import_path prehend::sums

// Columns of the sums: losses of color, mask and depth, the gradient, the upper triangle of the Hessian row by row, and
// numbers of pixels covered, near the outline, hidden, missed, and with depth.
const SUM_COLOR: u32 = 0u;
const SUM_MASK: u32 = 1u;
const SUM_DEPTH: u32 = 2u;
const SUM_GRADIENT: u32 = 3u;
const SUM_HESSIAN: u32 = 9u;
const SUM_COVERED: u32 = 30u;
const SUM_CONTOUR: u32 = 31u;
const SUM_HIDDEN: u32 = 32u;
const SUM_MISSED: u32 = 33u;
const SUM_WITH_DEPTH: u32 = 34u;
const SUM_COLUMNS: u32 = 35u;

// Sums of each part of each tile: see `squares.wgsl`.
@group(0) @binding(15) var<storage, read_write> partials: array<f32>;
