// Finds silhouette edges: exactly one face is drawn, or one is seen from outside and the other from inside.

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

fn segment_count(h: u32) -> u32 {
    return min(atomicLoad(&tallies[h].segments), params.segment_capacity);
}

// The number of surface layers at an image point: the winding number of the silhouette about it.
fn layers_at(h: u32, p: vec2<f32>) -> f32 {
    let first = h * params.segment_capacity;
    let end = first + segment_count(h);
    var layers = 0.0;
    for (var i = first; i < end; i++) {
        let a = segments[i].a;
        let b = segments[i].b;
        // Half-open in y, so that a shared vertex counts once.
        let up = a.y <= p.y;
        if up == (b.y <= p.y) {
            continue;
        }
        let crossing = a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x);
        if crossing > p.x {
            layers += select(-segments[i].layers, segments[i].layers, up);
        }
    }
    return layers;
}
