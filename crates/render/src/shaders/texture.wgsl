// Texture lookup: bilinear inside a level, linear between levels of a pyramid.
#define_import_path prehend::texture

#import prehend::params::params

// 21 bits a channel.
@group(0) @binding(6) var<storage, read> texels: array<vec2<u32>>;

struct Texel {
    color: vec3<f32>,
    // Derivatives by the texture coordinates and the pyramid level.
    du: vec3<f32>,
    dv: vec3<f32>,
    dlevel: vec3<f32>,
}

fn texel_at(at: u32) -> vec3<f32> {
    let packed = texels[at];
    let bits = vec3<u32>(
        packed.x & 0x1fffffu,
        (packed.x >> 21u) | ((packed.y & 0x3ffu) << 11u),
        packed.y >> 10u,
    );
    return vec3<f32>(bits) / 2097151.0;
}

// Coordinates within 0..=1 stay (an edge at exactly 1 must not wrap to 0); others repeat.
fn wrap(t: f32) -> f32 {
    return select(t - floor(t), t, t >= 0.0 && t <= 1.0);
}

fn sample_level(uv: vec2<f32>, index: u32) -> Texel {
    let level = params.level[index];
    let size = level.yz;
    let position = vec2<f32>(wrap(uv.x), 1.0 - wrap(uv.y)) * vec2<f32>(size) - 0.5;
    let above = vec2<u32>(max(position + 1.0, vec2<f32>(0.0)));
    let offset = position - (vec2<f32>(above) - 1.0);
    let low = min(max(above, vec2<u32>(1u)) - 1u, size - 1u);
    let high = min(above, size - 1u);
    let a = texel_at(level.x + low.y * size.x + low.x);
    let b = texel_at(level.x + low.y * size.x + high.x);
    let c = texel_at(level.x + high.y * size.x + low.x);
    let d = texel_at(level.x + high.y * size.x + high.x);
    let top = b - a;
    let bottom = d - c;
    let left = c - a;
    let right = d - b;
    var out: Texel;
    out.color = a + offset.x * top + offset.y * (left + offset.x * (bottom - top));
    out.du = (top + offset.y * (bottom - top)) * f32(size.x);
    // Rows run down while v runs up.
    out.dv = -(left + offset.x * (right - left)) * f32(size.y);
    return out;
}

fn sample_texture(uv: vec2<f32>, level: f32) -> Texel {
    let clamped = clamp(level, 0.0, f32(params.levels - 1u));
    let fine = u32(clamped);
    let blend = clamped - f32(fine);
    var out = sample_level(uv, fine);
    if blend == 0.0 {
        return out;
    }
    let coarse = sample_level(uv, fine + 1u);
    out.dlevel = coarse.color - out.color;
    out.color += blend * out.dlevel;
    out.du += blend * (coarse.du - out.du);
    out.dv += blend * (coarse.dv - out.dv);
    return out;
}
