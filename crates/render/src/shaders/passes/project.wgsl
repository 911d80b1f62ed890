// Transforms and projects the vertices, and finds the pixels that may be covered.

#import prehend::hypotheses::hypotheses
#import prehend::mesh::{camera_position, positions}
#import prehend::params::{SOFT_MODE, params, soft_flag}
#import prehend::screen::screen
#import prehend::tallies::{FAR_COLUMN, tallies}

// Geometry nearer to the camera plane than this is not drawn [m].
const NEAR: f32 = 1e-3;

var<workgroup> box_left: atomic<u32>;
var<workgroup> box_top: atomic<u32>;
var<workgroup> box_right: atomic<u32>;
var<workgroup> box_bottom: atomic<u32>;

@compute @workgroup_size(256)
fn project(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    if lane == 0u {
        atomicStore(&box_left, 0u);
        atomicStore(&box_top, 0u);
        atomicStore(&box_right, 0u);
        atomicStore(&box_bottom, 0u);
    }
    workgroupBarrier();
    let h = group.z;
    let vertex = group.x * 256u + lane;
    if vertex < params.vertices {
        var out = vec4<f32>(0.0);
        let p = camera_position(h, vertex);
        if hypotheses[h].alive != 0u && p.z > NEAR {
            let w = 1.0 / p.z;
            let center = hypotheses[h].center;
            if soft_flag(SOFT_MODE) && center.z > NEAR {
                // Barycentric coordinates of narrow faces magnify rounding, so these are relative to the center.
                let ratio = center.xy / center.z;
                let arm = hypotheses[h].rotation * positions[vertex].xyz;
                let shift = params.focal * (arm.xy - ratio * arm.z) * w;
                out = vec4<f32>(shift + hypotheses[h].image_center.zw, w, p.z);
            } else {
                out = vec4<f32>(params.focal * p.xy * w + params.principal, w, p.z);
            }
            let place = out.xy + hypotheses[h].image_center.xy;
            let size = vec2<f32>(params.size);
            let start = vec2<u32>(clamp(ceil(place - params.margin), vec2<f32>(0.0), size));
            let end = vec2<u32>(clamp(floor(place + params.margin) + 1.0, vec2<f32>(0.0), size));
            atomicMax(&box_left, FAR_COLUMN - start.x);
            atomicMax(&box_top, FAR_COLUMN - start.y);
            atomicMax(&box_right, end.x);
            atomicMax(&box_bottom, end.y);
        }
        screen[h * params.vertices + vertex] = out;
    }
    workgroupBarrier();
    if lane == 0u {
        atomicMax(&tallies[h].left, atomicLoad(&box_left));
        atomicMax(&tallies[h].top, atomicLoad(&box_top));
        atomicMax(&tallies[h].right, atomicLoad(&box_right));
        atomicMax(&tallies[h].bottom, atomicLoad(&box_bottom));
    }
}
