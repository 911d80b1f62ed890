use super::*;
use crate::closest::ClosestPoints;
use crate::sdf::SdfError;
use crate::shapes::cuboid;

fn sphere(radius: f64, spacing: f64, margin: f64) -> SdfGrid {
    let corner = Point3::new(radius, radius, radius);
    let distance = |p: &Point3<f64>, _: f64| p.coords.norm() - radius;
    SdfGrid::from_fn((-corner, corner), spacing, margin, || distance).unwrap()
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
    let (origin, _) = grid.extent();
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
    let (origin, end) = grid.extent();
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

/// Samples up to `margin` around the mesh, cut off at `band`.
fn banded(mesh: &ClosestPoints, spacing: f64, margin: f64, band: f64) -> Result<SdfGrid, SdfError> {
    SdfGrid::build_band_on(mesh, Lattice::around(mesh.bounds(), spacing, margin)?, band)
}

#[test]
fn samples_at_the_very_edge_of_the_band_have_the_right_sign() {
    // Samples on the faces of the cube, whose neighbors inside are a band away but for rounding.
    for (size, spacing) in [(0.4, 0.1), (0.6, 0.1), (0.3, 0.05), (3.3, 0.3)] {
        let mesh = ClosestPoints::new(&cuboid(Vector3::repeat(size))).unwrap();
        let grid = banded(&mesh, spacing, 2.0 * spacing, spacing).unwrap();
        let [nx, ny, nz] = grid.dims();
        for n in 0..nx * ny * nz {
            let p = grid.lattice().position([n / (ny * nz), n / nz % ny, n % nz]);
            let expected = mesh.signed_distance(&p).0.clamp(-spacing, spacing);
            assert!((grid.evaluate(&p).distance - expected).abs() < 1e-12, "{p}");
        }
    }
}

#[test]
fn a_band_has_the_exact_samples_and_the_right_sign_elsewhere() {
    for closed in [true, false] {
        let mesh = ball(closed);
        let (spacing, band) = (0.003, 0.007);
        let grid = banded(&mesh, spacing, 0.011, band).unwrap();
        let full = SdfGrid::build(&mesh, spacing, 0.011).unwrap();
        assert_eq!((grid.band(), full.band()), (band, f64::INFINITY));
        let [nx, ny, nz] = grid.dims();
        let mut cut = 0;
        for n in 0..nx * ny * nz {
            let p = grid.lattice().position([n / (ny * nz), n / nz % ny, n % nz]);
            let exact = mesh.signed_distance(&p).0;
            assert!((full.evaluate(&p).distance - exact).abs() < 1e-15);
            let expected = exact.clamp(-band, band);
            assert!((grid.evaluate(&p).distance - expected).abs() < 1e-15, "{p} {expected}");
            cut += usize::from(exact.abs() > band);
        }
        assert!(cut > 1000);
    }
}

#[test]
fn grids_are_the_same_for_any_number_of_threads() {
    let mesh = ball(true);
    let build = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let band = banded(&mesh, 0.002, 0.01, 0.006).unwrap();
            [SdfGrid::build(&mesh, 0.002, 0.01).unwrap(), band].map(|g| g.coefficients)
        })
    };
    assert_eq!(build(1), build(3));
}

#[test]
fn derivatives_match_differences_at_random_points_of_a_band() {
    let grid = banded(&ball(true), 0.01, 0.03, 0.025).unwrap();
    let mut random = crate::random::SplitMix64::new(37);
    for _ in 0..300 {
        // A difference must not leave the cell.
        let index = grid.dims().map(|n| (random.uniform() * (n - 1) as f64).floor());
        let within = [(); 3].map(|()| 0.1 + 0.8 * random.uniform());
        let offset = (Vector3::from(index) + Vector3::from(within)) * grid.spacing();
        let p = grid.extent().0 + offset;
        let (s, step) = (grid.evaluate(&p), 1e-6);
        for i in 0..3 {
            let e = Vector3::ith(i, step);
            let (plus, minus) = (grid.evaluate(&(p + e)), grid.evaluate(&(p - e)));
            let slope = (plus.distance - minus.distance) / (2.0 * step);
            assert!((slope - s.gradient[i]).abs() < 1e-6);
            let bend = (plus.gradient - minus.gradient) / (2.0 * step);
            assert!((bend - s.hessian.column(i)).norm() < 1e-6 * (1.0 + s.hessian.norm()));
        }
    }
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
    assert!(matches!(banded(&mesh, 0.1, 0.1, 0.05), Err(SdfError::Length { name: "band", .. })));
    let lattice = |x, dims| Lattice::new(Point3::new(x, 0.0, 0.0), 0.1, dims).unwrap_err();
    assert_eq!(lattice(f64::NAN, [2; 3]), SdfError::Origin);
    assert_eq!(lattice(0.0, [2, 1, 2]), SdfError::Dims { axis: 1, count: 1 });
    assert!(matches!(lattice(0.0, [1 << 20; 3]), SdfError::TooLarge { .. }));
    assert_eq!(
        SdfGrid::from_fn(wrong, 0.1, 0.1, || |_: &Point3<f64>, _| 0.0).unwrap_err(),
        SdfError::Bounds
    );
}
