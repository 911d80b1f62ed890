//! Finite numbers in, finite numbers out: degenerate, tiny and huge meshes, queries at and far from them, clouds of too
//! few points, robots at turns by π. `finite_shapes.rs` has what needs no mesh.

use std::f64::consts::PI;
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3};
use prehend_autodiff::Fwd;
use prehend_geometry::closest::ClosestDerivative;
use prehend_geometry::cloud::estimate_normals;
use prehend_geometry::mass::mass_properties;
use prehend_geometry::robot::{ArticulatedRobot, RobotShape};
use prehend_geometry::sample::surface_samples;
use prehend_geometry::sdf::{HeightSpline, Lattice, SdfError};
use prehend_geometry::shapes::cuboid;
use prehend_geometry::{
    ClosestPoints, DistanceField, FieldSample, KdTree, KinematicTree, MassError, SdfGrid,
    SolidUnion, TriMesh, contact_area,
};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

fn finite<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> bool {
    numbers.into_iter().all(|x| x.is_finite())
}

fn is_finite_sample(sample: &FieldSample) -> bool {
    sample.distance.is_finite() && finite(&sample.gradient) && finite(&sample.hessian)
}

fn is_finite_derivative(d: &ClosestDerivative) -> bool {
    finite(d.weight_gradients.iter().flatten().chain(&d.by_query))
}

/// Coordinates of which many are equal, on a line or in a plane, or all but so.
fn coordinates() -> impl Strategy<Value = f64> {
    prop::sample::select(vec![0.0, 0.0, 1.0, -1.0, 0.5, 1e-12, 1.0 + 1e-12, -1e-9, 1e-170])
}

fn points(
    count: impl Into<prop::collection::SizeRange>,
) -> impl Strategy<Value = Vec<Point3<f64>>> {
    prop::collection::vec(
        [coordinates(), coordinates(), coordinates()].prop_map(Point3::from),
        count,
    )
}

fn scales() -> impl Strategy<Value = f64> {
    prop::sample::select(vec![1e-120, 1e-9, 1e-3, 1.0, 1e3, 9e8])
}

/// Triangles between few points: without area, twice the same, needles, crossing each other. Every other mesh is a box pressed flat.
fn meshes() -> impl Strategy<Value = TriMesh> {
    let soup = (points(3..9), prop::collection::vec([0..3_u32, 0..3_u32, 0..3_u32], 1..8))
        .prop_map(|(vertices, faces)| {
            let count = vertices.len() as u32;
            let corner = |(f, v): (usize, u32)| (f as u32 * 2 + v) % count;
            let face = |(f, face): (usize, [u32; 3])| face.map(|v| corner((f, v)));
            TriMesh::new(vertices, faces.into_iter().enumerate().map(face).collect())
        });
    let pressed = prop::sample::select(vec![0.0, 1e-300, 1e-170, 1e-12, 1e-6, 1.0]);
    let boxes = [pressed.clone(), pressed.clone(), pressed].prop_map(|size| {
        let mut mesh = cuboid(Vector3::repeat(1.0));
        mesh.vertices.iter_mut().for_each(|v| v.coords.component_mul_assign(&Vector3::from(size)));
        mesh
    });
    (prop_oneof![soup, boxes], scales()).prop_map(|(mesh, scale)| mesh.scaled(scale))
}

/// Vertices, the center, and points at all distances from there.
fn queries(mesh: &TriMesh) -> Vec<Point3<f64>> {
    let (low, high) = mesh.bounds().unwrap();
    let (center, size) = (nalgebra::center(&low, &high), (high - low).norm());
    let mut all: Vec<_> =
        mesh.vertices.iter().copied().chain([center, low, high, Point3::origin()]).collect();
    for direction in [Vector3::x(), Vector3::new(0.3, -0.4, 0.5), -Vector3::z()] {
        let lengths = [1e-300, 1e-160, 1e-9, 0.3 * size, size, 10.0 * size, 1.0, 1e9, 1e100, 1e140];
        all.extend(lengths.iter().map(|length| center + direction * *length));
    }
    all
}

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(1),
        cases,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(config(400))]

    #[test]
    fn closest_points_and_their_derivatives(mesh in meshes()) {
        for surface in [ClosestPoints::new(&mesh), ClosestPoints::with_winding_sign(&mesh)] {
            let surface = surface.unwrap();
            for query in queries(&mesh) {
                let (signed, found) = surface.signed_distance(&query);
                prop_assert!(signed.is_finite() && signed.abs() == found.distance, "{query} {found:?}");
                prop_assert!(finite(found.point.iter().chain(&found.barycentric)), "{query} {found:?}");
                let derivative = surface.derivative(&found);
                prop_assert!(is_finite_derivative(&derivative), "{query} {found:?} {derivative:?}");
            }
        }
    }

    #[test]
    fn normals_samples_mass_and_repairs(mesh in meshes(), density in prop::sample::select(vec![1e-300, 1.0, 1e300])) {
        for normals in [mesh.vertex_normals(), mesh.vertex_normals_within(0.0), mesh.vertex_normals_within(PI)] {
            prop_assert!(normals.iter().all(|n| (n.norm() - 1.0).abs() < 1e-9));
        }
        let samples = surface_samples(&mesh, 20, 1);
        prop_assert!(samples.iter().all(|s| finite(s.point.iter().chain(&s.normal))));
        let weighed = mass_properties(&mesh, density);
        for mass in weighed.into_iter().flat_map(|mass| [Ok(mass), mass.with_mass(1.0), mass.with_mass(1e300)]).flatten() {
            prop_assert!(mass.mass > 0.0 && finite(mass.inertia.iter().chain(mass.center_of_mass.iter()).chain([&mass.mass])));
        }
        let (clean, _) = mesh.cleaned();
        prop_assert!(clean.area().is_finite() && mesh.simplified(2).vertices.iter().all(|v| finite(&v.coords)));
    }

    #[test]
    fn unions_and_overlaps(mesh in meshes(), turn in [coordinates(), coordinates(), coordinates()], shift in scales()) {
        let Ok(body) = SolidUnion::new(&[mesh.clone(), mesh.clone()]) else { return Ok(()) };
        for angle in [0.0, PI] {
            let pose = Isometry3::new(Vector3::repeat(shift), Vector3::from(turn).try_normalize(0.0).unwrap_or_default() * angle);
            let shared = body.intersection_volume(&mesh.transformed(&pose));
            prop_assert!(!matches!(shared, Ok(volume) if !volume.is_finite()), "{shared:?}");
        }
    }
}

proptest! {
    #![proptest_config(config(60))]

    #[test]
    fn distance_grids(mesh in meshes()) {
        let surface = ClosestPoints::new(&mesh).unwrap();
        let (low, high) = surface.bounds();
        let spacing = ((high - low).amax() / 6.0).max(1e-12);
        for margin in [0.0, spacing] {
            let grid = SdfGrid::build(&surface, spacing, margin).unwrap();
            for query in queries(&mesh).into_iter().chain([Point3::new(1e300, -1e300, 0.0)]) {
                prop_assert!(is_finite_sample(&grid.evaluate(&query)) && grid.value(&query).is_finite(), "{query}");
                for reach in [0.0, spacing, f64::INFINITY] {
                    prop_assert!(grid.sample(&query, reach).iter().all(is_finite_sample));
                    prop_assert!(grid.distance(&query, reach).iter().all(|d| d.is_finite()));
                }
            }
        }
    }

    #[test]
    fn neighbors_in_degenerate_clouds(cloud in points(0..7), size in scales()) {
        let cloud: Vec<_> = cloud.iter().map(|p| p * size).collect();
        let tree = KdTree::new(&cloud).unwrap();
        for query in cloud.iter().copied().chain([Point3::new(1e300, 0.0, -1e300)]) {
            prop_assert!(tree.k_nearest(&query, 3).iter().all(|near| near.distance_squared.is_finite()), "{query}");
        }
        prop_assert!(estimate_normals(&tree, 5, &Point3::new(0.0, 0.0, 1e300)).iter().all(finite));
    }

    #[test]
    fn robots_at_half_turns_and_huge_positions(joint in prop::sample::select(vec![0.0, PI, -PI, 1e-9, 1e-300, 1e9, 1e150]), far in prop::sample::select(vec![0.0, 1e9, 1e60])) {
        let robot = KinematicTree::from_urdf_str(
            r#"<robot name="r"><link name="a"/><link name="b"><collision><geometry><box size="0.2 0.02 0.02"/></geometry></collision></link>
            <link name="c"/><joint name="q" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>
            <joint name="s" type="prismatic"><parent link="b"/><child link="c"/><axis xyz="1 0 0"/><limit lower="0" upper="0" effort="1" velocity="1"/></joint></robot>"#,
            None,
        ).unwrap();
        let base = Isometry3::new(Vector3::repeat(far), Vector3::z() * PI);
        for link in robot.forward_kinematics(&Fwd::<2>::variables([joint, far])) {
            prop_assert!(link.to_homogeneous().iter().all(|x| x.value.is_finite() && finite(&x.derivative)));
        }
        prop_assert!(finite(&KinematicTree::floating_joints(&base)) && finite(&robot.clamp_joints(&[joint, far]).unwrap()));
        let shape = Arc::new(RobotShape::new(&robot, 0.01, 0.02).unwrap());
        let posed = ArticulatedRobot::new(&robot, shape, &base, &[joint, far]).unwrap();
        for at in [base * Point3::origin(), Point3::new(0.05, 0.02, 0.0), Point3::new(1e30, 0.0, 0.0)] {
            if let Some(sample) = posed.distance_with_gradient(&at, f64::INFINITY) {
                prop_assert!(is_finite_sample(&sample.field) && finite(sample.joints.iter().chain(&sample.base)));
            }
            prop_assert!(posed.point_jacobian(2, &at).all(|(_, by)| finite(&by)));
            prop_assert!(posed.posed().signed_distance(&at, f64::INFINITY).is_none_or(|d| d.is_finite()));
        }
    }
}

#[test]
fn what_has_no_answer_is_an_error_or_zero() {
    let cube = cuboid(Vector3::repeat(1.0));
    let huge = mass_properties(&cube.clone().scaled(1e62), 1.0);
    assert!(matches!(huge, Err(MassError::Range { .. })), "{huge:?}");
    let surface = ClosestPoints::new(&cube).unwrap();
    assert_eq!(contact_area(&[], 0.0, &Isometry3::identity(), &surface, 0.1), 0.0);
    let far = Lattice::new(Point3::new(1e200, 0.0, 0.0), 1.0, [2; 3]);
    assert_eq!(
        (far, Lattice::new(Point3::origin(), 1e308, [2; 3])),
        (Err(SdfError::Origin), Err(SdfError::Origin))
    );
    assert!(Lattice::new(Point3::origin(), 1e-300, [2; 3]).is_err());
    let heights =
        HeightSpline::new(&[1.0, 2.0, 1e9, -1e9], [2, 2], [0.0; 2], [1e-3, 1e-9]).unwrap();
    for at in [0.0, 1.0, 1e9, 1e100, 1e300] {
        let found = heights.at(at, -at);
        assert!(
            finite(found.slopes.iter().chain(&found.curvatures).chain([&found.height])),
            "{found:?}"
        );
    }
}
