//! Volumes of intersections. There is no union: the hand is given already united, by ours.

use std::panic::{AssertUnwindSafe, catch_unwind};

use prehend_geometry::{TriMesh, SolidUnion};

use super::NAME;
use super::parry::math::Pose;
use super::parry::shape::{self, TriMeshFlags};
use super::parry::transformation::intersect_meshes;
use super::queries::with_flags;
use crate::workloads::{Comparisons, Scenes};

/// \[cm³/m³\]
const CM3: f64 = 1e6;

pub(crate) fn add<'a>(to: &mut Comparisons<'a>, scenes: &'a Scenes) {
    let [a, b] = &scenes.pair;
    let a = solid(a);
    to.pair.add(NAME, move || shared(&a, b) * CM3, |volume| vec![volume]);
    let hand = solid(&SolidUnion::new(&scenes.links).expect("closed links").mesh());
    let (own, body) = (hand.clone(), &scenes.body);
    to.grasp.add(NAME, move || shared(&own, body) * CM3, |volume| vec![volume]);
    let all = move || scenes.posed.iter().map(|body| shared(&hand, body) * CM3).collect();
    to.poses.add(NAME, all, |volumes: Vec<f64>| volumes);
    let all =
        || scenes.cubes.iter().map(|pair| shared(&solid(&pair.a), &pair.b) / pair.scale).collect();
    to.cubes.add(NAME, all, |volumes: Vec<f64>| volumes);
}

fn solid(mesh: &TriMesh) -> shape::TriMesh {
    with_flags(mesh, TriMeshFlags::ORIENTED | TriMeshFlags::HALF_EDGE_TOPOLOGY)
}

/// \[m³\]; NaN where the library reports an error or panics.
fn shared(hand: &shape::TriMesh, body: &TriMesh) -> f64 {
    let body = solid(body);
    let here = Pose::IDENTITY;
    let run = || intersect_meshes(&here, hand, false, &here, &body, false);
    match catch_unwind(AssertUnwindSafe(run)) {
        Ok(Ok(both)) => both.map_or(0.0, |both| volume(&both)),
        _ => f64::NAN,
    }
}

/// \[m³\]
fn volume(solid: &shape::TriMesh) -> f64 {
    solid.triangles().map(|t| t.a.dot(t.b.cross(t.c)) / 6.0).sum()
}
