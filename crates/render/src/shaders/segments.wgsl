// Silhouette edges, and how many layers of surface they enclose.
#define_import_path prehend::segments

#import prehend::params::params
#import prehend::tallies::tallies

// A silhouette edge, directed as its visible face runs through it.
struct Segment {
    // Screen positions [px].
    a: vec2<f32>,
    b: vec2<f32>,
    // Layers gained by crossing from the side where a→b runs up the rows.
    layers: f32,
    edge: u32,
    face: u32,
    // Corner of the face where the edge starts, plus four if the face is seen from inside.
    corner: u32,
}

@group(0) @binding(13) var<storage, read_write> segments: array<Segment>;

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
