// The contour mode: blended value of a pixel and its derivatives. See `contour/pixel.rs` and `contour/cross.rs`.
#define_import_path prehend::contour

#import prehend::derivatives::with_derivatives
#import prehend::mesh::{NONE, camera_position, faces}
#import prehend::params::params
#import prehend::pieces::pieces
#import prehend::pixel::{Pixel, color_rows}
#import prehend::row::{
    Row, image_gradient, image_motion, motion_along, no_row, ray, scaled, scaled_sum,
}
#import prehend::screen::{face_screen, facing_of, screen}
#import prehend::surface::{Shaded, barycentric, shade}

struct Foot {
    // Share of the edge's screen length.
    t: f32,
    // From the foot to the pixel [px].
    offset: vec2<f32>,
    distance_squared: f32,
}

fn foot_of(a: vec2<f32>, b: vec2<f32>, range: vec2<f32>, p: vec2<f32>) -> Foot {
    let d = b - a;
    let r = p - a;
    let t = min(max(dot(r, d) / dot(d, d), range.x), range.y);
    let offset = r - t * d;
    return Foot(t, offset, dot(offset, offset));
}

// The smooth step from 1 at -w to 0 at +w, and its derivative.
fn falling_step(s: f32, w: f32) -> vec2<f32> {
    let x = clamp((w - s) / (2.0 * w), 0.0, 1.0);
    return vec2<f32>(x * x * (3.0 - 2.0 * x), -3.0 * x * (1.0 - x) / w);
}

// The unblended pixel p of a face.
fn interior(h: u32, p: vec2<f32>, face: u32, inverse_z: f32) -> Pixel {
    let c = face_screen(h, face);
    let b = barycentric(c, p);
    let shaded = shade(h, face, b, facing_of(c) < 0);
    let z = 1.0 / inverse_z;
    var pixel: Pixel;
    pixel.some = true;
    pixel.hit = true;
    pixel.face = face;
    pixel.color = shaded.color;
    pixel.coverage = 1.0;
    pixel.z = z;
    pixel.depth_weight = 1.0;
    if with_derivatives() {
        interior_rows(h, face, b, ray(p) * z, shaded, &pixel);
    }
    return pixel;
}

// Surfaces are taken to be inclined to the viewing ray by at least this sine.
const GRAZING: f32 = 1e-3;

// Rows of color and depth at a surface point seen through a fixed pixel: the barycentric coordinate of corner i of the point
// on ray X is c_i·X / n·X with c_1 = e2 x p0 and c_2 = p0 x e1, so it changes by -(c_i - b_i n)/(n·X)·v, and the depth by
// n·v/(n·d).
fn interior_rows(
    h: u32,
    face: u32,
    b: vec3<f32>,
    point: vec3<f32>,
    shaded: Shaded,
    pixel: ptr<function, Pixel>,
) {
    let ids = faces[face];
    let p0 = camera_position(h, ids.x);
    let e1 = camera_position(h, ids.y) - p0;
    let e2 = camera_position(h, ids.z) - p0;
    let n = cross(e1, e2);
    // Of the corner, where rounding disturbs the plane's offset least.
    let offset = dot(n, p0);
    let least = GRAZING * max(length(n) * length(p0), 1e-30);
    let inverse = 1.0 / select(max(offset, least), min(offset, -least), offset < 0.0);
    let h1 = (cross(e2, p0) - b.y * n) * inverse;
    let h2 = (cross(p0, e1) - b.z * n) * inverse;
    color_rows(h, shaded, motion_along(h, -h1, point), motion_along(h, -h2, point), pixel);
    (*pixel).z_row = motion_along(h, n * (point.z * inverse), point);
}

// A point on an edge at screen share t.
struct EdgePoint {
    // Share of the edge in space, and the position in the camera frame.
    share: f32,
    point: vec3<f32>,
    // The edge's ends.
    start: vec3<f32>,
    end: vec3<f32>,
}

fn on_edge(h: u32, piece: u32, t: f32) -> EdgePoint {
    let ids = faces[pieces[piece].face];
    let corner = pieces[piece].corner;
    let first = ids[corner];
    let second = ids[(corner + 1u) % 3u];
    let at = h * params.vertices;
    let wa = (1.0 - t) * screen[at + first].z;
    let wb = t * screen[at + second].z;
    let share = wb / (wa + wb);
    let start = camera_position(h, first);
    let end = camera_position(h, second);
    return EdgePoint(share, start + (end - start) * share, start, end);
}

// The unblended color of the foot on a contour.
fn at_foot(h: u32, piece: u32, foot: Foot) -> Pixel {
    let e = on_edge(h, piece, foot.t);
    let face = pieces[piece].face;
    let corner = pieces[piece].corner;
    let next = (corner + 1u) % 3u;
    var b = vec3<f32>(0.0);
    b[corner] = 1.0 - e.share;
    b[next] = e.share;
    let shaded = shade(h, face, b, facing_of(face_screen(h, face)) < 0);
    var pixel: Pixel;
    pixel.some = true;
    pixel.color = shaded.color;
    pixel.coverage = 1.0;
    pixel.z = e.point.z;
    pixel.depth_weight = 1.0;
    if with_derivatives() {
        // Moving along the edge by dt changes the coordinates of its two corners by -dt and +dt.
        let slid = slide(h, piece, foot, e);
        let sign_1 = select(select(0.0, 1.0, next == 1u), -1.0, corner == 1u);
        let sign_2 = select(select(0.0, 1.0, next == 2u), -1.0, corner == 2u);
        color_rows(h, shaded, scaled(sign_1, slid), scaled(sign_2, slid), &pixel);
    }
    return pixel;
}

// How far the material point under the foot slides along its edge (share of the edge in space); zero at a piece's end.
fn slide(h: u32, piece: u32, foot: Foot, e: EdgePoint) -> Row {
    if foot.t <= pieces[piece].range.x || foot.t >= pieces[piece].range.y {
        return no_row();
    }
    let d = pieces[piece].b - pieces[piece].a;
    let length = sqrt(dot(d, d));
    let tau = d / length;
    let speed = dot(image_gradient(tau, e.point), e.end - e.start);
    let along = image_motion(h, tau, e.point);
    // The offset from foot to pixel is perpendicular to the edge.
    let turn_a = image_motion(h, foot.offset, e.start);
    let turn_b = image_motion(h, foot.offset, e.end);
    let turn = scaled_sum(1.0 / length, turn_b, -1.0 / length, turn_a);
    return scaled_sum(-1.0 / speed, along, 1.0 / speed, turn);
}

// Row of the signed distance to a contour at its foot (`side` is -1 inside, 1 outside).
fn distance_row(h: u32, piece: u32, foot: Foot, side: f32) -> Row {
    let distance = sqrt(foot.distance_squared);
    var outward = pieces[piece].outward;
    if distance > 1e-3 {
        outward = foot.offset * (side / distance);
    }
    // The foot moves along the outward normal, and the signed distance shrinks by as much.
    return scaled(-1.0, image_motion(h, outward, on_edge(h, piece, foot.t).point));
}

// Fades the pixel by its signed distance to the outline (`side` is -1 inside, 1 outside).
fn fade(h: u32, piece: u32, foot: Foot, side: f32, pixel: ptr<function, Pixel>) {
    let s = side * sqrt(foot.distance_squared);
    let w = params.half_width;
    let alpha = falling_step(s, w);
    // The same step, compressed to the inner half of the band.
    let outer = falling_step(2.0 * s + w, w);
    let color = (*pixel).color;
    let weight = (*pixel).depth_weight;
    (*pixel).near_outline = true;
    (*pixel).color = alpha.x * color;
    (*pixel).coverage = alpha.x;
    (*pixel).depth_weight = outer.x * weight;
    if with_derivatives() {
        let ds = distance_row(h, piece, foot, side);
        for (var k = 0u; k < 3u; k++) {
            (*pixel).color_rows[k] =
                scaled_sum(alpha.x, (*pixel).color_rows[k], alpha.y * color[k], ds);
        }
        (*pixel).coverage_row = scaled(alpha.y, ds);
        (*pixel).depth_weight_row =
            scaled_sum(outer.x, (*pixel).depth_weight_row, 2.0 * outer.y * weight, ds);
    }
}

// Blends the near and the far surface across an inner contour: on the far side the near surface has the color of the
// foot, on the near side the far surface has the color of the pixel beyond the contour.
fn cross_contour(h: u32, p: vec2<f32>, own: Pixel, piece: u32) -> Pixel {
    let foot = foot_of(pieces[piece].a, pieces[piece].b, pieces[piece].range, p);
    let side = select(-1.0, 1.0, own.z > pieces[piece].split);
    var near = own;
    var far = own;
    if side > 0.0 {
        near = at_foot(h, piece, foot);
    } else {
        let pixel = pieces[piece].behind_pixel;
        let q = vec2<f32>(f32(pixel % params.size.x), f32(pixel / params.size.x));
        far = interior(h, q, pieces[piece].behind_face, pieces[piece].behind_inverse_z);
    }
    let distance = sqrt(foot.distance_squared);
    let alpha = falling_step(side * distance, params.half_width);
    // Depth counts for nothing at the step itself.
    let weight = falling_step(params.half_width - 2.0 * distance, params.half_width);
    var out = own;
    out.color = alpha.x * near.color + (1.0 - alpha.x) * far.color;
    out.depth_weight = weight.x;
    if with_derivatives() {
        let ds = distance_row(h, piece, foot, side);
        for (var k = 0u; k < 3u; k++) {
            let mixed = scaled_sum(alpha.x, near.color_rows[k], 1.0 - alpha.x, far.color_rows[k]);
            let step = alpha.y * (near.color[k] - far.color[k]);
            out.color_rows[k] = scaled_sum(1.0, mixed, step, ds);
        }
        out.depth_weight_row = scaled(-2.0 * side * weight.y, ds);
    }
    return out;
}

// What pixel p shows, given the face there and the nearest pieces of the outline and of inner contours within the band.
fn contour_pixel(h: u32, p: vec2<f32>, seen: vec2<u32>, outline: u32, inner: u32) -> Pixel {
    var pixel: Pixel;
    if seen.x == NONE && outline == NONE {
        return pixel;
    }
    var side = -1.0;
    if seen.x != NONE {
        pixel = interior(h, p, seen.x, bitcast<f32>(seen.y));
        if inner != NONE {
            pixel = cross_contour(h, p, pixel, inner);
        }
    }
    if outline != NONE {
        let foot = foot_of(pieces[outline].a, pieces[outline].b, pieces[outline].range, p);
        if seen.x == NONE {
            pixel = at_foot(h, outline, foot);
            side = 1.0;
        }
        fade(h, outline, foot, side, &pixel);
    }
    return pixel;
}
