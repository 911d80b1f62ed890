// The picture of one hypothesis.

// Colour, coverage and depth.
const PICTURE_COLUMNS: u32 = 5u;

fn store_picture(pixel: Pixel, at: vec2<u32>) {
    if all(at < params.size) {
        let first = PICTURE_COLUMNS * (at.y * params.size.x + at.x);
        for (var k = 0u; k < 3u; k++) {
            results.values[first + k] = pixel.color[k];
        }
        results.values[first + 3u] = pixel.coverage;
        results.values[first + 4u] = select(0.0, pixel.z, pixel.hit);
    }
}

@compute @workgroup_size(8, 8)
fn contour_picture(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
    @builtin(global_invocation_id) id: vec3<u32>,
) {
    store_picture(seen_in_contour_mode(group.z, lane, group.xy, id.xy), id.xy);
}
