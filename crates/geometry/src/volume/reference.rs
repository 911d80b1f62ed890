//! The two reference cases and random poses, against another library's booleans.

use std::f64::consts::{PI, TAU};
use std::panic::{AssertUnwindSafe, catch_unwind};

use boolmesh::prelude::{Manifold, OpType, compute_boolean};
use nalgebra::{Isometry3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};

use super::SolidUnion;
use super::tests::{icosphere, intersection_volume};
use crate::mass::signed_volume;
use crate::mesh::TriMesh;
use crate::random::SplitMix64;

/// Nine significant digits, as the files of the reference cases have.
fn as_in_file(mut mesh: TriMesh) -> TriMesh {
    let rounded = |c: f64| format!("{c:.8e}").parse().unwrap();
    mesh.vertices.iter_mut().for_each(|p| *p = p.map(rounded));
    mesh
}

/// Rows of points around an axis, closed by a pole at each end.
fn from_rows(mut vertices: Vec<Point3<f64>>, columns: usize, poles: [Point3<f64>; 2]) -> TriMesh {
    let (rows, top) = (vertices.len() / columns, vertices.len() as u32);
    let at = |i: usize, j: usize| (i * columns + j % columns) as u32;
    let mut faces = Vec::new();
    for i in 0..rows - 1 {
        for j in 0..columns {
            let [a, b, c, d] = [at(i, j), at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)];
            faces.extend([[a, c, b], [b, c, d]]);
        }
    }
    for j in 0..columns {
        faces.push([top, at(0, j), at(0, j + 1)]);
        faces.push([top + 1, at(rows - 1, j + 1), at(rows - 1, j)]);
    }
    vertices.extend(poles);
    TriMesh::new(vertices, faces)
}

/// An ellipsoid of 5 × 5 × 7 cm with bumps.
fn bumpy(columns: usize, rows: usize, phase: [f64; 4]) -> TriMesh {
    let (radius, amplitude) = (0.05, 0.15);
    let mut vertices = Vec::new();
    for i in 1..rows {
        let t = PI * i as f64 / rows as f64;
        for j in 0..columns {
            let a = TAU * j as f64 / columns as f64;
            let long = (3.0 * t + phase[0]).sin() * t.sin().powi(2) * (4.0 * a + phase[1]).cos();
            let short = (5.0 * t + phase[2]).cos() * t.sin().powi(2) * (7.0 * a + phase[3]).sin();
            let r = radius * (1.0 + amplitude * long + 0.5 * amplitude * short);
            vertices.push(Point3::new(
                r * t.sin() * a.cos(),
                r * t.sin() * a.sin(),
                1.4 * r * t.cos(),
            ));
        }
    }
    from_rows(vertices, columns, [1.4, -1.4].map(|z| Point3::new(0.0, 0.0, z * radius)))
}

fn capsule(from: Vector3<f64>, to: Vector3<f64>, r: f64) -> TriMesh {
    let (columns, cap) = (20, 7_u32);
    let length = (to - from).norm();
    let z = (to - from) / length;
    let seed = if z.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let x = z.cross(&seed).normalize();
    let y = z.cross(&x);
    let angle = |k: u32| 0.5 * PI * f64::from(k) / f64::from(cap);
    let upper = (1..=cap).map(|k| (r * angle(k).sin(), length + r * angle(k).cos()));
    let lower = (cap..2 * cap).map(|k| (r * angle(k).sin(), r * angle(k).cos()));
    let place = |p: Vector3<f64>| Point3::from(from + x * p.x + y * p.y + z * p.z);
    let mut vertices = Vec::new();
    for (radius, height) in upper.chain(lower) {
        for j in 0..columns {
            let a = TAU * j as f64 / columns as f64;
            vertices.push(place(Vector3::new(radius * a.cos(), radius * a.sin(), height)));
        }
    }
    let poles = [length + r, -r].map(|h| place(Vector3::z() * h));
    from_rows(vertices, columns, poles)
}

/// Four fingers of four capsules about a palm of one; all overlap their neighbors.
fn hand() -> Vec<TriMesh> {
    let radius = 0.062;
    let mut parts = Vec::new();
    for (k, z) in [-0.03, -0.005, 0.02, 0.0].into_iter().enumerate() {
        let side = if k == 3 { -1.0 } else { 1.0 };
        let at = |t: f64| Vector3::new(radius * t.cos(), radius * (t * side).sin(), z);
        for i in 0..4 {
            let t = 2.6 - 0.75 * f64::from(i);
            parts.push(capsule(at(t), at(2.6 - 0.75 * f64::from(i + 1)), 0.011));
        }
    }
    let palm = [-0.03, 0.03].map(|y| Vector3::new(-radius - 0.005, y, 0.0));
    parts.push(capsule(palm[0], palm[1], 0.02));
    parts.into_iter().map(as_in_file).collect()
}

const PHASES: [[f64; 4]; 3] = [
    [3.2158701122134374, 5.971939531762716, 0.9057815605287021, 5.960540267916768],
    [1.6437575180951982, 1.8754751666228542, 5.115931210029399, 0.5775248971188099],
    [0.5381495885689892, 1.4879242956303682, 5.034555946803014, 3.6578319513973883],
];

/// The pair of 10,000 faces each.
fn pair() -> [TriMesh; 2] {
    let turn = Rotation3::from_axis_angle(&Unit::new_normalize(Vector3::new(1., 2., 3.)), 0.7);
    let mut b = bumpy(100, 51, PHASES[2]);
    b.vertices.iter_mut().for_each(|p| *p = turn * *p + Vector3::new(0.02, 0.01, 0.03));
    [as_in_file(bumpy(100, 51, PHASES[1])), as_in_file(b)]
}

/// The object of 16,128 faces.
fn object() -> TriMesh {
    as_in_file(bumpy(128, 64, PHASES[0]))
}

fn random_pose(random: &mut SplitMix64, shift: f64) -> Isometry3<f64> {
    let axis = Unit::new_normalize(Vector3::from_fn(|_, _| random.normal()));
    let turn = UnitQuaternion::from_axis_angle(&axis, PI * random.uniform());
    Isometry3::from_parts(
        Translation3::from(Vector3::from_fn(|_, _| shift * random.normal())),
        turn,
    )
}

/// The volume of the boolean by boolmesh, `None` where it fails.
fn oracle(a: &TriMesh, b: &TriMesh) -> Option<f64> {
    let manifold = |mesh: &TriMesh| {
        let positions: Vec<f64> = mesh.vertices.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
        let corners: Vec<usize> = mesh.faces.iter().flatten().map(|v| *v as usize).collect();
        Manifold::new(&positions, &corners)
    };
    let run = || compute_boolean(&manifold(a)?, &manifold(b)?, OpType::Intersect);
    let result = catch_unwind(AssertUnwindSafe(run)).ok()?.ok()?;
    let vertices = result.ps.iter().map(|p| Point3::new(p.x, p.y, p.z)).collect();
    let faces = result.hs.chunks_exact(3).map(|h| [0, 1, 2].map(|k| h[k].tail as u32));
    Some(signed_volume(&TriMesh::new(vertices, faces.collect())))
}

#[test]
fn reference_cases() {
    let [a, b] = pair();
    let volume = 1e6 * intersection_volume(&[a], &b).unwrap();
    assert!((volume - 408.323_172_238).abs() < 1e-9, "{volume:.9}");

    let (parts, object) = (hand(), object());
    let body = SolidUnion::new(&parts).unwrap();
    assert!((1e6 * body.volume() - 372.708_287_870).abs() < 1e-9, "{:.9}", 1e6 * body.volume());
    let volume = 1e6 * body.intersection_volume(&object).unwrap();
    assert!((volume - 22.644_258_041).abs() < 1e-9, "{volume:.9}");
    // The parts as shells of one mesh, and the roles swapped.
    let mut whole = TriMesh::default();
    parts.iter().for_each(|p| whole.append(p));
    let swapped = 1e6 * intersection_volume(&[object], &whole).unwrap();
    assert!((swapped - volume).abs() < 1e-9, "{swapped:.9}");
}

#[test]
fn two_hundred_poses_agree_with_another_library() {
    let a = bumpy(40, 21, PHASES[0]);
    let b = bumpy(36, 19, PHASES[1]);
    let body = SolidUnion::new(std::slice::from_ref(&a)).unwrap();
    let mut random = SplitMix64::new(11);
    let (mut compared, mut empty) = (0, 0);
    for _ in 0..200 {
        let pose = random_pose(&mut random, 0.04);
        let b = b.transformed(&pose);
        let volume = body.intersection_volume(&b).unwrap();
        match oracle(&a, &b) {
            Some(expected) => {
                compared += 1;
                assert!((volume - expected).abs() < 1e-16, "{volume:e} {expected:e}");
            }
            // It reports an empty intersection as an error.
            None => {
                empty += 1;
                assert_eq!(volume, 0.0);
            }
        }
    }
    assert!(compared > 180 && empty > 0, "{compared} {empty}");
}

#[test]
fn random_convex_bodies_agree_with_another_library() {
    let mut random = SplitMix64::new(12);
    for _ in 0..100 {
        // Spheres stretched at random, fine and coarse.
        let mut body = |levels: usize| {
            let scale = Vector3::from_fn(|_, _| 0.02 + 0.1 * random.uniform());
            let mut mesh = icosphere(1.0, levels);
            mesh.vertices.iter_mut().for_each(|p| p.coords.component_mul_assign(&scale));
            mesh.transformed(&random_pose(&mut random, 0.03))
        };
        let (a, b) = (body(1), body(3));
        let volume = intersection_volume(std::slice::from_ref(&a), &b).unwrap();
        match oracle(&a, &b) {
            Some(expected) => assert!((volume - expected).abs() < 1e-15 * expected.max(1.0)),
            None => assert_eq!(volume, 0.0),
        }
    }
}

#[test]
fn bits_are_the_same_on_any_thread_and_for_any_pool() {
    let (parts, object) = (hand(), bumpy(40, 21, PHASES[0]));
    let pose = random_pose(&mut SplitMix64::new(14), 0.01);
    let bits = || {
        let body = SolidUnion::new(&parts).unwrap();
        let shared = body.intersection_volume(&object.transformed(&pose)).unwrap();
        let mesh = body.mesh();
        let surface = mesh
            .vertices
            .iter()
            .flat_map(|p| p.iter().map(|v| v.to_bits()).collect::<Vec<_>>())
            .collect::<Vec<_>>();
        (shared.to_bits(), surface, mesh.faces)
    };
    let first = bits();
    for threads in [1, 2, 5] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert!(pool.install(bits) == first, "{threads} threads");
    }
}
