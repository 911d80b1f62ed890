use super::winding::{Accuracy, COARSE, FINE};
use super::*;
use crate::random::SplitMix64;

/// Within half a meter of the origin along each axis.
fn point(random: &mut SplitMix64) -> Point3<f64> {
    Point3::from([(); 3].map(|()| random.uniform() - 0.5))
}

/// A closed bumpy ball of `2 n (n - 1)` faces, seams and poles shared.
fn ball(n: usize) -> TriMesh {
    let mut vertices = vec![Point3::new(0.0, 0.0, 1.0)];
    for i in 1..n {
        let polar = std::f64::consts::PI * i as f64 / n as f64;
        for j in 0..n {
            let azimuth = std::f64::consts::TAU * j as f64 / n as f64;
            let r = 1.0 + 0.2 * (3.0 * azimuth).sin() * (2.0 * polar).sin();
            vertices.push(Point3::new(
                r * polar.sin() * azimuth.cos(),
                r * polar.sin() * azimuth.sin(),
                r * polar.cos(),
            ));
        }
    }
    vertices.push(Point3::new(0.0, 0.0, -1.0));
    let at = |i: usize, j: usize| (1 + (i - 1) * n + j % n) as u32;
    let last = vertices.len() as u32 - 1;
    let mut faces = Vec::new();
    for j in 0..n {
        faces.push([0, at(1, j), at(1, j + 1)]);
        faces.push([last, at(n - 1, j + 1), at(n - 1, j)]);
        for i in 1..n - 1 {
            faces.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            faces.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    TriMesh::new(vertices, faces)
}

fn brute_force(mesh: &TriMesh, p: &Point3<f64>) -> f64 {
    (0..mesh.faces.len())
        .map(|f| triangle::Triangle::new(mesh.triangle(f), 0).closest(&p.coords).distance_squared)
        .fold(f64::INFINITY, f64::min)
        .sqrt()
}

#[test]
fn agrees_with_every_triangle_in_turn() {
    for (mesh, offset) in [(ball(24), 0.0), (ball(24), 1000.0)] {
        let shift = Vector3::repeat(offset);
        let mesh = mesh.transformed(&nalgebra::Isometry3::translation(offset, offset, offset));
        let tree = ClosestPoints::new(&mesh).unwrap();
        let mut random = SplitMix64::new(7);
        for _ in 0..500 {
            let p = Point3::from(point(&mut random).coords * 4.0 + shift);
            let expected = brute_force(&mesh, &p);
            let found = tree.closest(&p, f64::INFINITY).unwrap();
            assert_eq!(found.distance, expected);
            assert!(((p - found.point).norm() - expected).abs() < 1e-12);
            let [a, b, c] = mesh.triangle(found.face as usize);
            let [u, v, w] = found.barycentric;
            let rebuilt = a.coords * u + b.coords * v + c.coords * w;
            assert!((rebuilt - found.point.coords).norm() < 1e-12);
            assert!(tree.closest(&p, expected * 0.999).is_none());
            assert!(tree.closest(&p, expected * 1.001).is_some());
            // Any hint, good or bad, leaves the distance alone.
            for hint in [0, found.face, 500, u32::MAX] {
                let hinted = tree.closest_with_hint(&p, f64::INFINITY, hint).unwrap();
                assert_eq!(hinted, found);
            }
        }
    }
}

#[test]
fn the_gradient_is_the_unit_direction() {
    let tree = ClosestPoints::new(&ball(16)).unwrap();
    let mut random = SplitMix64::new(5);
    let step = 1e-6;
    let mut checked = 0;
    for _ in 0..200 {
        let p = point(&mut random) * 3.0;
        let (signed, closest) = tree.signed_distance(&p);
        let direction = (p - closest.point) / signed;
        let difference = Vector3::from_fn(|i, _| {
            let mut e = Vector3::zeros();
            e[i] = step;
            (tree.signed_distance(&(p + e)).0 - tree.signed_distance(&(p - e)).0) / (2.0 * step)
        });
        // Inside, a difference may straddle the medial axis, where there is no gradient.
        if signed > 0.02 {
            assert!((direction - difference).norm() < 1e-6, "{direction} {difference}");
            checked += 1;
        }
    }
    assert!(checked > 100);
}

#[test]
fn seams_and_inverted_faces_do_not_hide_the_inside() {
    let mut mesh = ball(20);
    // As at a texture seam: every face with vertices of its own.
    let corners: Vec<_> = mesh.faces.iter().flatten().map(|&v| mesh.vertices[v as usize]).collect();
    let split = TriMesh::new(
        corners,
        (0..mesh.faces.len() as u32).map(|f| [0, 1, 2].map(|i| 3 * f + i)).collect(),
    );
    let reference = ClosestPoints::with_winding_sign(&mesh).unwrap();
    assert!(!reference.is_closed());
    let split = ClosestPoints::new(&split).unwrap();
    mesh.faces.iter_mut().for_each(|f| f.swap(0, 1));
    let inverted = ClosestPoints::new(&mesh).unwrap();
    let mut random = SplitMix64::new(11);
    let mut inside = 0;
    for _ in 0..1000 {
        let p = point(&mut random) * 2.5;
        let expected = reference.signed_distance(&p).0;
        inside += usize::from(expected < 0.0);
        assert_eq!(split.signed_distance(&p).0, expected);
        assert!((inverted.signed_distance(&p).0 - expected).abs() < 1e-12);
    }
    assert!(inside > 100 && inside < 900);
    assert!(split.is_closed());
    assert!(inverted.is_closed());
}

#[test]
fn an_open_mesh_uses_the_winding_number() {
    let mut mesh = ball(40);
    let closed = ClosestPoints::new(&mesh).unwrap();
    mesh.faces.truncate(mesh.faces.len() - 6);
    let open = ClosestPoints::new(&mesh).unwrap();
    assert!(!open.is_closed());
    let mut random = SplitMix64::new(13);
    for _ in 0..1000 {
        let p = point(&mut random) * 2.5;
        let (expected, _) = closed.signed_distance(&p);
        // Near the surface, closest points may differ where the hole is.
        if expected.abs() > 0.15 {
            assert_eq!(open.signed_distance(&p).0 < 0.0, expected < 0.0);
        }
    }
}

/// The middle of a mesh is the origin of its dipoles: distances in single precision may be anything there, zero included.
#[test]
fn the_middle_of_an_open_mesh_is_inside() {
    let mut mesh = ball(20);
    mesh.faces.truncate(mesh.faces.len() - 6);
    let open = ClosestPoints::new(&mesh).unwrap();
    let middle = Bvh::new(&mesh).center;
    for exponent in -30..-3 {
        for digit in [1.0, 2.3, 6.9] {
            let p = Point3::from(middle + Vector3::x() * (digit * 10f64.powi(exponent)));
            assert!(open.signed_distance(&p).0 < -0.4, "{digit}e{exponent}");
        }
    }
    assert!(open.signed_distance(&middle.into()).0 < -0.4);
}

#[test]
fn far_groups_hardly_change_the_winding_number() {
    let mut half = ball(40);
    half.faces.truncate(half.faces.len() / 2);
    // A cup with two walls, open at its rim.
    let mut cup = half.clone();
    let offset = cup.vertices.len() as u32;
    cup.vertices.extend(half.vertices.iter().map(|v| v * 0.95));
    cup.faces.extend(half.faces.iter().map(|[a, b, c]| [*a, *c, *b].map(|v| v + offset)));
    check_accuracies(&half, [(FINE, 0.02), (COARSE, 0.1)]);
    check_accuracies(&cup, [(FINE, 0.06), (COARSE, 0.18)]);
}

fn check_accuracies(mesh: &TriMesh, accuracies: [(Accuracy, f64); 2]) {
    let tree = Bvh::new(mesh);
    let winding = Winding::new(mesh, &tree);
    let mut random = SplitMix64::new(17);
    for _ in 0..500 {
        let p = point(&mut random) * 3.0;
        let exact: f64 = (0..mesh.faces.len())
            .map(|f| {
                let [a, b, c] = mesh.triangle(f).map(|v| v - p);
                let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
                let y = a.dot(&b.cross(&c));
                let x = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
                y.atan2(x) / std::f64::consts::TAU
            })
            .sum();
        for (accuracy, most) in accuracies {
            let fast = winding.at(&tree, &p.coords, accuracy);
            assert!((fast - exact).abs() < most, "{fast} {exact}");
        }
    }
}

/// Inside or outside of a tetrahedron by its four planes.
fn outside_tetrahedron(corners: &[Point3<f64>; 4], p: &Point3<f64>) -> bool {
    [[0, 1, 2, 3], [0, 1, 3, 2], [0, 2, 3, 1], [1, 2, 3, 0]].iter().any(|&[a, b, c, opposite]| {
        let normal = (corners[b] - corners[a]).cross(&(corners[c] - corners[a]));
        let own = normal.dot(&(corners[opposite] - corners[a]));
        normal.dot(&(p - corners[a])) * own < 0.0
    })
}

#[test]
fn the_sign_holds_on_thin_tetrahedra() {
    let mut random = SplitMix64::new(19);
    for thickness in [1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5] {
        for _ in 0..50 {
            let flat = |p: Point3<f64>| Point3::new(p.x, p.y, p.z * thickness);
            let turn = nalgebra::Rotation3::from_euler_angles(
                random.uniform() - 0.5,
                random.uniform() - 0.5,
                random.uniform() - 0.5,
            );
            let corners = [(); 4].map(|()| turn * flat(point(&mut random)));
            let volume = (corners[1] - corners[0])
                .cross(&(corners[2] - corners[0]))
                .dot(&(corners[3] - corners[0]));
            let mut faces = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];
            if volume < 0.0 {
                faces.iter_mut().for_each(|f| f.swap(0, 1));
            }
            let tree = ClosestPoints::new(&TriMesh::new(corners.to_vec(), faces)).unwrap();
            assert!(tree.is_closed());
            for k in 0..400 {
                let spread = if k % 2 == 0 { 1.0 } else { 1.5 };
                let p = turn * flat(point(&mut random) * spread);
                let (signed, _) = tree.signed_distance(&p);
                // Within rounding of the surface the reference itself cannot tell.
                if signed.abs() > 1e-12 {
                    assert_eq!(
                        signed > 0.0,
                        outside_tetrahedron(&corners, &p),
                        "{thickness} {signed}"
                    );
                }
            }
        }
    }
}

#[test]
fn the_sign_of_a_plain_tetrahedron_is_never_wrong() {
    // NVIDIA/warp issue 1836: rays through edges and corners, and points straight beyond them.
    let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(Point3::from);
    let faces = vec![[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]];
    let tree = ClosestPoints::new(&TriMesh::new(corners.to_vec(), faces)).unwrap();
    let mut random = SplitMix64::new(0);
    for k in 0..200_000 {
        let mut p = point(&mut random) * 5.0 + Vector3::repeat(0.5);
        if k % 2 == 0 {
            // On a lattice, where many closest points are corners and many distances equal.
            p = p.map(|x| (x * 8.0).round() / 8.0);
        }
        let inside = p.iter().all(|&x| x > 0.0) && p.coords.sum() < 1.0;
        let (signed, _) = tree.signed_distance(&p);
        if signed.abs() > 1e-15 {
            assert_eq!(signed < 0.0, inside, "{p} {signed}");
        }
    }
}

#[test]
fn far_points_and_far_meshes_are_answered() {
    let near = ball(8);
    for scale in [1e-12, 1.0, 1e8] {
        let mesh = near.clone().scaled(scale);
        let tree = ClosestPoints::new(&mesh).unwrap();
        let mut random = SplitMix64::new(43);
        for factor in [1.0, 1e3, 1e7, 1e12, 1e20] {
            let p = point(&mut random) * (scale * factor);
            let found = tree.closest(&p, f64::INFINITY).unwrap();
            assert_eq!(found.distance, brute_force(&mesh, &p), "{scale} {factor}");
        }
    }
}

#[test]
fn touching_bodies_fall_back_to_the_winding_number() {
    let tetrahedron = [
        Point3::origin(),
        Point3::new(1.0, 0.0, 0.0),
        Point3::new(0.0, 1.0, 0.0),
        Point3::new(0.0, 0.0, 1.0),
    ];
    let faces = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];
    let mut mesh = TriMesh::new(tetrahedron.to_vec(), faces.clone());
    // A second one that shares the corner at the origin only.
    mesh.append(&TriMesh::new(
        tetrahedron.map(|p| -p).to_vec(),
        faces.iter().map(|f| [f[1], f[0], f[2]]).collect(),
    ));
    let tree = ClosestPoints::new(&mesh).unwrap();
    assert!(!tree.is_closed());
    assert!(tree.signed_distance(&Point3::new(0.1, 0.1, 0.1)).0 < 0.0);
    assert!(tree.signed_distance(&Point3::new(-0.1, -0.1, -0.1)).0 < 0.0);
    assert!(tree.signed_distance(&Point3::new(-0.1, 0.1, 0.1)).0 > 0.0);
}

#[test]
fn bad_input_is_refused_or_answered_with_none() {
    assert_eq!(ClosestPoints::new(&TriMesh::default()).unwrap_err(), ClosestError::Empty);
    let corners = vec![Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.0)];
    let wrong = TriMesh::new(corners.clone(), vec![[0, 1, 3]]);
    assert_eq!(
        ClosestPoints::new(&wrong).unwrap_err(),
        ClosestError::VertexIndex { face: 0, vertex: 3, count: 3 }
    );
    let mut nan = TriMesh::new(corners.clone(), vec![[0, 1, 2]]);
    nan.vertices[1].y = f64::NAN;
    assert_eq!(ClosestPoints::new(&nan).unwrap_err(), ClosestError::Coordinate { vertex: 1 });
    let tree = ClosestPoints::new(&TriMesh::new(corners, vec![[0, 1, 2]])).unwrap();
    assert!(tree.closest(&Point3::new(f64::NAN, 0.0, 0.0), 1.0).is_none());
    assert!(tree.closest(&Point3::origin(), f64::NAN).is_none());
    assert!(tree.closest(&Point3::origin(), -1.0).is_none());
    assert!(tree.signed_distance(&Point3::new(f64::INFINITY, 0.0, 0.0)).0.is_nan());
    // Exactly at the limit counts.
    let at = tree.closest(&Point3::new(0.2, 0.2, 0.5), 0.5).unwrap();
    assert_eq!((at.distance, at.feature), (0.5, Feature::Face));
}

#[test]
fn many_equal_triangles_make_no_trouble() {
    let corners = vec![Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.0)];
    let tree = ClosestPoints::new(&TriMesh::new(corners, vec![[0, 1, 2]; 3000])).unwrap();
    let found = tree.closest(&Point3::new(2.0, 0.0, 0.0), f64::INFINITY).unwrap();
    assert_eq!((found.distance, found.point), (1.0, Point3::new(1.0, 0.0, 0.0)));
}

#[test]
fn equal_faces_make_neither_a_slow_nor_a_deep_tree() {
    // Without care both take minutes, and a query's recursion overflows this thread's stack.
    let triangle = |x: f64| [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0]].map(Point3::from);
    let mesh = move |x: fn(u32) -> f64| {
        let vertices = (0..50_000).flat_map(|i| triangle(x(i))).collect();
        TriMesh::new(vertices, (0..50_000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
    };
    let check = move || {
        let stacked = ClosestPoints::new(&mesh(|_| 0.0)).unwrap();
        let strip = ClosestPoints::new(&mesh(f64::from)).unwrap();
        let point = Point3::new(0.25, 0.25, 2.0);
        for tree in [&stacked, &strip] {
            let closest = tree.closest(&point, 10.0).unwrap();
            assert_eq!((closest.face, closest.distance), (0, 2.0));
        }
    };
    std::thread::Builder::new().stack_size(256 << 10).spawn(check).unwrap().join().unwrap();
}
