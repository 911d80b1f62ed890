// The SoftRas mode: the nearest faces of a pixel, blended by depth. See `softras/pixel.rs` and `softras/blend.rs`.
#define_import_path prehend::softras

#import prehend::bins::{bins, entries, tile_entries}
#import prehend::derivatives::with_derivatives
#import prehend::fragment::{Fragment, fragment_of, fragment_row}
#import prehend::hypotheses::hypotheses
#import prehend::mesh::NONE
#import prehend::params::{MOST_FACES, SOFT_FADE, params, soft_flag}
#import prehend::pixel::Pixel
#import prehend::row::scaled_sum
#import prehend::soft_face::{SoftFace, soft_face}
#import prehend::surface::shade
#import prehend::tallies::region_of
#import prehend::tiles::{TILE_PIXELS, tile_index, touches_tile}

// Weight of the background.
const BACKGROUND: f32 = 1e-10;

// What has a smaller share of the pixel is left out: 64 such fragments are less than 1e-6 of its color.
const LEAST_SHARE: f32 = 1e-8;

var<workgroup> soft_batch: array<SoftFace, 64>;
var<workgroup> soft_count: u32;

// The nearest faces of a pixel in ascending order of depth, of equals the first.
struct Nearest {
    count: u32,
    z: array<f32, MOST_FACES>,
    face: array<u32, MOST_FACES>,
    // The nearest that contains the pixel's center.
    inside_z: f32,
    inside: u32,
}

fn comes_before(z: f32, face: u32, other_z: f32, other_face: u32) -> bool {
    return z < other_z || (z == other_z && face < other_face);
}

fn insert(list: ptr<function, Nearest>, z: f32, face: u32) {
    var at = (*list).count;
    if at == params.faces_per_pixel {
        at -= 1u;
        if !comes_before(z, face, (*list).z[at], (*list).face[at]) {
            return;
        }
    } else {
        (*list).count = at + 1u;
    }
    while at > 0u && comes_before(z, face, (*list).z[at - 1u], (*list).face[at - 1u]) {
        (*list).z[at] = (*list).z[at - 1u];
        (*list).face[at] = (*list).face[at - 1u];
        at -= 1u;
    }
    (*list).z[at] = z;
    (*list).face[at] = face;
}

fn bounded_exp(x: f32) -> f32 {
    return exp(clamp(x, -87.0, 87.0));
}

struct Blend {
    // Depth that weights are relative to [m].
    reference: f32,
    background: f32,
    // One over the weights' sum, and Π (1 - p).
    inverse_sum: f32,
    clear: f32,
}

// Presence p, 1 - p without cancellation, and the weight of a fragment.
fn part_of(fragment: Fragment, reference: f32) -> vec3<f32> {
    let e = bounded_exp(fragment.distance * params.sharpness);
    let presence = 1.0 / (1.0 + e);
    let depth = bounded_exp((reference - fragment.z) * params.depth_rate);
    return vec3<f32>(presence, e * presence, presence * depth);
}

// The pixel of this thread in the SoftRas mode; to be called by a whole workgroup.
fn seen_in_softras_mode(h: u32, lane: u32, tile: vec2<u32>, at: vec2<u32>) -> Pixel {
    let bin = tile_index(h, tile);
    if lane == 0u {
        soft_count = select(0u, tile_entries(bin), touches_tile(region_of(h), tile));
    }
    let count = workgroupUniformLoad(&soft_count);
    let p = vec2<f32>(at) - hypotheses[h].image_center.xy;
    var nearest: Nearest;
    nearest.inside = NONE;
    for (var first = 0u; first < count; first += TILE_PIXELS) {
        if first + lane < count {
            soft_batch[lane] = soft_face(h, entries[bins[bin].start + first + lane]);
        }
        workgroupBarrier();
        let end = min(count - first, TILE_PIXELS);
        for (var i = 0u; i < end; i++) {
            let fragment = fragment_of(soft_batch[i], p);
            let face = soft_batch[i].face;
            if fragment.kept {
                insert(&nearest, fragment.z, face);
                if fragment.inside && (nearest.inside == NONE
                    || comes_before(fragment.z, face, nearest.inside_z, nearest.inside)) {
                    nearest.inside_z = fragment.z;
                    nearest.inside = face;
                }
            }
        }
        workgroupBarrier();
    }
    var pixel: Pixel;
    if nearest.count > 0u && all(at < params.size) {
        pixel = softras_pixel(h, p, &nearest);
    }
    return pixel;
}

fn softras_pixel(h: u32, p: vec2<f32>, nearest: ptr<function, Nearest>) -> Pixel {
    var blend: Blend;
    blend.reference = min((*nearest).z[0], params.farthest);
    let background = bounded_exp((blend.reference - params.farthest) * params.depth_rate);
    blend.background = max(background, BACKGROUND);
    blend.clear = 1.0;
    var sum = blend.background;
    for (var i = 0u; i < (*nearest).count; i++) {
        let part = part_of(fragment_of(soft_face(h, (*nearest).face[i]), p), blend.reference);
        sum += part.z;
        blend.clear *= part.y;
    }
    blend.inverse_sum = 1.0 / sum;
    var pixel: Pixel;
    pixel.some = true;
    pixel.coverage = 1.0 - blend.clear;
    pixel.z = (*nearest).z[0];
    for (var i = 0u; i < (*nearest).count; i++) {
        let f = soft_face(h, (*nearest).face[i]);
        let fragment = fragment_of(f, p);
        let share = part_of(fragment, blend.reference).z * blend.inverse_sum;
        if share > LEAST_SHARE {
            pixel.color += share * shade(h, f.face, fragment.b, f.seen_inside != 0u).color;
        }
    }
    if with_derivatives() {
        softras_rows(h, p, nearest, blend, &pixel);
    }
    if soft_flag(SOFT_FADE) {
        if with_derivatives() {
            for (var k = 0u; k < 3u; k++) {
                pixel.color_rows[k] = scaled_sum(
                    pixel.coverage, pixel.color_rows[k], pixel.color[k], pixel.coverage_row,
                );
            }
        }
        pixel.color *= pixel.coverage;
    }
    pixel.near_outline = true;
    if (*nearest).inside != NONE {
        let f = soft_face(h, (*nearest).inside);
        let fragment = fragment_of(f, p);
        pixel.hit = true;
        pixel.face = f.face;
        pixel.near_outline = false;
        pixel.z = fragment.z;
        pixel.depth_weight = 1.0;
        if with_derivatives() {
            pixel.z_row = fragment_row(h, f, p, fragment, vec3<f32>(0.0), 1.0, 0.0);
        }
    }
    return pixel;
}

// With the shares ω = w/D, dC = Σ ω (dC_k + (C_k - C) d ln w_k), d ln w = -(1 - p)/σ dd - dz/(γ (z_far - z_near)), and
// dα = -(1 - α) Σ p/σ dd.
fn softras_rows(
    h: u32,
    p: vec2<f32>,
    nearest: ptr<function, Nearest>,
    blend: Blend,
    pixel: ptr<function, Pixel>,
) {
    // The nearest depth moves what the weights are relative to; the background's weight moves with it unless it is at its
    // bound.
    let drifting = blend.background == BACKGROUND && (*nearest).z[0] < params.farthest;
    for (var i = 0u; i < (*nearest).count; i++) {
        let f = soft_face(h, (*nearest).face[i]);
        let fragment = fragment_of(f, p);
        let part = part_of(fragment, blend.reference);
        let share = part.z * blend.inverse_sum;
        let cover = blend.clear * part.x;
        if share <= LEAST_SHARE && cover <= LEAST_SHARE {
            continue;
        }
        let by_distance = -cover * params.sharpness;
        let none = vec3<f32>(0.0);
        let covering = fragment_row(h, f, p, fragment, none, 0.0, by_distance);
        (*pixel).coverage_row = scaled_sum(1.0, (*pixel).coverage_row, 1.0, covering);
        if share <= LEAST_SHARE {
            continue;
        }
        let shaded = shade(h, f.face, fragment.b, f.seen_inside != 0u);
        let relative = select(
            0.0,
            params.depth_rate * blend.background * blend.inverse_sum,
            drifting && i == 0u,
        );
        for (var k = 0u; k < 3u; k++) {
            let contrast = shaded.color[k] - (*pixel).color[k];
            let by_z = relative * (*pixel).color[k] - params.depth_rate * share * contrast;
            let by_b = share * vec3<f32>(0.0, shaded.along_second[k], shaded.along_third[k]);
            let by_d = -part.y * params.sharpness * share * contrast;
            var row = fragment_row(h, f, p, fragment, by_b, by_z, by_d);
            row.angular += share * shaded.turning[k];
            row.linear.z += share * shaded.level[k] * hypotheses[h].level_dz;
            (*pixel).color_rows[k] = scaled_sum(1.0, (*pixel).color_rows[k], 1.0, row);
        }
    }
}
