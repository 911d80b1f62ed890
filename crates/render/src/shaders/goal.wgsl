// The image that hypotheses are compared with.
#define_import_path prehend::goal

#import prehend::params::params

struct TargetPixel {
    color: vec3<f32>,
    coverage: f32,
    // Zero where there is none.
    depth: f32,
    occluder: f32,
}

@group(0) @binding(7) var<storage, read> goal: array<TargetPixel>;

// The target at a pixel, empty outside of the image.
fn goal_at(pixel: vec2<u32>) -> TargetPixel {
    var out: TargetPixel;
    if all(pixel < params.size) {
        out = goal[pixel.y * params.size.x + pixel.x];
    }
    return out;
}
