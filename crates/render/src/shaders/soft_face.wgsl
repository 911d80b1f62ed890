// A face in the SoftRas mode. See `softras/face.rs`.
#define_import_path prehend::soft_face

#import prehend::mesh::faces
#import prehend::params::{SOFT_CULL, SOFT_PERSPECTIVE, params, soft_flag}
#import prehend::screen::{face_screen, screen, signed_area}

// PyTorch3D's bound for the denominator of the perspective correction.
const LEAST_SHARE_SUM: f32 = 1e-8;

struct SoftFace {
    // Corners relative to the hypothesis's base pixel [px].
    first: vec2<f32>,
    second: vec2<f32>,
    third: vec2<f32>,
    face: u32,
    // What a corner's edge function is multiplied with for its weight, positive inside.
    share: vec3<f32>,
    // The weights' sum is taken to be at least this.
    least_sum: f32,
    // Z of the corners [m].
    z: vec3<f32>,
    seen_inside: u32,
}

// Whether a face is drawn at all.
fn is_soft_face(c: mat3x3<f32>) -> bool {
    let in_front = c[0].z > 0.0 && c[1].z > 0.0 && c[2].z > 0.0;
    let area = signed_area(c);
    return in_front && abs(area) > params.least_area && (area < 0.0 || !soft_flag(SOFT_CULL));
}

fn soft_face(h: u32, face: u32) -> SoftFace {
    let ids = faces[face];
    let at = h * params.vertices;
    let c = face_screen(h, face);
    let area = signed_area(c);
    var out: SoftFace;
    out.first = c[0].xy;
    out.second = c[1].xy;
    out.third = c[2].xy;
    out.face = face;
    out.z = vec3<f32>(screen[at + ids.x].w, screen[at + ids.y].w, screen[at + ids.z].w);
    var share = vec3<f32>(1.0);
    if soft_flag(SOFT_PERSPECTIVE) {
        share = vec3<f32>(c[0].z, c[1].z, c[2].z);
    }
    out.least_sum = LEAST_SHARE_SUM * share.x * share.y * share.z * abs(area);
    out.share = select(share, -share, area < 0.0);
    // A closed surface is lit by its outward normals on both sides: a face that turns over must not jump.
    out.seen_inside = select(0u, 1u, area > 0.0 && params.closed == 0u);
    return out;
}
