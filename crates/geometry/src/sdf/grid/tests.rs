use super::*;
use crate::closest::ClosestPoints;
use crate::sdf::SdfError;
use crate::shapes::cuboid;

/// Exact values of `distance` on the lattice around `bounds`.
fn sampled(
    bounds: (Point3<f64>, Point3<f64>),
    [spacing, margin]: [f64; 2],
    distance: impl Fn(&Point3<f64>) -> f64,
) -> SdfGrid {
    let lattice = Lattice::around(bounds, spacing, margin).unwrap();
    let [_, ny, nz] = lattice.dims();
    let count = lattice.dims().iter().product();
    let place = |n: usize| lattice.position([n / (ny * nz), n / nz % ny, n % nz]);
    let values: Vec<f64> = (0..count).map(|n| distance(&place(n))).collect();
    SdfGrid::from_samples(lattice, &values, bounds)
}

/// Smallest and largest corner of a grid.
fn extent(grid: &SdfGrid) -> (Point3<f64>, Point3<f64>) {
    (grid.lattice.position([0; 3]), grid.lattice.position(grid.dims().map(|n| n - 1)))
}

fn sphere(radius: f64, spacing: f64, margin: f64) -> SdfGrid {
    let corner = Point3::new(radius, radius, radius);
    let distance = |p: &Point3<f64>| p.coords.norm() - radius;
    sampled((-corner, corner), [spacing, margin], distance)
}

#[test]
fn a_sphere_is_reproduced_with_both_derivatives() {
    let (radius, spacing) = (0.03, 0.002);
    let grid = sphere(radius, spacing, 0.012);
    let mut directions = 0;
    for i in 0..200 {
        let a = i as f64;
        let n = Vector3::new(a.sin(), (1.7 * a).cos(), (2.3 * a).sin()).normalize();
        for height in [-0.008, 0.0, 0.005] {
            let r = radius + height;
            let s = grid.sample(&(n * r).into(), 0.012).unwrap();
            assert!((s.distance - height).abs() < 2e-7, "{}", s.distance - height);
            assert!((s.gradient - n).norm() < 2e-4);
            let hessian = (Matrix3::identity() - n * n.transpose()) / r;
            assert!((s.hessian - hessian).norm() < 0.03 * hessian.norm(), "{height}");
        }
        directions += 1;
    }
    assert_eq!(directions, 200);
}

#[test]
fn a_box_is_exact_away_from_its_edges() {
    let mesh = ClosestPoints::new(&cuboid(Vector3::repeat(0.04))).unwrap();
    let grid = SdfGrid::build(&mesh, 0.001, 0.01).unwrap();
    for (x, expected) in [(0.0256, 0.0056), (0.0203, 0.0003), (0.0191, -0.0009)] {
        let s = grid.sample(&Point3::new(x, 0.0031, -0.0042), 0.01).unwrap();
        assert!((s.distance - expected).abs() < 1e-9, "{}", s.distance);
        assert!((s.gradient - Vector3::x()).norm() < 1e-6);
        assert!(s.hessian.norm() < 1e-3);
    }
    assert!(grid.evaluate(&Point3::origin()).distance < -0.018);
    for i in 0..500 {
        let at = |k: usize| ((i * k) % 97) as f64 / 97.0 * 0.07 - 0.035;
        let p = Point3::new(at(7), at(13), at(29));
        let alone = grid.distance(&p, 0.005);
        assert_eq!(alone, grid.sample(&p, 0.005).map(|s| s.distance));
    }
    // Every sample is the exact distance, near the edges too.
    let (origin, _) = extent(&grid);
    for i in 0..300 {
        let d = grid.dims();
        let index = [i * 7 % d[0], i * 13 % d[1], i * 29 % d[2]].map(|k| k as f64);
        let p = origin + Vector3::from(index) * grid.spacing();
        assert!((grid.evaluate(&p).distance - mesh.signed_distance(&p).0).abs() < 1e-13);
    }
}

/// Compares the derivatives at `p` with central differences. The gradient is quadratic within a cell, so
/// its difference is exact there. Across a cell face the third derivative jumps, at a kink of the
/// distance by a few times 1 / spacing², which leaves an error of that times the step (4e-4 here); a
/// jump of the second derivative itself would leave one of order 1 / spacing (10).
fn check_derivatives(grid: &SdfGrid, p: &Point3<f64>, on_face: bool) {
    let step = 1e-6;
    let tolerance = if on_face { 4.0 * step / grid.spacing().powi(2) } else { 1e-6 };
    let s = grid.evaluate(p);
    for i in 0..3 {
        let mut e = Vector3::zeros();
        e[i] = step;
        let (plus, minus) = (grid.evaluate(&(p + e)), grid.evaluate(&(p - e)));
        let slope = (plus.distance - minus.distance) / (2.0 * step);
        assert!((slope - s.gradient[i]).abs() < 1e-6, "{p}: {slope} {}", s.gradient[i]);
        let bend = (plus.gradient - minus.gradient) / (2.0 * step);
        assert!((bend - s.hessian.column(i)).norm() < tolerance, "{p}: {bend} {}", s.hessian);
    }
    assert_eq!(s.hessian, s.hessian.transpose());
}

#[test]
fn derivatives_match_differences_inside_cells_and_across_their_faces() {
    let mesh = ClosestPoints::new(&cuboid(Vector3::repeat(1.0))).unwrap();
    let grid = SdfGrid::build(&mesh, 0.1, 0.3).unwrap();
    let (origin, end) = extent(&grid);
    for i in 0..100 {
        let a = i as f64;
        let cell = Vector3::new(a % 13.0 + 1.0, (a * 3.0) % 11.0 + 1.0, (a * 5.0) % 12.0 + 1.0);
        let at = |x, y, z| origin + (cell + Vector3::new(x, y, z)) * grid.spacing();
        check_derivatives(&grid, &at(0.0, 0.0, 0.0), true);
        check_derivatives(&grid, &at(0.0, 0.3, 0.6), true);
        check_derivatives(&grid, &at(0.2, 0.5, 0.9), false);
    }
    // On the border of the grid and beyond it, where straight lines continue the spline.
    let mid = nalgebra::center(&origin, &end);
    check_derivatives(&grid, &Point3::new(end.x, mid.y + 0.07, mid.z + 0.03), true);
    check_derivatives(&grid, &Point3::new(end.x + 0.05, mid.y + 0.07, end.z), true);
    check_derivatives(&grid, &Point3::new(origin.x - 0.05, mid.y + 0.07, mid.z + 0.02), false);
}

#[test]
fn the_reach_decides_what_is_answered() {
    let grid = sphere(0.03, 0.002, 0.012);
    let at = |x: f64, reach: f64| grid.sample(&Point3::new(x, 0.0, 0.0), reach);
    assert!(at(0.035, 0.004).is_none());
    assert!(at(0.035, 0.006).is_some());
    assert!(at(0.0, 0.0).is_some_and(|s| s.distance < -0.025));
    assert!(at(0.06, 0.012).is_none());
    assert!(at(f64::NAN, 0.012).is_none());
    assert!(at(f64::INFINITY, 0.012).is_none());
    // Beyond the margin the straight continuation of a straight distance is right.
    assert!(at(0.06, 0.1).is_some_and(|s| (s.distance - 0.03).abs() < 1e-6));
}

/// A ball with a hole where faces are missing, unless `closed`.
fn ball(closed: bool) -> ClosestPoints {
    let mut mesh = crate::volume::tests::icosphere(0.03, 3);
    if !closed {
        mesh.faces.truncate(mesh.faces.len() - 20);
    }
    ClosestPoints::new(&mesh).unwrap()
}

/// Each sample is the exact distance, also where the surface is open, has two walls or is one of several, and where blocks of samples meet.
#[test]
fn insides_of_open_meshes_spread_from_sample_to_sample() {
    let open = ball(false);
    let mut cup = crate::volume::tests::icosphere(0.03, 3);
    cup.faces.truncate(cup.faces.len() * 2 / 3);
    let offset = cup.vertices.len() as u32;
    cup.vertices.extend(cup.vertices.clone().iter().map(|v| v * 0.9));
    cup.faces.extend(cup.faces.clone().iter().map(|[a, b, c]| [*a, *c, *b].map(|v| v + offset)));
    let cup = ClosestPoints::new(&cup).unwrap();
    let beside = ClosestPoints::new(&cuboid(Vector3::new(0.05, 0.07, 0.02))).unwrap();
    for meshes in [vec![open.clone()], vec![cup.clone()], vec![beside, cup, open]] {
        let bounds = (Point3::new(-0.03, -0.035, -0.03), Point3::new(0.03, 0.035, 0.03));
        let lattice = Lattice::around(bounds, 0.0017, 0.008).unwrap();
        let grid = SdfGrid::of_union(&meshes, bounds, lattice);
        let distance = |p: &Point3<f64>| {
            meshes.iter().fold(f64::INFINITY, |best, mesh| best.min(mesh.signed_distance(p).0))
        };
        let exact = sampled(bounds, [0.0017, 0.008], distance);
        assert!(grid.coefficients == exact.coefficients);
    }
}

/// Where neighboring samples are farther apart by rounding than the spacing, too.
#[test]
fn grids_far_from_the_origin_are_complete() {
    for closed in [true, false] {
        for away in [1e4, 1e5, 1e6] {
            let mut mesh = crate::volume::tests::icosphere(0.03, 3);
            mesh.vertices.iter_mut().for_each(|v| v.z += away);
            let missing = if closed { 0 } else { 20 };
            mesh.faces.truncate(mesh.faces.len() - missing);
            let grid = SdfGrid::build(&ClosestPoints::new(&mesh).unwrap(), 0.002, 0.01).unwrap();
            let middle = grid.sample(&Point3::new(0.0, 0.0, away), 0.0).unwrap().distance;
            assert!((middle + 0.03).abs() < 1e-3, "{middle} at {away}");
        }
    }
}

#[test]
fn grids_are_the_same_for_any_number_of_threads() {
    let mesh = ball(true);
    let build = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| SdfGrid::build(&mesh, 0.002, 0.01).unwrap().coefficients)
    };
    assert_eq!(build(1), build(3));
}

/// Inside of the box's faces the spline is below zero, and a hair outside of them, too: by edges it is no exact distance.
#[test]
fn the_box_is_no_jump() {
    let mesh = ClosestPoints::new(&cuboid(Vector3::repeat(0.1))).unwrap();
    let grid = SdfGrid::build(&mesh, 0.005, 0.02).unwrap();
    let mut below = 0;
    for k in 0..200 {
        let z = 0.035 + 1e-4 * f64::from(k);
        let at = |x: f64| grid.distance(&Point3::new(x, 0.03, z), 0.0);
        let [inside, outside] = [0.05 - 1e-12, 0.05 + 1e-12].map(at);
        let is_near = |(a, b): (f64, f64)| (a - b).abs() < 1e-9;
        assert!(inside.zip(outside).is_none_or(is_near) && inside.is_some() == outside.is_some());
        below += usize::from(outside.is_some());
    }
    assert!(below > 10);
}

#[test]
fn senseless_grids_are_refused() {
    let mesh = ClosestPoints::new(&cuboid(Vector3::repeat(2.0))).unwrap();
    assert!(matches!(
        SdfGrid::build(&mesh, 0.0, 0.1),
        Err(SdfError::Length { name: "spacing", .. })
    ));
    assert!(matches!(
        SdfGrid::build(&mesh, f64::NAN, 0.1),
        Err(SdfError::Length { name: "spacing", .. })
    ));
    assert!(matches!(
        SdfGrid::build(&mesh, 0.1, -1.0),
        Err(SdfError::Length { name: "margin", .. })
    ));
    assert!(matches!(SdfGrid::build(&mesh, 1e-4, 0.1), Err(SdfError::TooLarge { .. })));
    let wrong = (Point3::origin(), Point3::new(-1.0, 0.0, 0.0));
    let lattice = |x, dims| Lattice::new(Point3::new(x, 0.0, 0.0), 0.1, dims).unwrap_err();
    assert_eq!(lattice(f64::NAN, [2; 3]), SdfError::Origin);
    assert_eq!(lattice(0.0, [2, 1, 2]), SdfError::Dims { axis: 1, count: 1 });
    assert!(matches!(lattice(0.0, [1 << 20; 3]), SdfError::TooLarge { .. }));
    assert_eq!(Lattice::around(wrong, 0.1, 0.1).unwrap_err(), SdfError::Bounds);
}
