// The image by tiles, one workgroup each.
#define_import_path prehend::tiles

#import prehend::params::params

// Tiles are squares of this many pixels; one thread a pixel.
const TILE: u32 = 8u;
const TILE_PIXELS: u32 = 64u;

// Whether a tile has a pixel of `region`: first column and row, ends.
fn touches_tile(region: vec4<u32>, tile: vec2<u32>) -> bool {
    let low = tile * TILE;
    return all(region.zw > low) && all(region.xy < low + TILE);
}

// The place of a tile among those of all hypotheses.
fn tile_index(h: u32, tile: vec2<u32>) -> u32 {
    return h * params.tiles.x * params.tiles.y + tile.y * params.tiles.x + tile.x;
}

// The place of a pixel among those of all hypotheses.
fn pixel_index(h: u32, pixel: vec2<u32>) -> u32 {
    return h * params.size.x * params.size.y + pixel.y * params.size.x + pixel.x;
}
