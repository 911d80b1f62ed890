// Finds silhouette edges: exactly one face is drawn, or one is seen from outside and the other from inside.

#import prehend::mesh::{NONE, edges}
#import prehend::params::params
#import prehend::screen::{face_screen, facing_of, screen}
#import prehend::segments::{Segment, segments}
#import prehend::tallies::tallies

@compute @workgroup_size(64)
fn find_segments(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.edges {
        return;
    }
    let h = id.z;
    let edge = edges[id.x];
    let own = facing_of(face_screen(h, edge.face));
    var other = 0;
    if edge.other != NONE {
        other = facing_of(face_screen(h, edge.other));
    }
    if own == other {
        return;
    }
    // A drawn face has all its corners in front of the camera.
    let at = h * params.vertices;
    let a = screen[at + edge.vertices.x].xy;
    let b = screen[at + edge.vertices.y].xy;
    let layers = f32(other - own);
    var out: Segment;
    out.edge = id.x;
    if own == 1 || other == 0 {
        out.a = a;
        out.b = b;
        out.layers = layers;
        out.face = edge.face;
        out.corner = edge.corner + select(0u, 4u, own < 0);
    } else {
        out.a = b;
        out.b = a;
        out.layers = -layers;
        out.face = edge.other;
        out.corner = edge.other_corner + select(0u, 4u, other < 0);
    }
    let slot = atomicAdd(&tallies[h].segments, 1u);
    if slot < params.segment_capacity {
        segments[h * params.segment_capacity + slot] = out;
    }
}
