// The squares of the image by which sums are asked for. A workgroup's tile may lie in several; its sums have a part for each.
#define_import_path prehend::squares

#import prehend::params::params
#import prehend::tiles::{TILE, tile_index}

// The square of a tile's first pixel, which is also the first that the tile has a part of.
fn first_square(tile: vec2<u32>) -> vec2<u32> {
    return tile * TILE / params.side;
}

// The place of the sums of a tile's part in a square, among those of all hypotheses.
fn part_index(h: u32, tile: vec2<u32>, square: vec2<u32>) -> u32 {
    let part = square - first_square(tile);
    return (tile_index(h, tile) * params.parts + part.y) * params.parts + part.x;
}
