// Projected vertices, and faces as they are seen.
#define_import_path prehend::screen

#import prehend::mesh::faces
#import prehend::params::params

// Column, row [px], 1/Z [1/m] (0 where not in front of the camera) and Z [m] of each vertex.
@group(0) @binding(8) var<storage, read_write> screen: array<vec4<f32>>;

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
