//! The hand's parts in the base frame, for tests of contact.

use nalgebra::{Isometry3, Point3, Vector3};

use super::allegro::link_name;
use super::parts::{Part, parts};
use super::{ALLEGRO_XELA_URDF, JOINT_COUNT, JOINT_NAMES};
use crate::mesh::TriMesh;
use crate::robot::KinematicTree;
use crate::shapes::{capsule, cuboid};

/// `t_base_link` of links 0–15.
pub(super) fn link_poses(q: &[f64; JOINT_COUNT]) -> Vec<Isometry3<f64>> {
    let robot = KinematicTree::from_urdf_str(ALLEGRO_XELA_URDF, None).unwrap();
    let state = JOINT_NAMES.map(str::to_owned).into_iter().zip(*q).collect();
    let poses = robot.forward_kinematics(&robot.joint_vector(&state).unwrap());
    (0..JOINT_COUNT).map(|i| poses[robot.link_index(&link_name(Some(i))).unwrap()]).collect()
}

/// Parts of a link with their pose in the base frame.
pub(super) fn posed(i: Option<usize>, poses: &[Isometry3<f64>]) -> Vec<(Isometry3<f64>, Part)> {
    let pose = i.map_or_else(Isometry3::identity, |i| poses[i]);
    parts(&link_name(i)).into_iter().map(|part| (pose, part)).collect()
}

/// Signed distance \[m\] of a point in the link frame.
pub(super) fn distance(part: &Part, p: &Vector3<f64>) -> f64 {
    match *part {
        Part::Box { size, center } => {
            let beyond = (p - Vector3::from(center)).abs() - 0.5 * Vector3::from(size);
            beyond.map(|d| d.max(0.0)).norm() + beyond.max().min(0.0)
        }
        Part::Capsule { low, high, radius } => {
            (p - Vector3::new(low[0], low[1], p.z.clamp(low[2], high[2]))).norm() - radius
        }
    }
}

/// Points of a surface, neighbors at most `step` \[m\] apart on each face.
pub(super) fn dense(mesh: &TriMesh, step: f64) -> Vec<Point3<f64>> {
    let mut points = Vec::new();
    for face in 0..mesh.faces.len() {
        let [a, b, c] = mesh.triangle(face);
        let longest = (b - a).norm().max((c - a).norm()).max((c - b).norm());
        let n = (longest / step).ceil().max(1.0) as usize;
        for i in 0..=n {
            for j in 0..=n - i {
                let (u, v) = (i as f64 / n as f64, j as f64 / n as f64);
                points.push(a + u * (b - a) + v * (c - a));
            }
        }
    }
    points
}

/// Smallest signed distance \[m\] of `points` (base frame) to a link: negative is penetration.
pub(super) fn gap(parts: &[(Isometry3<f64>, Part)], points: &[Point3<f64>]) -> f64 {
    let mut gap = f64::INFINITY;
    for (pose, part) in parts {
        let inverse = pose.inverse();
        gap = points.iter().map(|p| distance(part, &(inverse * p).coords)).fold(gap, f64::min);
    }
    gap
}

/// The surface of a part in the link frame.
pub(super) fn surface(part: &Part) -> TriMesh {
    let (mesh, center) = match *part {
        Part::Box { size, center } => (cuboid(size.into()), center.into()),
        Part::Capsule { low, high, radius } => (
            capsule(radius, 0.5 * (high[2] - low[2]), 24, 12),
            0.5 * (Vector3::from(low) + Vector3::from(high)),
        ),
    };
    mesh.transformed(&Isometry3::from(center))
}

#[test]
fn straight_fingers_reach_their_published_height() {
    let poses = link_poses(&[0.0; JOINT_COUNT]);
    // Distal joints: 112.8 mm along fingers that lean outward by 5°.
    let (s, c) = 0.08726646255_f64.sin_cos();
    let tip = |i: usize| poses[i].translation.vector;
    assert!((tip(7) - Vector3::new(0.0, 0.0, 0.1135)).norm() < 1e-12);
    assert!(
        (tip(3) - Vector3::new(0.0, 0.0435 + 0.1128 * s, 0.1128 * c - 0.001542)).norm() < 1e-12
    );
    assert!(
        (tip(11) - Vector3::new(0.0, -0.0435 - 0.1128 * s, 0.1128 * c - 0.001542)).norm() < 1e-12
    );
}

#[test]
fn part_surfaces_lie_at_zero_distance() {
    for part in [0, 3].into_iter().flat_map(|i| parts(&link_name(Some(i)))) {
        for point in dense(&surface(&part), 0.002) {
            let d = distance(&part, &point.coords);
            // Facets of the capsule lie up to r (1 − cos(π/24)) inside.
            assert!(d < 1e-12 && d > -3e-4, "{d}");
        }
    }
}
