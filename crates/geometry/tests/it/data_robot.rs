//! Forward kinematics and taxel distances against values computed by independent tools.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use nalgebra::{Isometry3, Matrix4, Point3, Vector3};
use prehend_geometry::hand::{Taxel, load_taxels};
use prehend_geometry::mjcf::Model;
use prehend_geometry::{
    ClosestPoints, DistanceField, KinematicTree, PosedRobot, RobotShape, TriMesh,
};
use serde_json::Value;

fn data(path: &str) -> PathBuf {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    PathBuf::from(std::env::var("PREHEND_DATA").unwrap_or_else(|_| default.into())).join(path)
}

fn json(path: &str) -> Value {
    serde_json::from_str(&std::fs::read_to_string(data(path)).unwrap()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

fn matrix(value: &Value) -> Matrix4<f64> {
    let rows: Vec<Vec<f64>> = value.as_array().unwrap().iter().map(numbers).collect();
    Matrix4::from_fn(|i, j| rows[i][j])
}

/// The joint vector of positions listed for joint_0.0 to joint_15.0.
fn joints(robot: &KinematicTree, q: &Value) -> Vec<f64> {
    let state: BTreeMap<_, _> =
        numbers(q).into_iter().enumerate().map(|(i, q)| (format!("joint_{i}.0"), q)).collect();
    robot.joint_vector(&state).unwrap()
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn forward_kinematics_match_the_golden_poses() {
    let robots = [
        ("authored_xela", "hands/allegro_xela_right.urdf"),
        ("dex_urdf", "hands/allegro_right_mesh/allegro_hand_right.urdf"),
    ];
    let golden = json("hands/fk_golden.json");
    let mut compared = 0;
    let mut worst: f64 = 0.0;
    for (key, file) in robots {
        let robot = KinematicTree::from_urdf_file(data(file)).unwrap();
        for entry in golden.as_array().unwrap() {
            let poses = robot.forward_kinematics(&joints(&robot, &entry["q"]));
            for (link, expected) in entry[key].as_object().unwrap() {
                let pose = poses[robot.link_index(link).unwrap()].to_homogeneous();
                worst = worst.max((pose - matrix(expected)).amax());
                compared += 1;
            }
        }
    }
    println!("{compared} poses, worst entry {worst:.2e}");
    assert_eq!(compared, 40);
    // The file has nine decimals: 1e-9 beside half a unit of the last.
    assert!(worst <= 1e-9 + 0.5e-9);
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn robots_in_mjcf_have_the_poses_of_their_models() {
    for file in [
        "wonik_allegro/left_hand.xml",
        "shadow_hand/right_hand.xml",
        "robotiq_2f85/2f85.xml",
        "kuka_iiwa_14/iiwa14.xml",
    ] {
        let path = data("robots").join(file);
        let model = Model::from_file(&path).unwrap();
        let robot = KinematicTree::from_file(&path).unwrap();
        let value = |name: &String| {
            let found = model.joint_indices().find(|at| model.joint(*at).name == *name);
            found.map_or(0.0, |at| model.joint(at).reference)
        };
        let joints: Vec<f64> = robot.joint_names().iter().map(value).collect();
        let poses = robot.forward_kinematics(&joints);
        let expected = model.reference_poses();
        // The base is a body of the model.
        let base = {
            let name = &robot.links()[robot.root()].name;
            expected[model.bodies.iter().position(|b| b.name == *name).unwrap()].inverse()
        };
        let mut compared = 0;
        for (body, pose) in model.bodies.iter().zip(&expected) {
            let Some(link) = robot.link_index(&body.name) else { continue };
            let error = poses[link].to_homogeneous() - (base * pose).to_homogeneous();
            assert!(error.amax() < 1e-12, "{file}: {}: {error}", body.name);
            compared += 1;
        }
        let parts: usize = robot.links().iter().map(|link| link.parts.len()).sum();
        println!("{file}: {compared} links, {parts} parts, {} joints", joints.len());
        assert!(compared > 5 && parts > 5 && joints.len() > 5);
    }
}

/// Link of each taxel and the skin above it, which the golden distances are measured from: taxels of
/// the 4x4 pads lie 0.4 mm under the pad's face, those of the palm on it. `None` for the taxels of the
/// curved tips: the data does not say where their skin is.
fn taxels() -> Vec<Option<(String, Point3<f64>)>> {
    let skin = |t: Taxel| match t.patch.as_str() {
        "03" | "13" | "23" | "33" => None,
        "51" | "52" | "53" => Some((t.link, t.position)),
        _ => Some((t.link, t.position + t.normal * 4e-4)),
    };
    load_taxels(&data("hands/taxels_368.csv")).unwrap().into_iter().map(skin).collect()
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn taxel_distances_match_the_golden_ones() {
    let robot = KinematicTree::from_urdf_file(data("hands/allegro_xela_right.urdf")).unwrap();
    let taxels = taxels();
    let frames = json("bop/inhand/inhand_frames.json");
    let mut worst: f64 = 0.0;
    let mut compared = 0;
    for frame in frames["frames"].as_array().unwrap() {
        let model =
            format!("bop/inhand/models_eval/obj_{:06}.ply", frame["obj_id"].as_u64().unwrap());
        let object =
            ClosestPoints::new(&TriMesh::load(&data(&model)).unwrap().scaled(1e-3)).unwrap();
        let t_base_model = matrix(&frame["T_base_model"]);
        let t_model_base = t_base_model.try_inverse().unwrap();
        let poses = robot.forward_kinematics(&joints(&robot, &frame["q"]));
        let golden = numbers(&frame["taxel_signed_dist_mm"]);
        assert_eq!(golden.len(), taxels.len());
        for (taxel, expected) in taxels.iter().zip(golden) {
            let Some((link, skin)) = taxel else { continue };
            let p = poses[robot.link_index(link).unwrap()] * skin;
            let (distance, _) = object.signed_distance(&t_model_base.transform_point(&p));
            worst = worst.max((distance * 1e3 - expected).abs());
            compared += 1;
        }
    }
    println!("{compared} taxels, worst {worst:.2e} mm");
    assert!(compared == 18 * 248 && worst < 1e-3);
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn a_hand_is_built_and_queried_quickly() {
    for file in ["hands/allegro_xela_right.urdf", "mujoco/hand/allegro_right_xela.urdf"] {
        let robot = KinematicTree::from_urdf_file(data(file)).unwrap();
        let start = Instant::now();
        let shape =
            RobotShape::new(&robot, RobotShape::DEFAULT_SPACING, RobotShape::DEFAULT_MARGIN)
                .unwrap();
        let built = start.elapsed().as_secs_f64();
        let samples: usize = shape
            .links()
            .iter()
            .filter_map(|l| l.grid())
            .map(|g| g.dims().iter().product::<usize>())
            .sum();
        let poses: Vec<Isometry3<f64>> =
            robot.forward_kinematics(&vec![0.3; robot.joint_names().len()]);
        let posed = PosedRobot::new(Arc::new(shape), poses).unwrap();
        let points: Vec<Point3<f64>> = (0..100_000)
            .map(|i| {
                let r = |n: usize| (i * 7919 % n) as f64 / n as f64;
                Point3::new(0.02 + 0.06 * r(101), 0.12 * r(1009) - 0.06, 0.2 * r(10007) - 0.08)
            })
            .collect();
        let start = Instant::now();
        let hits = points.iter().filter_map(|p| posed.sample(p, 0.01)).count();
        let each = start.elapsed().as_secs_f64() / points.len() as f64;
        println!(
            "{file}: {samples} samples in {built:.2} s; {hits} hits, {:.0} ns a query",
            each * 1e9
        );
        assert!(hits > 1000 && hits < points.len());
        for p in points.iter().step_by(97) {
            let exact = posed.signed_distance(p, 0.01);
            if let (Some(e), Some(g)) = (exact, posed.sample(p, 0.01)) {
                assert!((e - g.distance).abs() < 1e-3, "{e} {}", g.distance);
            }
        }
    }
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn closest_points_are_found_quickly() {
    let mesh = TriMesh::load(&data("objects/006_mustard_bottle/5000.ply")).unwrap();
    let start = Instant::now();
    let tree = ClosestPoints::new(&mesh).unwrap();
    println!("built {} faces in {:.1} ms", mesh.faces.len(), start.elapsed().as_secs_f64() * 1e3);
    let surface: Vec<(Point3<f64>, u32)> = (0..100_000)
        .map(|i| {
            let face = i * 7919 % mesh.faces.len();
            let [a, b, c] = mesh.triangle(face);
            let (u, v) = ((i % 17) as f64 / 34.0, (i % 31) as f64 / 62.0);
            (a + (b - a) * u + (c - a) * v, face as u32)
        })
        .collect();
    for (name, offset) in [("on the surface", 0.0), ("1 cm off", 0.01), ("10 cm off", 0.1)] {
        let direction = Vector3::new(0.6, 0.64, 0.48) * offset;
        let start = Instant::now();
        let sum: f64 = surface
            .iter()
            .filter_map(|(p, _)| tree.closest(&(p + direction), f64::INFINITY))
            .map(|c| c.distance)
            .sum();
        let cold = start.elapsed().as_secs_f64() * 1e3;
        let start = Instant::now();
        let warm_sum: f64 = surface
            .iter()
            .filter_map(|(p, face)| tree.closest_with_hint(&(p + direction), f64::INFINITY, *face))
            .map(|c| c.distance)
            .sum();
        let warm = start.elapsed().as_secs_f64() * 1e3;
        println!("100k points {name}: {cold:.0} ms, warm {warm:.0} ms");
        assert!((sum - warm_sum).abs() < 1e-9 && sum <= offset * 1e5 + 1e-6);
    }
}
