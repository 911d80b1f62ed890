//! `prehend export`.

use gltf::animation::util::ReadOutputs;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use prehend_refine::scene::default_scene;
use serde_json::json;

use crate::fixture::Workplace;

/// A pose of single precision.
fn pose(translation: [f32; 3], [i, j, k, w]: [f32; 4]) -> Isometry3<f64> {
    let [i, j, k, w] = [i, j, k, w].map(f64::from);
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
    Isometry3::from_parts(Translation3::from(translation.map(f64::from)), turn)
}

fn near(a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
    (a.translation.vector - b.translation.vector).norm() < 1e-6
        && a.rotation.angle_to(&b.rotation) < 1e-6
}

/// Where a node is at the film's two moments, in the frame of its parent, and these moments.
fn keys(film: &gltf::Gltf, name: &str) -> ([Isometry3<f64>; 2], Option<Vec<f32>>) {
    let node = film.nodes().find(|n| n.name() == Some(name)).unwrap_or_else(|| panic!("{name}"));
    let (translation, rotation, _) = node.transform().decomposed();
    let (mut places, mut turns, mut times) = ([translation; 2], [rotation; 2], None);
    let channels = film.animations().flat_map(|animation| animation.channels());
    for channel in channels.filter(|c| c.target().node().index() == node.index()) {
        let reader = channel.reader(|_| film.blob.as_deref());
        times = Some(reader.read_inputs().unwrap().collect());
        match reader.read_outputs().unwrap() {
            ReadOutputs::Translations(read) => {
                places = read.collect::<Vec<_>>().try_into().unwrap();
            }
            ReadOutputs::Rotations(read) => {
                turns = read.into_f32().collect::<Vec<_>>().try_into().unwrap();
            }
            _ => panic!("nothing is scaled"),
        }
    }
    ([0, 1].map(|k| pose(places[k], turns[k])), times)
}

#[test]
fn nodes_of_a_film_are_where_the_poses_are() {
    let place = Workplace::new();
    place.edit_json("ds/test/000001/scene_camera.json", |cameras| {
        for image in ["0", "1"] {
            let camera = cameras[image].as_object_mut().unwrap();
            camera.retain(|name, _| !name.ends_with("_w2c"));
        }
    });
    let told = place.succeed("export --dataset ds --poses ds/init.csv --glb film.glb --rate 4");
    assert!(told.contains("2 poses in the camera's frame, written to film.glb"), "{told}");
    let film = gltf::Gltf::from_slice(&std::fs::read(place.path("film.glb")).unwrap()).unwrap();
    let rows = place.poses("ds/init.csv");
    let (poses, times) = keys(&film, "object 5");
    assert!(rows.iter().zip(&poses).all(|(row, pose)| near(&row.t_cam_model, pose)));
    assert_eq!(times, Some(vec![0.0, 0.25]));
    // The links of the hand, of both images.
    let mut links = 0;
    for (image, seed) in [1, 2].into_iter().enumerate() {
        let scene = default_scene(seed).unwrap();
        let hand = scene.frame.hand.as_ref().unwrap();
        let posed = scene.hand.posed(&hand.t_cam_hand, &hand.joints).unwrap();
        for (link, t_cam_link) in scene.hand.tree.links().iter().zip(posed.t_world_links()) {
            if !link.parts.is_empty() {
                let found = keys(&film, &link.name).0[image];
                assert!(near(&found, t_cam_link), "{}: {found} {t_cam_link}", link.name);
                links += 1;
            }
        }
    }
    assert!(links > 20, "{links}");
    // Upright: what falls, falls along −y, and the camera looks ahead.
    let [scene, _] = keys(&film, "scene").0;
    let gravity = default_scene(1).unwrap().frame.gravity.unwrap();
    assert!((scene.rotation * gravity.normalize() + Vector3::y()).norm() < 1e-6);
    let [camera, _] = keys(&film, "camera").0;
    let ahead = scene.rotation * (camera.rotation * -Vector3::z());
    assert!(ahead.x.abs() < 1e-6 && ahead.z < 0.0, "{ahead}");
    assert_eq!(camera.rotation * -Vector3::z(), Vector3::z());
    let meshes: Vec<_> = film.meshes().map(|mesh| mesh.name().unwrap().to_owned()).collect();
    assert!(meshes.contains(&"object 5".to_owned()) && meshes.len() > 10, "{meshes:?}");
}

#[test]
fn where_the_world_is_known_the_camera_moves() {
    let place = Workplace::new();
    let turn = [0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    place.edit_json("ds/test/000001/scene_camera.json", |cameras| {
        for (image, z) in [("0", 100.0), ("1", 300.0)] {
            cameras[image]["cam_R_w2c"] = json!(turn);
            cameras[image]["cam_t_w2c"] = json!([0.0, 0.0, z]);
        }
    });
    let export = "export --dataset ds --poses ds/init.csv --glb film.glb";
    assert!(place.succeed(export).contains("the world's frame"));
    let film = gltf::Gltf::from_slice(&std::fs::read(place.path("film.glb")).unwrap()).unwrap();
    let (poses, _) = keys(&film, "object 5");
    let (cameras, times) = keys(&film, "camera");
    assert_eq!(times.unwrap().len(), 2);
    for (k, row) in place.poses("ds/init.csv").iter().enumerate() {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
        let z = [0.1, 0.3][k];
        let t_world_cam = Isometry3::from_parts(Translation3::new(0.0, 0.0, z), turn).inverse();
        assert!(near(&poses[k], &(t_world_cam * row.t_cam_model)));
        assert!((cameras[k].translation.vector - Vector3::new(0.0, 0.0, -z)).norm() < 1e-6);
    }
    let [scene, _] = keys(&film, "scene").0;
    let gravity = turn_back(default_scene(1).unwrap().frame.gravity.unwrap());
    assert!((scene.rotation * gravity.normalize() + Vector3::y()).norm() < 1e-6);
    // Half of a place is none.
    place.edit_json("ds/test/000001/scene_camera.json", |cameras| {
        cameras["1"].as_object_mut().unwrap().remove("cam_t_w2c");
    });
    let said = place.prehend(export);
    assert!(said.code == 1 && said.err.contains("cam_t_w2c"), "{}", said.err);
}

/// From the frame of that camera to the world's.
fn turn_back(v: Vector3<f64>) -> Vector3<f64> {
    Vector3::new(v.y, -v.x, v.z)
}

#[test]
fn what_cannot_be_exported_is_told() {
    let place = Workplace::new();
    let export = "export --dataset ds --poses ds/init.csv";
    for (more, code, why) in [
        ("", 1, "--glb"),
        ("--glb no/film.glb", 1, "no/film.glb"),
        ("--glb film.glb --rate 0", 1, "rate 0"),
        ("--glb film.glb --scene 7", 1, "no pose"),
    ] {
        let said = place.prehend(&format!("{export} {more}"));
        assert!(said.code == code && said.err.contains(why), "{more}: {} {}", said.code, said.err);
    }
    // An image that cannot be read costs its key alone.
    place.remove("ds/test/000001/rgb/000001.png");
    let said = place.prehend(&format!("{export} --glb film.glb"));
    assert!(said.code == 2 && said.err.contains("scene 1 image 1: "), "{}", said.err);
    let film = gltf::Gltf::from_slice(&std::fs::read(place.path("film.glb")).unwrap()).unwrap();
    assert_eq!(film.animations().count(), 0);
    // Two scenes are no film.
    place.copy("ds/test/000001", "ds/test/000002");
    let poses = place.read("ds/init.csv");
    let (_, rows) = poses.split_once('\n').unwrap();
    let more: String =
        rows.lines().map(|row| format!("2{}\n", row.strip_prefix('1').unwrap())).collect();
    place.write("two.csv", &format!("{poses}{more}"));
    let said = place.prehend("export --dataset ds --poses two.csv --glb film.glb");
    assert!(said.code == 1 && said.err.contains("--scene says which"), "{}", said.err);
}
