//! Finite numbers in, finite numbers out: robust losses, built-in shapes and moments of solids, of no size and of any.

use nalgebra::{Point3, Vector3};
use prehend_autodiff::{Fwd, Scalar};
use prehend_geometry::shapes::{
    RoundedBox, Section, capsule, cone, cuboid, cylinder, loft, revolve, rounded_box, sphere,
    subdivided, superellipsoid, tube,
};
use prehend_geometry::{Moments, RobustKernel};

fn finite<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> bool {
    numbers.into_iter().all(|x| x.is_finite())
}

fn kernels(scale: f64) -> [RobustKernel; 5] {
    [
        RobustKernel::Squared,
        RobustKernel::Huber { scale },
        RobustKernel::Cauchy { scale },
        RobustKernel::GemanMcClure { scale },
        RobustKernel::Tukey { scale },
    ]
}

#[test]
fn kernels_of_any_scale_and_residual() {
    let sizes = [0.0, 1e-310, 1e-200, 1e-9, 1.0, 1e9, 1e100, 1e200, 1e308];
    for (scale, r2) in sizes[1..].iter().flat_map(|scale| sizes.map(|r2| (*scale, r2))) {
        for kernel in kernels(scale) {
            let (loss, weight) = (kernel.loss(r2), kernel.weight(r2));
            assert!(
                loss.is_finite() && (0.0..=1.0).contains(&weight),
                "{kernel:?} {r2}: {loss} {weight}"
            );
        }
    }
}

#[test]
fn shapes_of_no_size() {
    for s in [0.0, 1e-300, 1e-9, 1.0, 1e9] {
        let box_of = |size| RoundedBox {
            size,
            radius: s,
            bulge: Vector3::repeat(s),
            arc_steps: 2,
            cell: f64::INFINITY,
        };
        let ends = [Point3::origin(), Point3::new(s, 0.0, 0.0), Point3::origin(), Point3::origin()];
        for mesh in [
            sphere(s, 8),
            cylinder(s, 1.0, 8),
            cylinder(1.0, s, 8),
            cone([s, 0.0], 1.0, 8),
            capsule(s, s, 8, 2),
            superellipsoid([s, 1.0, s], [1.0, s], 8),
            tube(&ends, s, 8, 2),
            cuboid(Vector3::new(s, 1.0, s)),
            rounded_box(&box_of(Vector3::new(1.0, s, s))),
        ] {
            assert!(mesh.vertices.iter().all(|v| finite(&v.coords)), "{s}");
            assert!(mesh.uvs.iter().flatten().flatten().all(|x| x.is_finite()), "{s}");
        }
    }
}

#[test]
fn lofts_of_no_size() {
    for s in [0.0, 1e-300, 1e-9, 1.0, 1e9] {
        let square = [[0.0, 0.0], [s, 0.0], [s, s], [0.0, s]];
        let sections = [
            Section::circle(0.0, s),
            Section { z: s, half: [s, 1.0], exponent: 1.0 },
            Section { z: 1.0, half: [1.0, 0.0], exponent: 1e3 },
        ];
        let meshes =
            [revolve(&square, 8), loft(&sections, 8), loft(&subdivided(&sections, 0.1), 8)];
        for mesh in meshes {
            assert!(mesh.vertices.iter().all(|v| finite(&v.coords)), "{s}");
            assert!(mesh.uvs.iter().flatten().flatten().all(|x| x.is_finite()), "{s}");
        }
    }
}

#[test]
fn moments_of_what_has_no_volume() {
    let cube = cuboid(Vector3::repeat(1.0)).welded();
    let of = |moments: Moments<Fwd<3>>| {
        let (mass, center, inertia) = moments.of_density(Fwd::constant(1e3));
        let numbers =
            moments.first.iter().chain(&moments.second).chain(&center.coords).chain(&inertia);
        for x in numbers.chain([&moments.volume, &mass]) {
            assert!(x.value.is_finite() && finite(&x.derivative), "{moments:?}");
        }
    };
    for size in [
        [0.0; 3],
        [0.0, 1.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 1.0],
        [1e9; 3],
        [1e-9; 3],
    ] {
        let [half, radius, border] = Fwd::<3>::variables(size);
        [Moments::ball(radius), Moments::cylinder(half, radius), Moments::capsule(half, radius)]
            .into_iter()
            .for_each(of);
        [
            Moments::cone(half, radius),
            Moments::round_cylinder(half, radius, border),
            Moments::round_cone(half, radius, border),
        ]
        .into_iter()
        .for_each(of);
        let faces: Vec<_> = cube.faces.iter().map(|f| f.map(|v| v as usize)).collect();
        let pressed = |p: &Point3<f64>| Point3::from(p.coords.component_mul(&Vector3::from(size)));
        let corners: Vec<_> = cube.vertices.iter().map(|p| pressed(p).map(Fwd::constant)).collect();
        of(Moments::round_convex(&corners, &faces, border));
    }
}
