use std::slice::from_ref;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::*;
use crate::mass::signed_volume;
use crate::random::SplitMix64;
use crate::shapes;

/// A closed box of `size` about `center`, with eight vertices.
pub(crate) fn cuboid(size: [f64; 3], center: [f64; 3]) -> TriMesh {
    let place = Isometry3::from(Vector3::from(center));
    shapes::cuboid(size.into()).welded().transformed(&place)
}

/// A sphere about the origin by subdividing an octahedron `levels` times.
pub(crate) fn icosphere(radius: f64, levels: usize) -> TriMesh {
    let mut triangles = Vec::new();
    for signs in 0..8 {
        let s = |k: usize| if signs >> k & 1 == 0 { 1.0 } else { -1.0 };
        let [x, y, z] = [Vector3::x() * s(0), Vector3::y() * s(1), Vector3::z() * s(2)];
        triangles.push(if s(0) * s(1) * s(2) > 0.0 { [x, y, z] } else { [x, z, y] });
    }
    for _ in 0..levels {
        let split = |[a, b, c]: [Vector3<f64>; 3]| {
            let [ab, bc, ca] = [(a + b).normalize(), (b + c).normalize(), (c + a).normalize()];
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        triangles = triangles.into_iter().flat_map(split).collect();
    }
    let vertices = triangles.iter().flatten().map(|v| Point3::from(v * radius)).collect();
    let faces = (0..triangles.len() as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    TriMesh::new(vertices, faces).welded()
}

impl SolidUnion {
    /// Volume of the union \[m³\].
    pub(super) fn volume(&self) -> f64 {
        self.chain.as_ref().map_or(0.0, |c| volume(&c.positions, &c.faces))
    }
}

pub(super) fn intersection_volume(parts: &[TriMesh], b: &TriMesh) -> Result<f64, VolumeError> {
    SolidUnion::new(parts)?.intersection_volume(b)
}

fn check(parts: &[TriMesh], b: &TriMesh, expected: f64) {
    let volume = intersection_volume(parts, b).unwrap();
    assert!((volume - expected).abs() <= 1e-12 + 1e-9 * expected, "{volume} instead of {expected}");
}

#[test]
fn boxes_of_known_overlap() {
    let a = cuboid([1.0; 3], [0.0; 3]);
    check(from_ref(&a), &cuboid([1.0; 3], [0.5, 0.25, 0.1]), 0.5 * 0.75 * 0.9);
    // Nested either way, identical, and with coplanar sides.
    check(from_ref(&a), &cuboid([0.2; 3], [0.1; 3]), 0.008);
    check(&[cuboid([0.2; 3], [0.1; 3])], &a, 0.008);
    check(from_ref(&a), &a, 1.0);
    check(from_ref(&a), &cuboid([1.0; 3], [0.5, 0.0, 0.0]), 0.5);
    check(from_ref(&a), &cuboid([0.5, 0.5, 1.0], [0.25, 0.25, 0.0]), 0.25);
    // Apart, and touching in a face, an edge and a corner.
    for center in [[3.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0; 3]] {
        check(from_ref(&a), &cuboid([1.0; 3], center), 0.0);
    }
    assert_eq!(intersection_volume(&[], &a), Ok(0.0));
}

#[test]
fn solids_whose_boxes_overlap_but_which_do_not_meet_give_zero() {
    let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_4);
    let bar = cuboid([2.0, 0.1, 0.1], [0.0; 3])
        .transformed(&Isometry3::from_parts(Translation3::identity(), turn));
    let apart = bar.transformed(&Isometry3::translation(0.3, -0.3, 0.0));
    check(&[bar], &apart, 0.0);
    // Two parts with a gap between them, in which the other solid lies.
    let parts = [cuboid([1.0; 3], [-1.0, 0.0, 0.0]), cuboid([1.0; 3], [1.0, 0.0, 0.0])];
    check(&parts, &cuboid([0.9, 0.5, 0.5], [0.0; 3]), 0.0);
    check(&parts, &cuboid([1.2, 0.5, 0.5], [0.0; 3]), 2.0 * 0.1 * 0.25);
}

#[test]
fn overlapping_parts_count_once() {
    let parts: Vec<_> = (0..7).map(|k| cuboid([1.0; 3], [0.3 * f64::from(k), 0.0, 0.0])).collect();
    let body = SolidUnion::new(&parts).unwrap();
    assert!((body.volume() - 2.8).abs() < 1e-9);
    assert!((crate::mass::mass_properties(&body.mesh(), 1.0).unwrap().volume - 2.8).abs() < 1e-9);
    let volume = body.intersection_volume(&cuboid([10.0, 0.5, 2.0], [0.0; 3])).unwrap();
    assert!((volume - 1.4).abs() < 1e-9, "{volume}");
}

#[test]
fn parts_that_touch_join_into_one() {
    // In a side, an edge and a corner, as the links of a hand at rest do; the turn makes touching inexact.
    for t in [
        Isometry3::identity(),
        Isometry3::new(Vector3::new(0.1, 7.0, -3.0), Vector3::new(0.3, -0.7, 1.1)),
    ] {
        for (center, inside) in [([1.0, 0.0, 0.0], 1.0), ([1.0, 1.0, 0.0], 0.5), ([1.0; 3], 0.25)] {
            let parts = [[0.0; 3], center].map(|c| cuboid([1.0; 3], c).transformed(&t));
            assert!((SolidUnion::new(&parts).unwrap().volume() - 2.0).abs() < 1e-9);
            check(&parts, &cuboid([4.0; 3], [0.5; 3]).transformed(&t), 2.0);
            check(&parts, &cuboid([1.0; 3], center.map(|c| 0.5 * c)).transformed(&t), inside);
        }
    }
    // Different cross-sections, so that the shared side belongs to neither outline.
    let parts = [cuboid([1.0; 3], [0.0; 3]), cuboid([1.0, 0.5, 0.3], [1.0, 0.1, 0.0])];
    check(&parts, &cuboid([1.0, 2.0, 2.0], [0.5, 0.0, 0.0]), 0.5 + 0.075);
}

#[test]
fn cylinder_and_two_spheres_with_coinciding_rings_unite() {
    // As the fingertips of the built-in hand: every ring of the cylinder is the equator of a sphere.
    let (r, h, columns) = (0.0157, 0.0236, 48);
    let up = |z: f64| Isometry3::translation(0.0, 0.0, z);
    let ball = shapes::sphere(r, columns).welded();
    let pieces = [
        shapes::cylinder(r, h, columns).welded(),
        ball.transformed(&up(-0.5 * h)),
        ball.transformed(&up(0.5 * h)),
    ];
    let whole = shapes::capsule(r, 0.5 * h, columns, columns / 4).welded();
    let palm = cuboid([0.0414, 0.112, 0.0448], [0.0, 0.045, -0.0231]);
    let volume = |parts: &[TriMesh]| SolidUnion::new(parts).unwrap().volume();
    let mut random = SplitMix64::new(3);
    for _ in 0..40 {
        let mut vector = |s: f64| Vector3::from_fn(|_, _| s * (2.0 * random.uniform() - 1.0));
        let t = Isometry3::new(vector(0.3), vector(2.0));
        let parts = |list: &[TriMesh]| list.iter().map(|p| p.transformed(&t)).collect::<Vec<_>>();
        let (pieces, whole, palm) = (parts(&pieces), whole.transformed(&t), palm.transformed(&t));
        let with_palm: Vec<_> = pieces.iter().chain([&palm]).cloned().collect();
        let expected = volume(from_ref(&whole));
        assert!((volume(&pieces) - expected).abs() < 1e-10);
        let expected = volume(&[whole.clone(), palm.clone()]);
        assert!((volume(&with_palm) - expected).abs() < 1e-10);
        let shared = intersection_volume(from_ref(&whole), &palm).unwrap();
        assert!(shared > 1e-7);
        assert!((intersection_volume(&pieces, &palm).unwrap() - shared).abs() < 1e-10);
    }
}

#[test]
fn built_in_hand_unites_in_any_joint_state() {
    let robot =
        crate::robot::KinematicTree::from_urdf_str(crate::hand::ALLEGRO_XELA_URDF, None).unwrap();
    let unite = |base: &Isometry3<f64>, q: &[f64]| {
        let poses = robot.forward_kinematics(q);
        let parts: Vec<TriMesh> = (robot.links().iter().zip(&poses))
            .flat_map(|(link, t)| link.parts.iter().map(move |p| p.transformed(&(base * t))))
            .collect();
        let body = SolidUnion::new(&parts).unwrap();
        let separate: f64 = parts.iter().map(signed_volume).sum();
        assert!(body.volume() > 0.5 * separate && body.volume() < separate);
    };
    // The frame whose union had an edge shared by more than two faces.
    let turn = nalgebra::Matrix3::new(
        0.1949106,
        0.98082101,
        0.0,
        0.1424646,
        -0.02831083,
        -0.98939493,
        -0.97041934,
        0.19284356,
        -0.14525035,
    );
    let base = Isometry3::from_parts(
        Translation3::new(-0.00246397, 0.03765586, 0.56022477),
        UnitQuaternion::from_matrix(&turn),
    );
    let q = [
        -0.278036, 0.36, 0.306703, 0.855094, -0.15013, 0.15, 0.127406, 1.618, -0.040351, 0.18,
        0.455203, 1.419141, 1.255722, 0.489445, 0.87, 0.686625,
    ];
    unite(&base, &q);
    let mut random = SplitMix64::new(5);
    for _ in 0..50 {
        let q = q.map(|q| q + 0.2 * (random.uniform() - 0.5));
        let mut vector = |s: f64| Vector3::from_fn(|_, _| s * (2.0 * random.uniform() - 1.0));
        let base = Isometry3::new(vector(0.3) + Vector3::z(), vector(2.0));
        unite(&base, &q);
    }
}

#[test]
fn turned_boxes_and_lens_of_two_spheres() {
    // Two squares at 45° overlap in a regular octagon of area 2(√2 − 1).
    let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_4);
    let turned = cuboid([1.0, 1.0, 0.5], [0.0; 3])
        .transformed(&Isometry3::from_parts(Translation3::identity(), turn));
    check(&[cuboid([1.0; 3], [0.0; 3])], &turned, 2f64.sqrt() - 1.0);
    // V = π(4r + d)(2r − d)²/12.
    let (r, d) = (0.05, 0.06);
    let a = icosphere(r, 5);
    let b = icosphere(r, 5)
        .transformed(&Isometry3::new(Vector3::new(d, 0.0, 0.0), Vector3::new(0.1, 0.2, 0.3)));
    let lens = std::f64::consts::PI * (4.0 * r + d) * (2.0 * r - d).powi(2) / 12.0;
    let volume = intersection_volume(&[a], &b).unwrap();
    assert!((volume / lens - 1.0).abs() < 4e-3 && volume < lens, "{volume} {lens}");
}

#[test]
fn results_repeat_bit_for_bit() {
    let t = Isometry3::new(Vector3::new(0.03, 0.01, 0.02), Vector3::new(0.4, 0.2, 0.3));
    let (a, b) = (icosphere(0.05, 4), icosphere(0.05, 4).transformed(&t));
    let first = intersection_volume(&[a.clone(), cuboid([0.05; 3], [0.0; 3])], &b).unwrap();
    for _ in 0..5 {
        let again = intersection_volume(&[a.clone(), cuboid([0.05; 3], [0.0; 3])], &b).unwrap();
        assert_eq!(again.to_bits(), first.to_bits());
    }
}

#[test]
fn unusable_meshes_are_named() {
    let good = cuboid([1.0; 3], [0.0; 3]);
    let mut open = good.clone();
    open.faces.pop();
    let error = intersection_volume(&[good.clone(), open.clone()], &good).unwrap_err();
    assert_eq!(error, VolumeError::NotClosed { what: "part 1 of the body".into(), edges: 3 });
    let mut inverted = good.clone();
    inverted.faces.iter_mut().for_each(|f| f.swap(0, 1));
    assert!(matches!(
        intersection_volume(from_ref(&good), &inverted),
        Err(VolumeError::NoVolume { .. })
    ));
    let mut broken = good.clone();
    broken.vertices[3].x = f64::NAN;
    assert!(matches!(intersection_volume(&[broken], &good), Err(VolumeError::Invalid { .. })));
    let mut wild = good.clone();
    wild.faces[0][0] = 99;
    assert!(matches!(intersection_volume(&[wild], &good), Err(VolumeError::Invalid { .. })));
    assert!(intersection_volume(&[TriMesh::default()], &good).is_err());
}

#[test]
fn degenerate_boxes_share_what_they_should() {
    let at = |c: [f64; 3]| Isometry3::from(Vector3::from(c));
    let quarter = UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_4);
    let corner_down =
        UnitQuaternion::rotation_between(&Vector3::repeat(1.0), &-Vector3::z()).unwrap_or_default();
    let unit = || cuboid([1.0; 3], [0.0; 3]);
    let turned = |turn: UnitQuaternion<f64>, c: [f64; 3]| {
        unit().transformed(&(at(c) * Isometry3::from_parts(Translation3::identity(), turn)))
    };
    let (root2, root3) = (2f64.sqrt(), 3f64.sqrt());
    let cases = [
        (unit(), 1.0),
        (cuboid([1.0; 3], [0.5, 0.5, 0.0]), 0.25),
        (cuboid([0.5; 3], [0.25, 0.25, 0.25]), 0.125),
        (cuboid([0.5; 3], [0.0; 3]), 0.125),
        (cuboid([2.0, 1.0, 0.25], [0.0; 3]), 0.25),
        // An edge along a face, along an edge, and across an edge.
        (turned(quarter, [0.5 + 0.5 * root2, 0.0, 0.0]), 0.0),
        (turned(quarter, [0.5, 0.5 + 0.5 * root2, 0.0]), 0.0),
        (turned(quarter, [0.5, 0.0, 0.0]), 0.5 - (0.5 * root2 - 0.5).powi(2)),
        // A corner on a face, and one at its corner.
        (turned(corner_down, [0.0, 0.0, 0.5 + 0.5 * root3]), 0.0),
        (turned(corner_down, [0.5, 0.5, 0.5 + 0.5 * root3]), 0.0),
        // A corner 0.1 below the face: three right angles make 0.1³ √3/2.
        (turned(corner_down, [0.0, 0.0, 0.4 + 0.5 * root3]), 0.5 * root3 * 1e-3),
    ];
    let frame = Isometry3::new(Vector3::new(0.3, -2.0, 1.0), Vector3::new(0.4, 1.0, -0.2));
    for (i, (b, expected)) in cases.iter().enumerate() {
        for t in [Isometry3::identity(), at([0.25, 8.0, -2.0]), frame] {
            let (a, b) = (unit().transformed(&t), b.transformed(&t));
            for (a, b) in [(&a, &b), (&b, &a)] {
                let volume = intersection_volume(from_ref(a), b).unwrap();
                assert!((volume - expected).abs() < 4e-15, "case {i}: {volume} {expected}");
            }
        }
        let [a, b] = [&unit(), b].map(|m| m.clone().scaled(1e-4));
        let volume = intersection_volume(from_ref(&a), &b).unwrap();
        assert!((volume * 1e12 - expected).abs() < 1e-14, "case {i}: {volume:e}");
    }
}

#[test]
fn a_body_shares_all_of_itself_and_nothing_with_its_neighbor() {
    let ball = icosphere(0.05, 4);
    let own = signed_volume(&ball);
    assert!((intersection_volume(from_ref(&ball), &ball).unwrap() / own - 1.0).abs() < 1e-13);
    // Twice the same part is that part.
    let twice = SolidUnion::new(&[ball.clone(), ball.clone()]).unwrap();
    assert!((twice.volume() / own - 1.0).abs() < 1e-13);
    assert!((twice.intersection_volume(&ball).unwrap() / own - 1.0).abs() < 1e-13);
}

#[test]
fn a_cavity_belongs_to_the_shell_around_it() {
    let hollow = |size: f64| {
        let mut mesh = cuboid([1.0; 3], [0.0; 3]);
        let mut inner = cuboid([size; 3], [0.0; 3]);
        inner.faces.iter_mut().for_each(|f| f.swap(0, 1));
        mesh.append(&inner);
        mesh
    };
    check(&[hollow(0.5)], &cuboid([0.5; 3], [0.0; 3]), 0.0);
    check(&[hollow(0.5)], &cuboid([0.8; 3], [0.0; 3]), 0.512 - 0.125);
    check(&[hollow(0.5)], &hollow(0.8), 1.0 - 0.512);
    // Another part fills half of it.
    check(&[hollow(0.5), cuboid([0.5; 3], [0.25, 0.0, 0.0])], &cuboid([0.5; 3], [0.0; 3]), 0.0625);
}

#[test]
fn the_surface_of_a_union_is_what_lies_outside_once() {
    // A bar through a cube leaves a hole in two of its sides.
    let parts = [cuboid([1.0; 3], [0.0; 3]), cuboid([0.4, 0.3, 2.0], [0.1, 0.05, 0.0])];
    let mesh = SolidUnion::new(&parts).unwrap().mesh();
    assert!((mesh.area() - (6.0 + 1.4)).abs() < 1e-12, "{}", mesh.area());
    assert_eq!(crate::mass::closedness(&mesh), 0);
    // Two balls: each face of the union lies on one and outside the other.
    let (r, d) = (0.05, 0.06);
    let t = Isometry3::new(Vector3::new(d, 0.0, 0.0), Vector3::new(0.1, 0.2, 0.3));
    let balls = [icosphere(r, 4), icosphere(r, 4).transformed(&t)];
    let mesh = SolidUnion::new(&balls).unwrap().mesh();
    assert_eq!(crate::mass::closedness(&mesh), 0);
    let zones = 2.0 * std::f64::consts::TAU * r * (r + 0.5 * d);
    assert!((mesh.area() / zones - 1.0).abs() < 5e-3, "{} {zones}", mesh.area());
    for f in 0..mesh.faces.len() {
        let [a, b, c] = mesh.triangle(f).map(|p| p.coords);
        let center = (a + b + c) / 3.0;
        let from = [center, center - t.translation.vector];
        let outward = if from[0].norm() > from[1].norm() { from[1] } else { from[0] };
        let normal = mesh.area_vector(f);
        assert!(from.iter().all(|x| x.norm() > 0.99 * r) && normal.dot(&outward) >= -1e-18);
    }
}
