//! Intersection volumes of the posed hand and object against values computed with another library.
//!
//! The golden hand is the union of the primitives of `hands/allegro_xela_right.json`: exact boxes, and capsules whose
//! hemispheres have 12 rows and 24 columns of facets, inscribed, the first column at +x.

#![allow(clippy::unwrap_used)] // a test fails by panicking

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::{
    Isometry3, Matrix3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3,
};
use prehend_geometry::{TriMesh, UnionBody};
use serde_json::Value;

fn data(relative: &str) -> PathBuf {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    Path::new(&std::env::var("PREHEND_DATA").unwrap_or_else(|_| default.into())).join(relative)
}

fn json(relative: &str) -> Value {
    serde_json::from_str(&std::fs::read_to_string(data(relative)).unwrap()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_column_slice(&numbers(value))
}

/// A rigid motion from a row-major rotation and a translation, the rotation brought back from its rounding.
fn motion(rotation: &[f64], translation: Vector3<f64>) -> Isometry3<f64> {
    let rotation = Rotation3::from_matrix(&Matrix3::from_row_slice(rotation));
    Isometry3::from_parts(translation.into(), UnitQuaternion::from_rotation_matrix(&rotation))
}

fn cuboid(size: &[f64], center: Vector3<f64>) -> TriMesh {
    let corner = |k: usize| {
        Point3::from(center + Vector3::from_fn(|a, _| size[a] * ((k >> a & 1) as f64 - 0.5)))
    };
    let quads =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let faces = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
    TriMesh::new((0..8).map(corner).collect(), faces)
}

/// A capsule along z from `low` to `high`, inscribed in the true one.
fn capsule(low: Vector3<f64>, high: Vector3<f64>, radius: f64) -> TriMesh {
    const ROWS: usize = 12;
    const COLUMNS: u32 = 24;
    let mut vertices = vec![Point3::from(low - Vector3::z() * radius)];
    for (end, first) in [(low, -(ROWS as f64)), (high, 0.0)] {
        let skip = usize::from(first < 0.0);
        for row in skip..ROWS + skip {
            let latitude = std::f64::consts::FRAC_PI_2 * (first + row as f64) / ROWS as f64;
            for column in 0..COLUMNS {
                let longitude = std::f64::consts::TAU * f64::from(column) / f64::from(COLUMNS);
                let (ring, height) = (radius * latitude.cos(), radius * latitude.sin());
                vertices.push(
                    (end + Vector3::new(ring * longitude.cos(), ring * longitude.sin(), height))
                        .into(),
                );
            }
        }
    }
    vertices.push(Point3::from(high + Vector3::z() * radius));
    let top = vertices.len() as u32 - 1;
    let rings = (top - 1) / COLUMNS;
    let mut faces = Vec::new();
    for c in 0..COLUMNS {
        let next = (c + 1) % COLUMNS;
        faces.push([0, 1 + next, 1 + c]);
        for r in 0..rings - 1 {
            let (a, b) = (1 + r * COLUMNS, 1 + (r + 1) * COLUMNS);
            faces.push([a + c, b + next, b + c]);
            faces.push([a + c, a + next, b + next]);
        }
        let last = 1 + (rings - 1) * COLUMNS;
        faces.push([last + c, last + next, top]);
    }
    TriMesh::new(vertices, faces)
}

fn hand(joints: &[f64]) -> UnionBody {
    let hand = json("hands/allegro_xela_right.json");
    let order: Vec<_> =
        hand["joint_order"].as_array().unwrap().iter().map(|n| n.as_str().unwrap()).collect();
    let angle: BTreeMap<_, _> = order.into_iter().zip(joints.iter().copied()).collect();
    let mut t_base = BTreeMap::from([(hand["root"].as_str().unwrap(), Isometry3::identity())]);
    // The file lists every parent before its children.
    for joint in hand["joints"].as_array().unwrap() {
        let rpy = numbers(&joint["rpy"]);
        let origin = Isometry3::from_parts(
            Translation3::from(vector(&joint["xyz"])),
            UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2]),
        );
        let axis = Unit::new_normalize(vector(&joint["axis"]));
        let turn = UnitQuaternion::from_axis_angle(&axis, angle[joint["name"].as_str().unwrap()]);
        let t_parent = t_base[joint["parent"].as_str().unwrap()];
        t_base.insert(joint["child"].as_str().unwrap(), t_parent * origin * turn);
    }
    let mut parts = Vec::new();
    for (link, content) in hand["links"].as_object().unwrap() {
        for primitive in content["primitives"].as_array().unwrap() {
            let mesh = match primitive["type"].as_str().unwrap() {
                "box" => cuboid(&numbers(&primitive["size"]), vector(&primitive["center"])),
                _ => capsule(
                    vector(&primitive["p0"]),
                    vector(&primitive["p1"]),
                    primitive["r"].as_f64().unwrap(),
                ),
            };
            parts.push(mesh.transformed(&t_base[link.as_str()]));
        }
    }
    UnionBody::new(&parts).unwrap()
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn hand_and_object_agree_with_the_golden_volumes() {
    let mut initial = BTreeMap::new();
    for level in ["low", "high"] {
        let text =
            std::fs::read_to_string(data(&format!("bop/inhand/init_{level}_bopinhand-test.csv")))
                .unwrap();
        for line in text.lines().skip(1) {
            let cells: Vec<&str> = line.split(',').collect();
            let list = |cell: &str| {
                cell.split_whitespace().map(|n| n.parse().unwrap()).collect::<Vec<f64>>()
            };
            let t = Vector3::from_column_slice(&list(cells[5])) * 1e-3;
            initial
                .insert((format!("init_{level}"), cells[1].to_owned()), motion(&list(cells[4]), t));
        }
    }
    let truth = json("bop/inhand/test/000001/scene_gt.json");
    let mut compared = 0;
    for frame in json("bop/inhand/inhand_frames.json")["frames"].as_array().unwrap() {
        let started = std::time::Instant::now();
        let hand = hand(&numbers(&frame["q"]));
        let united = started.elapsed();
        let path = data(&format!(
            "bop/inhand/models_eval/obj_{:06}.ply",
            frame["obj_id"].as_i64().unwrap()
        ));
        let object = TriMesh::load(&path).unwrap().scaled(1e-3).cleaned().0;
        let rows: Vec<Vec<f64>> =
            frame["T_cam_base"].as_array().unwrap().iter().map(numbers).collect();
        let rotation: Vec<f64> = rows[..3].iter().flat_map(|r| r[..3].to_vec()).collect();
        let t_cam_base = motion(&rotation, Vector3::new(rows[0][3], rows[1][3], rows[2][3]));
        let image = frame["im_id"].to_string();
        let pose = &truth[&image][0];
        let t_gt = motion(&numbers(&pose["cam_R_m2c"]), vector(&pose["cam_t_m2c"]) * 1e-3);
        for (name, t_cam_model) in [
            ("gt", t_gt),
            ("init_low", initial[&("init_low".to_owned(), image.clone())]),
            ("init_high", initial[&("init_high".to_owned(), image.clone())]),
        ] {
            let posed = object.transformed(&(t_cam_base.inverse() * t_cam_model));
            let started = std::time::Instant::now();
            let volume = hand.intersection_volume(&posed).unwrap() * 1e6;
            let golden = frame[name]["IV_cm3"].as_f64().unwrap();
            println!(
                "{image} {name}: {volume:.7} cm³, {:.1e} off; {united:?}, {:?}",
                volume - golden,
                started.elapsed()
            );
            assert!(
                (volume - golden).abs() <= 1e-4,
                "image {image} {name}: {volume} instead of {golden}"
            );
            compared += 1;
        }
    }
    assert_eq!(compared, 54);
}
