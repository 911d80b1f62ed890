//! boolmesh: intersections, and unions of two at a time. Meshes that are the same in every call are imported
//! once; the body, which moves, is imported within the time, as by ours.

use std::panic::{AssertUnwindSafe, catch_unwind};

use ::boolmesh::prelude::{Manifold, OpType, compute_boolean};
use prehend_geometry::TriMesh;

use crate::workloads::{Comparisons, Scenes};

const NAME: &str = "boolmesh";
/// \[cm³/m³\]
const CM3: f64 = 1e6;

pub(crate) fn add<'a>(to: &mut Comparisons<'a>, scenes: &'a Scenes) {
    let links: Vec<Manifold> = scenes.links.iter().map(manifold).collect();
    let union = join(links.clone());
    to.union.add(NAME, move || join(links.clone()), |union| vec![volume(&union) * CM3]);
    let [a, b] = &scenes.pair;
    let a = manifold(a);
    to.pair.add(NAME, move || shared(&a, b) * CM3, |volume| vec![volume]);
    let (hand, body) = (union.clone(), &scenes.body);
    to.grasp.add(NAME, move || shared(&hand, body) * CM3, |volume| vec![volume]);
    let hand = manifold(&scenes.hand);
    let name = "boolmesh, links not united";
    to.grasp.add(name, move || shared(&hand, body) * CM3, |volume| vec![volume]);
    let all = move || scenes.posed.iter().map(|body| shared(&union, body) * CM3).collect();
    to.poses.add(NAME, all, |volumes: Vec<f64>| volumes);
    let all = || {
        let pairs = scenes.cubes.iter();
        pairs.map(|pair| shared(&manifold(&pair.a), &pair.b) / pair.scale).collect()
    };
    to.cubes.add(NAME, all, |volumes: Vec<f64>| volumes);
}

fn manifold(mesh: &TriMesh) -> Manifold {
    let positions: Vec<f64> = mesh.vertices.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
    let indices: Vec<usize> = mesh.faces.iter().flatten().map(|&v| v as usize).collect();
    Manifold::new(&positions, &indices).expect("closed meshes")
}

fn join(mut parts: Vec<Manifold>) -> Manifold {
    let union = |pair: &[Manifold]| match pair {
        [a, b] => compute_boolean(a, b, OpType::Add).expect("a union"),
        rest => rest[0].clone(),
    };
    while parts.len() > 1 {
        parts = parts.chunks(2).map(union).collect();
    }
    parts.remove(0)
}

/// \[m³\]; NaN for a panic or an error, which is also the answer to an empty intersection.
fn shared(hand: &Manifold, body: &TriMesh) -> f64 {
    let body = manifold(body);
    let run = || compute_boolean(hand, &body, OpType::Intersect);
    match catch_unwind(AssertUnwindSafe(run)) {
        Ok(Ok(both)) => volume(&both),
        _ => f64::NAN,
    }
}

/// \[m³\]
fn volume(solid: &Manifold) -> f64 {
    let face = |start: usize| {
        let [a, b, c] = [0, 1, 2].map(|i| solid.ps[solid.hs[start + i].tail]);
        a.dot(b.cross(c)) / 6.0
    };
    (0..solid.hs.len()).step_by(3).map(face).sum()
}
