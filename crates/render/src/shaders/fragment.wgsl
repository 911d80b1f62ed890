// What a face looks like from a pixel in the SoftRas mode. See `softras/fragment.rs`.
#define_import_path prehend::fragment

#import prehend::mesh::{camera_position, faces}
#import prehend::params::{SOFT_CLIP, SOFT_PERSPECTIVE, params, soft_flag}
#import prehend::row::{Row, image_gradient, motion_along, no_row}
#import prehend::soft_face::SoftFace

struct Fragment {
    // Barycentric coordinates of the surface point, and Σ b_i Z_i [m].
    b: vec3<f32>,
    z: f32,
    // Barycentric coordinates, in the image, of the nearest point of the edges, and where it lies from the pixel [px].
    foot: vec3<f32>,
    to_foot: vec2<f32>,
    // Squared distance to it [px²], negative inside.
    distance: f32,
    inverse_sum: f32,
    // 1 where a weight depends on the corners, 0 where it is clamped; likewise for their sum.
    free: vec3<f32>,
    sum_free: f32,
    // The pixel's center lies inside the face; the face counts here.
    inside: bool,
    kept: bool,
}

fn cross_2(a: vec2<f32>, b: vec2<f32>) -> f32 {
    return a.x * b.y - a.y * b.x;
}

// The point of the edge from `start` that is nearest to the origin: its offset, and its share of the edge.
fn edge_foot(start: vec2<f32>, end: vec2<f32>) -> vec3<f32> {
    let d = end - start;
    let length = dot(d, d);
    var t = 1.0;
    if length > params.least_area {
        t = clamp(-dot(start, d) / length, 0.0, 1.0);
    }
    return vec3<f32>(start + t * d, t);
}

// The fragment of a face at a pixel, given relative to the base pixel.
fn fragment_of(f: SoftFace, p: vec2<f32>) -> Fragment {
    let v0 = f.first - p;
    let v1 = f.second - p;
    let v2 = f.third - p;
    let raw = f.share * vec3<f32>(cross_2(v1, v2), cross_2(v2, v0), cross_2(v0, v1));
    let least = select(-3e38, 0.0, soft_flag(SOFT_CLIP));
    let w = max(raw, vec3<f32>(least));
    let free_sum = w.x + w.y + w.z;
    let sum = max(free_sum, f.least_sum);
    var out: Fragment;
    out.inside = all(raw > vec3<f32>(0.0));
    out.free = select(vec3<f32>(0.0), vec3<f32>(1.0), raw >= vec3<f32>(least));
    out.sum_free = select(0.0, 1.0, free_sum > f.least_sum);
    // A point clamped to a corner has its coordinates exactly, so that ties between the faces around it stay ties.
    out.b = select(w / sum, vec3<f32>(1.0), w == vec3<f32>(sum));
    out.z = dot(out.b, f.z);
    out.inverse_sum = 1.0 / sum;
    // Of equally near edges the first counts.
    var near = edge_foot(v0, v1);
    var squared = dot(near.xy, near.xy);
    out.foot = vec3<f32>(1.0 - near.z, near.z, 0.0);
    let second = edge_foot(v0, v2);
    let second_squared = dot(second.xy, second.xy);
    if second_squared < squared {
        near = second;
        squared = second_squared;
        out.foot = vec3<f32>(1.0 - near.z, 0.0, near.z);
    }
    let third = edge_foot(v1, v2);
    let third_squared = dot(third.xy, third.xy);
    if third_squared < squared {
        near = third;
        squared = third_squared;
        out.foot = vec3<f32>(0.0, 1.0 - near.z, near.z);
    }
    out.to_foot = near.xy;
    out.distance = select(squared, -squared, out.inside);
    out.kept = (out.inside || squared < params.blur) && out.z >= 0.0;
    return out;
}

// From derivatives by a fragment's coordinates, depth and distance to the row of the pose.
fn fragment_row(
    h: u32,
    f: SoftFace,
    p: vec2<f32>,
    fragment: Fragment,
    by_b: vec3<f32>,
    by_z: f32,
    by_distance: f32,
) -> Row {
    var v = array<vec2<f32>, 3>(f.first - p, f.second - p, f.third - p);
    // Where the sum is free, a depth that is the same everywhere moves with no coordinate; taking it off saves digits.
    let along = by_b + by_z * (f.z - fragment.z * fragment.sum_free);
    let mean = dot(fragment.b, along) * fragment.sum_free;
    let weight = fragment.free * fragment.inverse_sum * (along - mean);
    let shift = by_distance * select(2.0, -2.0, fragment.inside) * fragment.to_foot;
    // By the columns and rows [1/px] and depths [1/m] of the corners.
    var by_corner = array<vec3<f32>, 3>(
        vec3<f32>(shift * fragment.foot.x, by_z * fragment.b.x),
        vec3<f32>(shift * fragment.foot.y, by_z * fragment.b.y),
        vec3<f32>(shift * fragment.foot.z, by_z * fragment.b.z),
    );
    for (var i = 0u; i < 3u; i++) {
        let j = (i + 1u) % 3u;
        let k = (i + 2u) % 3u;
        let edge = weight[i] * f.share[i];
        by_corner[j] += vec3<f32>(edge * v[k].y, -edge * v[k].x, 0.0);
        by_corner[k] += vec3<f32>(-edge * v[j].y, edge * v[j].x, 0.0);
        if soft_flag(SOFT_PERSPECTIVE) {
            // 1/Z falls by its Z-th part.
            by_corner[i].z -= edge * cross_2(v[j], v[k]) / f.z[i];
        }
    }
    let ids = faces[f.face];
    var row = no_row();
    for (var i = 0u; i < 3u; i++) {
        let point = camera_position(h, ids[i]);
        let gradient = image_gradient(by_corner[i].xy, point) + vec3<f32>(0.0, 0.0, by_corner[i].z);
        let moved = motion_along(h, gradient, point);
        row = Row(row.linear + moved.linear, row.angular + moved.angular);
    }
    return row;
}
