//! Alignment of clouds to meshes and to each other.

use nalgebra::{Isometry3, Point3, Vector3, Vector6};
use prehend_autodiff::lie::se3_exp;
use prehend_geometry::cloud::CloudError;
use prehend_geometry::icp::{CloudTarget, IcpError, IcpSettings, MeshTarget, Metric, align};
use prehend_geometry::sample::surface_samples;
use prehend_geometry::shapes::{cuboid, cylinder, sphere, superellipsoid};
use prehend_geometry::{PointCloud, RobustKernel, SplitMix64, TriMesh};
use proptest::prelude::*;

/// A shape that no motion leaves as it is.
fn wedge() -> TriMesh {
    let mut mesh = cuboid(Vector3::new(0.05, 0.07, 0.11));
    for v in &mut mesh.vertices {
        v.x *= 1.0 + 3.0 * v.z;
        v.y += 0.2 * v.z;
    }
    mesh
}

fn points(mesh: &TriMesh, n: usize, seed: u64) -> Vec<Point3<f64>> {
    surface_samples(mesh, n, seed).iter().map(|s| s.point).collect()
}

fn cloud(mesh: &TriMesh, n: usize, seed: u64) -> PointCloud {
    let samples = surface_samples(mesh, n, seed);
    PointCloud {
        points: samples.iter().map(|s| s.point).collect(),
        normals: Some(samples.iter().map(|s| s.normal).collect()),
    }
}

fn pose(twist: [f64; 6]) -> Isometry3<f64> {
    se3_exp(&Vector6::from(twist))
}

/// How far apart two poses put a point of the shape \[m\].
fn error(a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
    let corner = Point3::new(0.05, 0.05, 0.05);
    (a * corner - b * corner).norm().max((a * Point3::origin() - b * Point3::origin()).norm())
}

fn settings(metric: Metric) -> IcpSettings {
    IcpSettings { metric, max_iterations: 200, ..IcpSettings::default() }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn clean_points_come_back_to_the_mesh(
        turn in prop::array::uniform3(-0.1..0.1_f64),
        shift in prop::array::uniform3(-5e-3..5e-3_f64),
    ) {
        let mesh = wedge();
        let target = MeshTarget::new(&mesh).unwrap();
        let truth = pose([0.1, -0.2, 0.4, 0.5, -0.3, 0.2]);
        let seen: Vec<_> = points(&mesh, 1500, 1).iter().map(|p| truth.inverse_transform_point(p)).collect();
        let start = pose([shift[0], shift[1], shift[2], turn[0], turn[1], turn[2]]) * truth;
        let found = align(&seen, &target, &start, &settings(Metric::PointToPlane)).unwrap();
        prop_assert!(found.converged, "{:?}", found);
        prop_assert!(error(&found.t_target_source, &truth) < 1e-7, "{:?}", found);
        prop_assert!(found.rms < 1e-7 && found.inliers == 1500);
        prop_assert!(found.degeneracy.unconstrained(1e-3).is_empty());
    }
}

#[test]
fn point_to_point_agrees_but_takes_longer() {
    let mesh = wedge();
    let target = CloudTarget::new(&cloud(&mesh, 3000, 1)).unwrap();
    // The same points, so that the truth is a minimum of either metric.
    let seen = points(&mesh, 3000, 1);
    let start = pose([2e-3, -1e-3, 1e-3, 0.02, 0.01, -0.03]);
    let [plane, point] = [Metric::PointToPlane, Metric::PointToPoint]
        .map(|metric| align(&seen, &target, &start, &settings(metric)).unwrap());
    for found in [&plane, &point] {
        assert!(
            found.converged && error(&found.t_target_source, &Isometry3::identity()) < 1e-5,
            "{found:?}"
        );
    }
    assert!(plane.iterations < point.iterations, "{} {}", plane.iterations, point.iterations);
}

#[test]
fn robust_kernels_forgive_clutter() {
    let mesh = wedge();
    let target = MeshTarget::new(&mesh).unwrap();
    let mut random = SplitMix64::new(3);
    let mut seen = points(&mesh, 2000, 1);
    // Part of one side stands 8 mm out, as a finger that the mask includes would.
    for p in seen.iter_mut().filter(|p| p.x > 0.0 && p.y > 0.01 && p.z > 0.0) {
        p.x += 8e-3;
    }
    seen.iter_mut().for_each(|p| p.coords += Vector3::from_fn(|_, _| 2e-4 * random.normal()));
    let start = pose([2e-3, -1e-3, 1e-3, 0.02, 0.01, -0.03]);
    let scale = 2e-3;
    let kernels = [
        RobustKernel::Squared,
        RobustKernel::Huber { scale },
        RobustKernel::Cauchy { scale },
        RobustKernel::GemanMcClure { scale },
        RobustKernel::Tukey { scale },
    ];
    let errors = kernels.map(|kernel| {
        let found = align(
            &seen,
            &target,
            &start,
            &IcpSettings { kernel, ..settings(Metric::PointToPlane) },
        );
        error(&found.unwrap().t_target_source, &Isometry3::identity())
    });
    let [squared, huber, others @ ..] = errors;
    assert!(squared > 1e-3 && huber < squared, "{errors:?}");
    assert!(others.iter().all(|e| *e < 0.3 * squared), "{errors:?}");
}

#[test]
fn what_cannot_be_known_is_reported_and_left_alone() {
    // Spin of a cylinder about its axis; every turn of a sphere; its beveled ends hold the superellipsoid.
    let shapes = [
        (cylinder(0.03, 0.08, 256), 1),
        (sphere(0.04, 256), 3),
        (superellipsoid([0.03, 0.04, 0.06], [1.0; 2], 64), 0),
    ];
    let start = pose([1e-3, -1e-3, 2e-3, 0.02, 0.03, 0.1]);
    for (mesh, free) in shapes {
        let target = MeshTarget::new(&mesh).unwrap();
        let least_eigenvalue = 1e-3;
        let settings = IcpSettings { least_eigenvalue, ..settings(Metric::PointToPlane) };
        let found = align(&points(&mesh, 4000, 1), &target, &start, &settings).unwrap();
        let report = found.degeneracy.unconstrained(least_eigenvalue);
        assert_eq!(report.len(), free, "{:?}", found.degeneracy);
        assert!(found.converged && found.rms < 2e-5, "{found:?}");
        for v in report {
            assert!(v.fixed_rows::<3>(0).norm() < 0.05, "{v}");
            if free == 1 {
                assert!((v[5] * found.degeneracy.length).abs() > 0.99, "{v}");
            }
        }
        // The spin that nothing tells apart stays where it was.
        let spin = found.t_target_source.rotation.scaled_axis().z;
        assert_eq!((spin - 0.1).abs() < 0.01, free > 0, "{spin}");
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let mesh = wedge();
    let target = CloudTarget::new(&cloud(&mesh, 20_000, 1)).unwrap();
    let seen = points(&mesh, 20_000, 2);
    let start = pose([2e-3, -1e-3, 1e-3, 0.02, 0.01, -0.03]);
    let settings = IcpSettings { max_iterations: 5, ..IcpSettings::default() };
    let [one, three] = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| align(&seen, &target, &start, &settings).unwrap())
    });
    assert_eq!(one, three);
}

#[test]
fn no_steps_report_the_initial_pose() {
    let mesh = wedge();
    let target = MeshTarget::new(&mesh).unwrap();
    let start = pose([1e-3, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let none = IcpSettings { max_iterations: 0, ..IcpSettings::default() };
    let found = align(&points(&mesh, 100, 1), &target, &start, &none).unwrap();
    assert_eq!((found.t_target_source, found.iterations, found.converged), (start, 0, false));
    assert!(found.rms > 1e-4 && found.inliers == 100);
}

#[test]
fn bad_input_is_named() {
    let mesh = wedge();
    let target = MeshTarget::new(&mesh).unwrap();
    let seen = points(&mesh, 10, 1);
    let start = Isometry3::identity();
    let good = IcpSettings::default();
    let error = |seen: &[Point3<f64>], start, settings| {
        align(seen, &target, &start, &settings).unwrap_err()
    };
    assert!(matches!(error(&[], start, good), IcpError::NoMatches { points: 0, iteration: 0, .. }));
    let far = Isometry3::translation(1.0, 0.0, 0.0);
    assert!(matches!(error(&seen, far, good), IcpError::NoMatches { points: 10, .. }));
    let lost = Isometry3::translation(f64::NAN, 0.0, 0.0);
    assert!(matches!(error(&seen, lost, good), IcpError::Setting { name: "t_target_source", .. }));
    let bad = IcpSettings { max_distance: f64::NAN, ..good };
    assert!(matches!(error(&seen, start, bad), IcpError::Setting { name: "max_distance", .. }));
    let bad = IcpSettings { kernel: RobustKernel::Tukey { scale: 0.0 }, ..good };
    assert_eq!(error(&seen, start, bad), IcpError::Setting { name: "kernel", value: 0.0 });
    let nowhere = [Point3::new(0.0, 0.0, f64::NAN)];
    assert_eq!(error(&nowhere, start, good), CloudError::Coordinate { index: 0 }.into());
    let bare = CloudTarget::new(&PointCloud::new(seen.clone())).unwrap();
    assert_eq!(align(&seen, &bare, &start, &good), Err(IcpError::NoNormals));
    assert!(matches!(MeshTarget::new(&TriMesh::default()), Err(IcpError::Mesh(_))));
}
