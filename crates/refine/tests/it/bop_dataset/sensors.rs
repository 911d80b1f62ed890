//! Sensors of every kind in a dataset's files.

use std::fs;

use image::{ImageBuffer, Luma};
use nalgebra::Vector3;
use prehend_refine::data::Assets;
use prehend_refine::data::bop::{BodyKind, DatasetError, TactileReading};
use prehend_refine::info::{DescribeOptions, describe};

use super::Fixture;

/// An entry of `scene_camera.json` with more in it.
fn camera(more: &str) -> String {
    format!(r#"{{"cam_K": [500, 0, 1.5, 0, 500, 1, 0, 0, 1], "depth_scale": 1{more}}}"#)
}

#[test]
fn depth_of_a_camera_of_its_own_is_registered() {
    let fixture = Fixture::new();
    // A wall one meter away, seen by a camera of half the pixels 2 mm to the right.
    let own = format!(
        r#", "depth_K": [250, 0, 0.5, 0, 250, 0.25, 0, 0, 1], "cam_R_d2c": {I}, "cam_t_d2c": [2, 0, 0]"#
    );
    fixture.scene("scene_camera.json", &format!(r#"{{"0": {}}}"#, camera(&own)));
    fixture.image("depth/000000.png", |p| {
        ImageBuffer::from_fn(2, 2, |_, _| Luma([1000u16])).save(p).unwrap();
    });
    let depth = fixture.open().frame(4, 0).unwrap().depth().unwrap();
    assert_eq!((depth.width(), depth.height()), (4, 3));
    // The four points are in columns 1.5 and 3.5, rows 0.5 and 2.5 of the color image; without the 2 mm, two columns to the left.
    let seen = depth.pixels().iter().enumerate().filter(|(_, z)| **z > 0.0);
    let seen: Vec<usize> = seen.map(|(k, _)| k).collect();
    assert_eq!(seen, [6, 7, 10, 11]);
    assert!(seen.iter().all(|k| (depth.pixels()[*k] - 1.0).abs() < 1e-6));
    for (own, missing) in [
        (r#", "cam_t_d2c": [0, 0, 0]"#, "0.cam_R_d2c: is missing"),
        (&format!(r#", "cam_R_d2c": {I}, "cam_t_d2c": [0, 0, 0]"#), "0.depth_K: is missing"),
        (r#", "depth_K": [1, 2]"#, "0.depth_K: expected 9 numbers, found 2"),
        (r#", "depth_dist": {"model": "fog", "coefficients": []}"#, "0.depth_dist: "),
    ] {
        fixture.scene("scene_camera.json", &format!(r#"{{"0": {}}}"#, camera(own)));
        let error = fixture.open().frame(4, 0).unwrap_err().to_string();
        assert!(error.contains(&format!("scene_camera.json: {missing}")), "{error}");
    }
}

const I: &str = "[1, 0, 0, 0, 1, 0, 0, 0, 1]";

#[test]
fn a_scene_may_have_color_or_depth_alone() {
    let fixture = Fixture::new();
    let scene = fixture.root().join("test/000004");
    fs::rename(scene.join("depth"), scene.join("none")).unwrap();
    let color = fixture.open().frame(4, 0).unwrap().observation(0).unwrap();
    assert!(color.depth.pixels().iter().all(|z| *z == 0.0) && color.color.pixels()[0][0] == 1.0);
    fs::rename(scene.join("none"), scene.join("depth")).unwrap();
    fs::rename(scene.join("rgb"), scene.join("no_rgb")).unwrap();
    let depth = fixture.open().frame(4, 0).unwrap().observation(0).unwrap();
    assert!(depth.depth.pixels()[0] > 0.0 && depth.color.pixels()[0] == [0.0; 3]);
    // One file that is missing is an error.
    fs::remove_file(scene.join("depth/000000.png")).unwrap();
    let error = fixture.open().frame(4, 0).unwrap().observation(0).unwrap_err();
    assert!(error.to_string().ends_with(": no such file; the folder has 000003.png"), "{error}");
    let error = fixture.open().frame(4, 0).unwrap().depth().unwrap_err();
    assert!(matches!(error, DatasetError::Missing { .. }));
}

#[test]
fn gray_images_stand_in_for_color() {
    let fixture = Fixture::new();
    let scene = fixture.root().join("test/000004");
    fs::rename(scene.join("rgb"), scene.join("gray")).unwrap();
    fixture.image("gray/000000.png", |p| {
        ImageBuffer::from_pixel(4, 3, Luma([51u8])).save(p).unwrap();
    });
    let seen = fixture.open().frame(4, 0).unwrap().observation(0).unwrap();
    assert!(seen.color.pixels().iter().flatten().all(|c| (c - 0.2).abs() < 1e-6));
    let told = describe(fixture.root(), &DescribeOptions::default()).unwrap();
    assert_eq!(told.fields["scenes"][0]["color"], 2);
}

#[test]
fn images_of_a_rig_are_views_of_one_moment() {
    let fixture = Fixture::new();
    fixture.remove("scene_bodies.json");
    // Of image 0 the object's mask is number 5.
    fixture.mask("000003_000005", 3);
    let place = |rig: &str, z: f64| {
        format!(r#", "rig": {rig}, "cam_R_w2c": {I}, "cam_t_w2c": [0, 0, {z}]"#)
    };
    let both = |a: &str, b: &str| {
        fixture
            .scene("scene_camera.json", &format!(r#"{{"0": {}, "3": {}}}"#, camera(a), camera(b)));
        let dataset = fixture.open();
        let frame = dataset.frame(4, 0).unwrap();
        let read = Assets::new(&dataset, 0).observation(&frame, 0, &[]);
        read.map_err(|error| error.to_string())
    };
    let seen = both(&place("7", 500.0), &place("7", 450.0)).unwrap();
    let [view] = &seen.views[..] else { panic!("not one view") };
    assert!((view.t_view_cam().translation.z + 0.05).abs() < 1e-12);
    // The mask of the same number, or none.
    assert_eq!(view.observation().mask.count(), 3);
    let other = fixture.root().join("test/000004/mask_visib/000003_000005.png");
    fs::rename(&other, other.with_file_name("000003_000006.png")).unwrap();
    assert!(both(&place("7", 500.0), &place("7", 450.0)).unwrap().views.is_empty());
    fs::rename(other.with_file_name("000003_000006.png"), &other).unwrap();
    assert_eq!(fixture.open().scene(4).unwrap().moments().unwrap(), [0]);
    for other in ["8", "\"7\""] {
        assert!(both(&place("7", 500.0), &place(other, 450.0)).unwrap().views.is_empty());
    }
    assert!(both("", &place("7", 450.0)).unwrap().views.is_empty());
    let error = both(&place("7", 500.0), r#", "rig": 7"#).unwrap_err();
    assert!(error.contains("3.cam_R_w2c: is missing"), "{error}");
    let error = both(&place("7", 500.0), &place("7", 500.0)).unwrap_err();
    assert!(error.contains("3.cam_t_w2c: is the place of image 0 of the same rig, too"), "{error}");
    let error = both(r#", "rig": 7"#, "").unwrap_err();
    assert!(error.contains("0.cam_R_w2c: is missing"), "{error}");
    // What is wrong with another image costs that one alone.
    assert!(both(&place("7", 500.0), r#", "rig": [7]"#).unwrap().views.is_empty());
    let error = both(r#", "rig": [7]"#, "").unwrap_err();
    assert!(error.contains("0.rig: is neither a string nor an integer"), "{error}");
    // Places of images without a rig are never read.
    assert!(both(r#", "cam_R_w2c": "hidden""#, "").is_ok());
}

#[test]
fn bodies_and_sensors_of_every_kind_are_read_or_refused_by_name() {
    let fixture = Fixture::new();
    let pose = format!(r#""cam_R_b2c": {I}, "cam_t_b2c": [0, 0, 500]"#);
    let bodies = |list: &str| {
        let text = format!(r#"{{"0": {{"gravity": [0, 9.81, 0], "bodies": [{list}]}}}}"#);
        fixture.scene("scene_bodies.json", &text);
        fixture.open().frame(4, 0).unwrap().bodies().map_err(|error| error.to_string())
    };
    let hand = format!(r#"{{"name": "hand", "urdf": "h.urdf", "joints": {{}}, {pose}}}"#);
    let table =
        format!(r#"{{"name": "table", "kind": "plane", "sigma_mm": 2, "sigma_deg": 180, {pose}}}"#);
    let other = format!(r#"{{"name": "box", "kind": "object", "obj_id": 7, {pose}}}"#);
    let read = bodies(&[&hand[..], &table, &other].join(",")).unwrap().bodies;
    assert_eq!(read[1].sigmas, [Some(2e-3), Some(std::f64::consts::PI)]);
    assert_eq!((&read[1].kind, read[0].sigmas), (&BodyKind::Plane, [None; 2]));
    assert_eq!(read[2].kind, BodyKind::Object { obj_id: 7 });
    for (list, expected) in [
        (hand.replace("\"joints\": {}, ", ""), "0.bodies[0].joints: is missing"),
        (other.replace("\"obj_id\": 7, ", ""), "0.bodies[0].obj_id: is missing"),
        (table.replace("plane", "wall"), "0.bodies[0].kind: unknown variant `wall`"),
        (table.replace(": 2,", ": -2,"), "0.bodies[0].sigma_mm: -2 is below zero"),
        (format!("{hand}, {hand}"), "0.bodies[1].name: there are two bodies called \"hand\""),
        (
            table.replace("\"table\"", "\"a/b\""),
            "0.bodies[0].name: \"a/b\" is empty or has a slash",
        ),
    ] {
        let error = bodies(&list).unwrap_err();
        assert!(error.contains(&format!("scene_bodies.json: {expected}")), "{error}");
    }
    let touch = |entry: &str| {
        fixture.scene("scene_tactile.json", &format!(r#"{{"0": {entry}}}"#));
        fixture.open().frame(4, 0).unwrap().tactile().map_err(|error| error.to_string())
    };
    let binary =
        r#"{"body": "hand", "kind": "binary", "taxels": "t.csv", "contact": [0, true, null]}"#;
    let near =
        r#"{"body": "hand", "kind": "proximity", "taxels": "t.csv", "distance": [12.5, null]}"#;
    let patch = r#"{"body": "hand", "kind": "patch", "link": "tip", "points": [[0, 0, 28]], "normals": [[0, 0, 2]]}"#;
    let read = touch(&format!("[{binary}, {near}, {patch}]")).unwrap();
    let TactileReading::Binary(contact) = &read[0].reading else { panic!("not binary") };
    assert_eq!(contact[..], [Some(false), Some(true), None]);
    let TactileReading::Proximity(distance) = &read[1].reading else { panic!("no distance") };
    assert_eq!(distance[..], [Some(0.0125), None]);
    let TactileReading::Patch { points, normals, .. } = &read[2].reading else {
        panic!("no patch")
    };
    assert_eq!((points[0].z, normals[0]), (0.028, Vector3::z()));
    let force = r#"{"body": "hand", "taxels": "t.csv", "force": [[0, 0, 0]]}"#;
    for (entry, expected) in [
        (binary.replace("binary", "smell"), "0.kind: unknown variant `smell`"),
        (
            binary.replace("[0, true", "[2, true"),
            "0.contact[0]: 2 is not true, false, 1, 0 or null",
        ),
        (binary.replace("\"taxels\": \"t.csv\", ", ""), "0.taxels: is missing"),
        (binary.replace("\"body\": \"hand\", ", ""), "0.body: is missing"),
        (near.replace("12.5", "-1"), "0.distance[0]: -1 is below zero"),
        (patch.replace("[[0, 0, 2]]", "[]"), "0.normals: 0, but there are 1 points"),
        (patch.replace("[0, 0, 2]", "[0, 0, 0]"), "0.normals: one is zero"),
        (format!("[{force}, {force}]"), "0[1]: there are two sensors of kind force"),
        (format!("[{near}, {}]", near.replace("null", "\"far\"")), "0[1].distance[1]: "),
    ] {
        let error = touch(&entry).unwrap_err();
        assert!(error.contains(&format!("scene_tactile.json: {expected}")), "{error}");
    }
}
