// The picture of one hypothesis.
#define_import_path prehend::picture

#import prehend::hypotheses::hypotheses
#import prehend::params::params
#import prehend::pixel::Pixel
#import prehend::results::results
#import prehend::screen::{face_screen, signed_area}
#import prehend::surface::{barycentric, normal_at}

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
