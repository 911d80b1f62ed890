// Transforms and projects the vertices, and finds the pixels that may be covered.

// Geometry nearer to the camera plane than this is not drawn [m].
const NEAR: f32 = 1e-3;

var<workgroup> box_left: atomic<u32>;
var<workgroup> box_top: atomic<u32>;
var<workgroup> box_right: atomic<u32>;
var<workgroup> box_bottom: atomic<u32>;

// A vertex in the camera frame [m].
fn camera_position(h: u32, vertex: u32) -> vec3<f32> {
    return hypotheses[h].rotation * positions[vertex].xyz + hypotheses[h].center;
}

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
            if (params.soft_flags & SOFT_MODE) != 0u && center.z > NEAR {
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

fn face_screen(h: u32, face: u32) -> mat3x3<f32> {
    let at = h * params.vertices;
    let ids = faces[face];
    return mat3x3<f32>(screen[at + ids.x].xyz, screen[at + ids.y].xyz, screen[at + ids.z].xyz);
}

// Twice the signed area of a screen triangle [px²]; negative where its outside is seen.
fn signed_area(c: mat3x3<f32>) -> f32 {
    return (c[1].x - c[0].x) * (c[2].y - c[0].y) - (c[1].y - c[0].y) * (c[2].x - c[0].x);
}

// 1 seen from outside, -1 seen from inside, 0 not drawn.
fn facing_of(c: mat3x3<f32>) -> i32 {
    if c[0].z == 0.0 || c[1].z == 0.0 || c[2].z == 0.0 {
        return 0;
    }
    let area = signed_area(c);
    if area < 0.0 {
        return 1;
    }
    if area > 0.0 && params.closed == 0u {
        return -1;
    }
    return 0;
}
