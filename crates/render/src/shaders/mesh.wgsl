// The mesh of the model: vertices, faces, edges, and what varies over its surface.
#define_import_path prehend::mesh

#import prehend::hypotheses::hypotheses

// In place of a face, or of another index: there is none.
const NONE: u32 = 0xffffffffu;

// A corner of a face, three a face.
struct Corner {
    normal: vec3<f32>,
    // Color, or texture coordinates.
    paint: vec3<f32>,
}

// An edge with the one or two faces beside it, and at which of their corners it starts.
struct Edge {
    vertices: vec2<u32>,
    face: u32,
    other: u32,
    corner: u32,
    other_corner: u32,
}

@group(0) @binding(2) var<storage, read> positions: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> faces: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read> corners: array<Corner>;
@group(0) @binding(5) var<storage, read> edges: array<Edge>;

// A vertex in the camera frame [m].
fn camera_position(h: u32, vertex: u32) -> vec3<f32> {
    return hypotheses[h].rotation * positions[vertex].xyz + hypotheses[h].center;
}
