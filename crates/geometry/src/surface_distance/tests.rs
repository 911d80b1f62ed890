use super::*;
use crate::closest::Feature;
use crate::robust::tests::kernels;
use crate::shapes::{cuboid, superellipsoid};
use crate::{SplitMix64, sample::surface_samples};
use nalgebra::Vector6;
use prehend_autodiff::check::{finite_difference_gradient, finite_difference_jacobian};
use prehend_autodiff::lie::{perturb_about, se3_exp};
use proptest::prelude::*;

fn vectors(n: usize, seed: u64) -> Vec<Vector3<f64>> {
    let mut random = SplitMix64::new(seed);
    (0..n).map(|_| Vector3::from_fn(|_, _| 2.0 * random.uniform() - 1.0)).collect()
}

/// A few faces, open or closed.
fn mesh(seed: u64) -> TriMesh {
    if seed.is_multiple_of(2) {
        return superellipsoid([0.5, 0.7, 0.9], [0.8, 1.3], 6).welded();
    }
    let vertices = vectors(9, seed).into_iter().map(Point3::from).collect();
    TriMesh::new(vertices, vec![[0, 1, 2], [2, 1, 3], [4, 5, 6], [6, 7, 8]])
}

fn pose(seed: u64) -> Isometry3<f64> {
    let v = vectors(2, seed);
    se3_exp(&Vector6::new(v[0].x, v[0].y, v[0].z, v[1].x, v[1].y, v[1].z))
}

impl SurfaceDistance {
    /// What is matched with what: differences over a change of it are differences over a kink. Faces that share
    /// the nearest corner or edge are as good as each other, so it counts by its vertices.
    fn matching(&self, t: &Isometry3<f64>) -> Vec<(Vec<u32>, Point3<f64>, bool)> {
        let add = |all: &mut Vec<_>, p: &Pair, _: f64| {
            let corner = |i: u8| self.faces[p.face as usize][usize::from(i % 3)];
            let mut vertices = match p.feature {
                Feature::Vertex(i) => vec![corner(i)],
                Feature::Edge(i) => vec![corner(i), corner(i + 1)],
                Feature::Face => self.faces[p.face as usize].to_vec(),
            };
            vertices.sort_unstable();
            // Huber's loss bends at its scale.
            let beyond = self.kernel.scale().is_some_and(|s| p.offset().norm() > s);
            all.push((vertices, p.point, beyond));
        };
        self.sums(t, add).into_iter().flatten().collect()
    }
}

proptest! {
    #[test]
    fn pose_derivatives_match_differences(seed in any::<u64>(), points in 1_usize..12) {
        let mesh = mesh(seed);
        let cloud: Vec<_> = vectors(points, seed ^ 1).into_iter().map(|v| Point3::from(v * 2.0)).collect();
        let (base, center) = (pose(seed ^ 2), Point3::from(vectors(1, seed ^ 3)[0]));
        let step = 1e-5;
        for kernel in kernels(1.7) {
            let distance = SurfaceDistance::new(&mesh, &cloud).unwrap().with_kernel(kernel).unwrap();
            let moved = |x: &[f64]| perturb_about(&base, &center.coords, &Vector6::from_column_slice(x));
            let matching = distance.matching(&base);
            let smooth = (0..12).all(|i| {
                let mut x = [0.0; 6];
                x[i / 2] = if i % 2 == 0 { step } else { -step };
                distance.matching(&moved(&x)) == matching
            });
            prop_assume!(smooth);
            let at = distance.pose_derivatives(&base, &center);
            prop_assert!((at.value - distance.value(&base)).abs() <= 1e-12 * at.value);
            let reference = finite_difference_gradient(|x| distance.value(&moved(x)), &[0.0; 6], step);
            for (g, r) in at.gradient.iter().zip(&reference) {
                prop_assert!((g - r).abs() < 1e-7, "{:?}: {} {}", kernel, g, r);
            }
            // The gradient elsewhere is by a twist there; differences of differences say what it is here.
            let second = |x: &[f64]| {
                let delta = Vector6::from_column_slice(x);
                let twist = prehend_autodiff::lie::se3_left_jacobian(&delta);
                let there = distance.pose_derivatives(&moved(x), &center).gradient;
                (twist.transpose() * there).iter().copied().collect::<Vec<_>>()
            };
            let rows = finite_difference_jacobian(second, &[0.0; 6], step);
            for (i, row) in rows.iter().enumerate() {
                for (j, r) in row.iter().enumerate() {
                    let h = at.hessian[(i, j)];
                    prop_assert!((h - r).abs() < 1e-6, "{:?} {} {}: {} {}", kernel, i, j, h, r);
                }
            }
            let least = at.gauss_newton.symmetric_eigenvalues().min();
            prop_assert!(least > -1e-9, "{}", least);
        }
    }

    #[test]
    fn vertex_gradients_match_differences(seed in any::<u64>(), points in 1_usize..12) {
        let mesh = mesh(2 * (seed / 2) + 1);
        let cloud: Vec<_> = vectors(points, seed ^ 1).into_iter().map(|v| Point3::from(v * 2.0)).collect();
        let base = pose(seed ^ 2);
        for kernel in kernels(1.7) {
            let with = |x: &[f64]| {
                let vertices = x.chunks_exact(3).map(Point3::from_slice).collect();
                let mesh = TriMesh::new(vertices, mesh.faces.clone());
                SurfaceDistance::new(&mesh, &cloud).unwrap().with_kernel(kernel).unwrap()
            };
            let x: Vec<f64> = mesh.vertices.iter().flat_map(|v| v.coords.iter().copied()).collect();
            let step = 1e-5;
            let matching = with(&x).matching(&base);
            let smooth = (0..2 * x.len()).all(|i| {
                let mut x = x.clone();
                x[i / 2] += if i % 2 == 0 { step } else { -step };
                with(&x).matching(&base) == matching
            });
            prop_assume!(smooth);
            let (value, gradient) = with(&x).vertex_gradient(&base);
            prop_assert!((value - with(&x).value(&base)).abs() <= 1e-12 * value);
            let reference = finite_difference_gradient(|x| with(x).value(&base), &x, step);
            let ours = gradient.iter().flat_map(|g| g.iter());
            for (g, r) in ours.zip(&reference) {
                prop_assert!((g - r).abs() < 1e-7, "{:?}: {} {}", kernel, g, r);
            }
        }
    }

    #[test]
    fn the_value_is_its_definition(seed in any::<u64>(), points in 1_usize..40) {
        let (mesh, base) = (mesh(seed), pose(seed ^ 2));
        let cloud: Vec<_> = vectors(points, seed ^ 1).into_iter().map(Point3::from).collect();
        let moved = mesh.transformed(&base);
        let d2 = |p: &Point3<f64>, t: usize| {
            Triangle::new(moved.triangle(t), 0).closest(&p.coords).distance_squared
        };
        let faces = 0..mesh.faces.len();
        let to_mesh: f64 =
            cloud.iter().map(|p| faces.clone().map(|t| d2(p, t)).fold(f64::INFINITY, f64::min)).sum();
        let to_cloud: f64 =
            faces.clone().map(|t| cloud.iter().map(|p| d2(p, t)).fold(f64::INFINITY, f64::min)).sum();
        let expected = to_mesh / points as f64 + to_cloud / mesh.faces.len() as f64;
        let value = SurfaceDistance::new(&mesh, &cloud).unwrap().value(&base);
        prop_assert!((value - expected).abs() < 1e-12 * expected.max(1.0), "{} {}", value, expected);
    }
}

#[test]
fn newton_steps_bring_a_mesh_back_to_its_samples() {
    let mesh = superellipsoid([0.03, 0.04, 0.06], [0.5, 0.7], 24);
    let cloud: Vec<_> = surface_samples(&mesh, 20_000, 1).iter().map(|s| s.point).collect();
    let distance = SurfaceDistance::new(&mesh, &cloud).unwrap();
    let mut t = se3_exp(&Vector6::new(2e-3, -1e-3, 1e-3, 0.03, -0.02, 0.05));
    let start = distance.value(&t);
    for _ in 0..8 {
        let center = Point3::from(t.translation.vector);
        let at = distance.pose_derivatives(&t, &center);
        let step = at.gauss_newton.lu().solve(&-at.gradient).unwrap();
        t = perturb_about(&t, &center.coords, &step);
    }
    assert!(distance.value(&t) < 1e-3 * start, "{} {start}", distance.value(&t));
    assert!(t.translation.vector.norm() < 5e-5 && t.rotation.angle() < 2e-3, "{t}");
}

#[test]
fn touching_points_have_no_gradient_and_a_finite_hessian() {
    // One on a face, one on an edge, one on a corner.
    let mesh = cuboid(Vector3::repeat(2.0));
    for p in [[1.0, 0.3, 0.2], [1.0, 1.0, 0.2], [1.0, 1.0, 1.0]] {
        let distance = SurfaceDistance::new(&mesh, &[Point3::from(p)]).unwrap();
        let at = distance.pose_derivatives(&Isometry3::identity(), &Point3::origin());
        assert!(at.hessian.iter().chain(at.gradient.iter()).all(|x| x.is_finite()));
        let (_, gradient) = distance.vertex_gradient(&Isometry3::identity());
        assert!(gradient.iter().all(|g| g.iter().all(|x| x.is_finite())));
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let mesh = superellipsoid([0.5, 0.7, 0.9], [0.8, 1.3], 64);
    let cloud: Vec<_> = surface_samples(&mesh, 5000, 1).iter().map(|s| s.point * 1.1).collect();
    let distance = SurfaceDistance::new(&mesh, &cloud).unwrap();
    let [one, three] = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let t = pose(3);
            (distance.pose_derivatives(&t, &Point3::origin()), distance.vertex_gradient(&t))
        })
    });
    assert_eq!(one, three);
}

#[test]
fn bad_input_is_named() {
    let mesh = cuboid(Vector3::repeat(1.0));
    let new = |mesh: &TriMesh, cloud: &[Point3<f64>]| SurfaceDistance::new(mesh, cloud);
    assert_eq!(new(&mesh, &[]).err(), Some(SurfaceDistanceError::NoPoints));
    assert!(matches!(
        new(&TriMesh::default(), &[Point3::origin()]),
        Err(SurfaceDistanceError::Mesh(_))
    ));
    let nowhere = [Point3::new(f64::NAN, 0.0, 0.0)];
    assert!(matches!(new(&mesh, &nowhere), Err(SurfaceDistanceError::Cloud(_))));
    let good = new(&mesh, &[Point3::origin()]).unwrap();
    let error = good.clone().with_kernel(RobustKernel::Huber { scale: -1.0 }).err();
    assert_eq!(error, Some(SurfaceDistanceError::RobustKernel(-1.0)));
    assert!(good.value(&Isometry3::translation(f64::NAN, 0.0, 0.0)).is_nan());
}
