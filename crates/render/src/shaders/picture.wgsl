// The picture of one hypothesis.

// Color, coverage, depth, normal, and the face plus one (0 where there is none).
const PICTURE_COLUMNS: u32 = 9u;

fn store_picture(h: u32, pixel: Pixel, at: vec2<u32>) {
    if any(at >= params.size) {
        return;
    }
    var normal = vec3<f32>(0.0);
    if pixel.hit {
        let c = face_screen(h, pixel.face);
        let b = barycentric(c, vec2<f32>(at) - hypotheses[h].image_center.xy);
        let seen_inside = signed_area(c) > 0.0 && params.closed == 0u;
        normal = hypotheses[h].rotation * normal_at(pixel.face, b, seen_inside).xyz;
    }
    let first = PICTURE_COLUMNS * (at.y * params.size.x + at.x);
    for (var k = 0u; k < 3u; k++) {
        results.values[first + k] = pixel.color[k];
        results.values[first + 5u + k] = normal[k];
    }
    results.values[first + 3u] = pixel.coverage;
    results.values[first + 4u] = select(0.0, pixel.z, pixel.hit);
    results.values[first + 8u] = select(0.0, f32(pixel.face) + 1.0, pixel.hit);
}

@compute @workgroup_size(8, 8)
fn contour_picture(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
    @builtin(global_invocation_id) id: vec3<u32>,
) {
    store_picture(group.z, seen_in_contour_mode(group.z, lane, group.xy, id.xy), id.xy);
}
