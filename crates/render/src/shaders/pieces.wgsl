// Visible pieces of contours.
#define_import_path prehend::pieces

// A piece of a visible contour.
struct Piece {
    a: vec2<f32>,
    b: vec2<f32>,
    // The part of the edge (share of its screen length).
    range: vec2<f32>,
    // Unit normal in the image, away from the object.
    outward: vec2<f32>,
    edge: u32,
    part: u32,
    face: u32,
    corner: u32,
    // Inner contours only: the pixel next to it on the far side (index into the image), the face seen there, its 1/Z [1/m],
    // and the depth half-way between the near and the far surface [m].
    behind_pixel: u32,
    behind_face: u32,
    behind_inverse_z: f32,
    split: f32,
}

@group(0) @binding(14) var<storage, read_write> pieces: array<Piece>;
