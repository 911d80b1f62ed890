//! Volume that bodies share, and the union of the hand's links.

use std::slice::from_ref;

use nalgebra::{Isometry3, Point3, Vector3};
use prehend_geometry::{Moments, SolidUnion, SplitMix64, TriMesh};

use super::table::Comparison;

const CM3: &str = "cm³";
const CM3_PER_M3: f64 = 1e6;
/// \[cm³\]
const TOLERANCE: f64 = 1e-6;
/// Volumes on which CGAL and manifold3d agree \[cm³\].
const UNION: f64 = 372.7082880;
const PAIR: f64 = 408.32317224;
const GRASP: f64 = 22.64425805;

/// Union of the hand's 17 links; the answer is its volume.
pub(crate) fn union(links: &[TriMesh]) -> Comparison<'_> {
    let mut job = Comparison::new("union of 17 links", CM3, TOLERANCE, vec![(0, UNION)]);
    job.add("ours", || prepared(links), |union| vec![volume(&union.mesh())]);
    job
}

/// Intersection of two bodies of 10 000 faces.
pub(crate) fn pair([a, b]: &[TriMesh; 2]) -> Comparison<'_> {
    let mut job = Comparison::new("volume, 10k ∩ 10k", CM3, TOLERANCE, vec![(0, PAIR)]);
    let union = prepared(from_ref(a));
    job.add("ours", move || shared(&union, b), |volume| vec![volume]);
    job
}

/// Intersection of the body with the hand, whose union is computed before.
pub(crate) fn grasp<'a>(links: &[TriMesh], body: &'a TriMesh) -> Comparison<'a> {
    let mut job = Comparison::new("volume, body ∩ hand", CM3, TOLERANCE, vec![(0, GRASP)]);
    let union = prepared(links);
    job.add("ours", move || shared(&union, body), |volume| vec![volume]);
    job
}

/// Intersection in 200 poses of the body, of which the first is that of [`grasp`].
pub(crate) fn in_poses<'a>(links: &[TriMesh], posed: &'a [TriMesh]) -> Comparison<'a> {
    let mut job = Comparison::new("volume, 200 poses", CM3, TOLERANCE, vec![(0, GRASP)]);
    let union = prepared(links);
    let all = move || posed.iter().map(|body| shared(&union, body)).collect();
    job.add("ours", all, |volumes: Vec<f64>| volumes);
    job
}

/// Poses of the body about the hand: any orientation, 15 mm of noise.
pub(super) fn poses() -> Vec<Isometry3<f64>> {
    let mut random = SplitMix64::new(3);
    let mut pose = || {
        let mut vector = || Vector3::from_fn(|_, _| random.normal());
        let (axis, shift) = (vector().normalize(), vector() * 0.015);
        Isometry3::new(shift, axis * (random.uniform() * std::f64::consts::PI))
    };
    std::iter::once(Isometry3::identity()).chain((1..200).map(|_| pose())).collect()
}

/// Two unit cubes that meet where booleans are delicate.
pub(crate) struct Cubes {
    pub(crate) a: TriMesh,
    pub(crate) b: TriMesh,
    /// Size of a cube, to the third power.
    pub(crate) scale: f64,
    /// In such units.
    shared: f64,
}

/// Intersections of cubes; the answers are their volumes in cubes.
pub(crate) fn of_cubes(cubes: &[Cubes]) -> Comparison<'_> {
    let truth = cubes.iter().map(|pair| pair.shared).enumerate().collect();
    let mut job = Comparison::new("volume, 7 pairs of cubes", "cubes", 1e-9, truth);
    let all = || {
        cubes
            .iter()
            .map(|pair| shared(&prepared(from_ref(&pair.a)), &pair.b) / pair.scale)
            .collect()
    };
    let in_cubes = |volumes: Vec<f64>| volumes.iter().map(|v| v / CM3_PER_M3).collect();
    job.add("ours", all, in_cubes);
    job
}

/// Coplanar faces, identical, nested, apart, touching in a face, touching in an edge, and coplanar at 0.1 mm.
pub(super) fn cubes() -> Vec<Cubes> {
    let moved = |x: f64, y: f64, z: f64| cube(1.0, Vector3::new(x, y, z));
    let mut pairs: Vec<Cubes> = [
        (moved(0.5, 0.5, 0.0), 0.25),
        (moved(0.0, 0.0, 0.0), 1.0),
        (cube(0.5, Vector3::repeat(0.25)), 0.125),
        (moved(3.0, 3.0, 3.0), 0.0),
        (moved(1.0, 0.0, 0.0), 0.0),
        (moved(1.0, 1.0, 0.0), 0.0),
    ]
    .map(|(b, shared)| Cubes { a: moved(0.0, 0.0, 0.0), b, scale: 1.0, shared })
    .into();
    let size = 1e-4;
    let [a, b] = [0.0, 0.5 * size].map(|shift| cube(size, Vector3::new(shift, shift, 0.0)));
    pairs.push(Cubes { a, b, scale: size.powi(3), shared: 0.25 });
    pairs
}

/// A cube of eight corners with its lowest at `low`.
fn cube(size: f64, low: Vector3<f64>) -> TriMesh {
    let corner = |i: usize| {
        let unit = Vector3::from([4, 2, 1].map(|bit| f64::from(u8::from(i & bit != 0))));
        Point3::from(low + unit * size)
    };
    let faces = [
        [[0, 1, 3], [0, 3, 2]],
        [[4, 6, 7], [4, 7, 5]],
        [[0, 4, 5], [0, 5, 1]],
        [[2, 3, 7], [2, 7, 6]],
        [[0, 2, 6], [0, 6, 4]],
        [[1, 5, 7], [1, 7, 3]],
    ];
    TriMesh::new((0..8).map(corner).collect(), faces.into_iter().flatten().collect())
}

/// \[cm³\]
fn volume(mesh: &TriMesh) -> f64 {
    let triangles = (0..mesh.faces.len()).map(|face| mesh.triangle(face));
    Moments::enclosed(triangles).volume * CM3_PER_M3
}

fn prepared(parts: &[TriMesh]) -> SolidUnion {
    SolidUnion::new(parts).expect("closed parts")
}

/// \[cm³\]
fn shared(union: &SolidUnion, body: &TriMesh) -> f64 {
    union.intersection_volume(body).map_or(f64::NAN, |volume| volume * CM3_PER_M3)
}
