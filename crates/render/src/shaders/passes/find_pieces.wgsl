// Cuts silhouette edges into pieces and picks those that bound the object in the image (nothing of it just outside), and
// those where it hides farther parts of itself.

#import prehend::mesh::{NONE, faces}
#import prehend::params::params
#import prehend::pieces::{Piece, pieces}
#import prehend::screen::screen
#import prehend::segments::{layers_at, segment_count, segments}
#import prehend::tallies::{covered_region, region_of, tallies}
#import prehend::tiles::pixel_index
#import prehend::z_buffer::visible

// Longest piece of an edge that is judged as a whole [px].
const PIECE_LENGTH: f32 = 4.0;

// How far outside an edge it is probed for other parts of the object [px].
const PROBE: f32 = 0.02;

// The share of an edge within the band's half-width of `region`; start beyond end where there is none.
fn clip(a: vec2<f32>, b: vec2<f32>, region: vec4<u32>) -> vec2<f32> {
    var range = vec2<f32>(0.0, 1.0);
    let low = vec2<f32>(region.xy) - params.half_width;
    let high = vec2<f32>(region.zw) - 1.0 + params.half_width;
    for (var k = 0u; k < 2u; k++) {
        let d = b[k] - a[k];
        if abs(d) < 1e-6 {
            if a[k] < low[k] || a[k] > high[k] {
                return vec2<f32>(1.0, 0.0);
            }
            continue;
        }
        let t0 = (low[k] - a[k]) / d;
        let t1 = (high[k] - a[k]) / d;
        range = vec2<f32>(max(range.x, min(t0, t1)), min(range.y, max(t0, t1)));
    }
    return range;
}

// What is seen at the pixel nearest to an image point: its index in the image, the face and its 1/Z.
struct Glance {
    pixel: u32,
    face: u32,
    inverse_z: f32,
}

fn glance(h: u32, p: vec2<f32>, region: vec4<u32>) -> Glance {
    // Halves round away from zero.
    let q = sign(p) * floor(abs(p) + 0.5);
    var out = Glance(0u, NONE, 0.0);
    if all(q >= vec2<f32>(region.xy)) && all(q < vec2<f32>(region.zw)) {
        let pixel = vec2<u32>(q);
        let seen = visible[pixel_index(h, pixel)];
        out = Glance(pixel.y * params.size.x + pixel.x, seen.x, bitcast<f32>(seen.y));
    }
    return out;
}

// Whether the surface one pixel outside is farther than the edge, and one pixel inside it is not; fills in what is behind.
fn is_inner(h: u32, piece: ptr<function, Piece>, region: vec4<u32>) -> bool {
    let t = 0.5 * ((*piece).range.x + (*piece).range.y);
    let ids = faces[(*piece).face];
    let start = (*piece).corner & 3u;
    let at = h * params.vertices;
    let wa = screen[at + ids[start]].z;
    let wb = screen[at + ids[(start + 1u) % 3u]].z;
    let z = 1.0 / (wa + t * (wb - wa));
    let middle = (*piece).a + t * ((*piece).b - (*piece).a);
    let behind = glance(h, middle + (*piece).outward, region);
    let front = glance(h, middle - (*piece).outward, region);
    if behind.face == NONE || front.face == NONE {
        return false;
    }
    let step = 1.0 / behind.inverse_z - z;
    (*piece).behind_pixel = behind.pixel;
    (*piece).behind_face = behind.face;
    (*piece).behind_inverse_z = behind.inverse_z;
    (*piece).split = z + 0.5 * step;
    return step > params.least_step && 1.0 / front.inverse_z < (*piece).split;
}

@compute @workgroup_size(64)
fn find_pieces(@builtin(global_invocation_id) id: vec3<u32>) {
    let h = id.z;
    if id.x >= segment_count(h) || covered_region(h).z == 0u {
        return;
    }
    let segment = segments[h * params.segment_capacity + id.x];
    let d = segment.b - segment.a;
    let length = sqrt(dot(d, d));
    // Shorter edges are spanned by their neighbors' ends. The upper limit is for what has no finite length.
    if !(length > 1e-4 && length < 1e30) {
        return;
    }
    let region = region_of(h);
    let span = clip(segment.a, segment.b, region);
    if !(span.x < span.y) {
        return;
    }
    var piece: Piece;
    piece.a = segment.a;
    piece.b = segment.b;
    let sign = select(1.0, -1.0, segment.corner >= 4u);
    piece.outward = vec2<f32>(-sign * d.y, sign * d.x) / length;
    piece.edge = segment.edge;
    piece.face = segment.face;
    piece.corner = segment.corner & 3u;
    let count = max(ceil((span.y - span.x) * length / PIECE_LENGTH), 1.0);
    for (var i = 0u; i < u32(count); i++) {
        piece.part = i;
        piece.range = vec2<f32>(
            span.x + (span.y - span.x) * f32(i) / count,
            span.x + (span.y - span.x) * f32(i + 1u) / count,
        );
        let middle = 0.5 * (piece.range.x + piece.range.y);
        let probe = piece.a + middle * d + PROBE * piece.outward;
        if layers_at(h, probe) < 0.5 {
            let slot = atomicAdd(&tallies[h].outline, 1u);
            if slot < params.piece_capacity {
                pieces[h * params.piece_capacity + slot] = piece;
            }
        } else if is_inner(h, &piece, region) {
            let slot = atomicAdd(&tallies[h].inner, 1u);
            if slot < params.piece_capacity {
                pieces[(h + 1u) * params.piece_capacity - 1u - slot] = piece;
            }
        }
    }
}
