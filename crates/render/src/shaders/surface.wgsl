// Color of a surface point and its derivatives along the surface and with the normal.
#define_import_path prehend::surface

#import prehend::derivatives::with_derivatives
#import prehend::hypotheses::hypotheses
#import prehend::mesh::corners
#import prehend::params::{ALBEDO_CORNERS, ALBEDO_TEXTURE, ALBEDO_UNIFORM, params}
#import prehend::texture::sample_texture

struct Shaded {
    color: vec3<f32>,
    // Derivatives by the barycentric coordinates of the second and the third corner (the first taking up the rest).
    along_second: vec3<f32>,
    along_third: vec3<f32>,
    // Derivative of each channel by a rotation of the surface under the fixed light, camera frame.
    turning: mat3x3<f32>,
    // Derivative by the pyramid level of the texture.
    level: vec3<f32>,
}

// Perspective-correct barycentric coordinates of image point p on a face.
fn barycentric(c: mat3x3<f32>, p: vec2<f32>) -> vec3<f32> {
    let a = c[0].xy - p;
    let b = c[1].xy - p;
    let d = c[2].xy - p;
    let weights = vec3<f32>(
        (b.x * d.y - b.y * d.x) * c[0].z,
        (d.x * a.y - d.y * a.x) * c[1].z,
        (a.x * b.y - a.y * b.x) * c[2].z,
    );
    let sum = weights.x + weights.y + weights.z;
    // As on the processor: the reciprocal of a subnormal number is infinite.
    if abs(sum) < 1.1754944e-38 {
        return vec3<f32>(1.0, 0.0, 0.0);
    }
    return weights / sum;
}

// Unlit color and its derivatives by the barycentric coordinates and the level, in the fields of `Shaded`.
fn albedo(h: u32, face: u32, b: vec3<f32>) -> Shaded {
    var out: Shaded;
    let first = corners[3u * face].paint;
    let second = corners[3u * face + 1u].paint;
    let third = corners[3u * face + 2u].paint;
    let mixed = b.x * first + b.y * second + b.z * third;
    switch params.albedo_kind {
        case ALBEDO_TEXTURE: {
            let texel = sample_texture(mixed.xy, hypotheses[h].level);
            let to_second = second.xy - first.xy;
            let to_third = third.xy - first.xy;
            out.color = texel.color;
            out.along_second = texel.du * to_second.x + texel.dv * to_second.y;
            out.along_third = texel.du * to_third.x + texel.dv * to_third.y;
            out.level = texel.dlevel;
        }
        case ALBEDO_CORNERS: {
            out.color = mixed;
            out.along_second = second - first;
            out.along_third = third - first;
        }
        case ALBEDO_UNIFORM, default: {
            out.color = params.albedo;
        }
    }
    return out;
}

// Smooth unit normal on the side seen, mesh frame, and in w the sign of that side over the length before normalizing.
fn normal_at(face: u32, b: vec3<f32>, seen_inside: bool) -> vec4<f32> {
    let sum = corners[3u * face].normal * b.x
        + corners[3u * face + 1u].normal * b.y
        + corners[3u * face + 2u].normal * b.z;
    let factor = select(1.0, -1.0, seen_inside) / max(sqrt(dot(sum, sum)), 1e-6);
    return vec4<f32>(sum * factor, factor);
}

// Lit color at barycentric coordinates b of a face; `seen_inside` says which side is seen.
fn shade(h: u32, face: u32, b: vec3<f32>, seen_inside: bool) -> Shaded {
    var out = albedo(h, face, b);
    if hypotheses[h].flat_light != 0u {
        let factor = max(hypotheses[h].ambient, vec3<f32>(0.0));
        out.color = out.color * factor + hypotheses[h].offset;
        out.along_second *= factor;
        out.along_third *= factor;
        out.level *= factor;
        return out;
    }
    let smooth_normal = normal_at(face, b, seen_inside);
    let n = smooth_normal.xyz;
    var light = hypotheses[h].object_light;
    let along_normal = n * light;
    let factor = max(hypotheses[h].ambient + along_normal, vec3<f32>(0.0));
    let unlit = out.color;
    out.color = unlit * factor;
    if with_derivatives() {
        let in_camera = hypotheses[h].rotation * n;
        let d1 = corners[3u * face + 1u].normal - corners[3u * face].normal;
        let d2 = corners[3u * face + 2u].normal - corners[3u * face].normal;
        out.along_second *= factor;
        out.along_third *= factor;
        out.level *= factor;
        for (var k = 0u; k < 3u; k++) {
            if factor[k] > 0.0 {
                // The normal turns by the part of the corners' difference across it.
                let across = (light[k] - n * along_normal[k]) * smooth_normal.w;
                out.along_second[k] += unlit[k] * dot(across, d1);
                out.along_third[k] += unlit[k] * dot(across, d2);
                out.turning[k] = cross(in_camera, hypotheses[h].camera_light[k]) * unlit[k];
            }
        }
    }
    out.color += hypotheses[h].offset;
    return out;
}
