//! Every kind of sensor, through frame files: images, touch and other bodies with the errors that calibrations have.

#[path = "../../examples/sensors/sensing.rs"]
mod sensing;
#[path = "../../examples/sensors/world.rs"]
mod world;

use std::path::Path;

use nalgebra::Isometry3;
use prehend_geometry::SplitMix64;
use prehend_refine::data::load_frame_file;
use prehend_refine::evaluate::metrics::{oe_deg, pe_cm};
use prehend_refine::strategy::{Estimate, Fused, Posterior};
use prehend_refine::{Frame, PreparedFrame, refine};
use serde_json::{Value, json};

use self::sensing::{Extra, write_frame};
use self::world::World;

const SEEDS: u64 = 2;

fn found(world: &World, extras: &[Extra], seed: u64) -> Estimate {
    let folder = tempfile::tempdir().unwrap();
    write_frame(folder.path(), world, extras, seed).unwrap();
    let (input, start) = load_frame_file(&folder.path().join("frame.json"), 0, None, None).unwrap();
    refine(&PreparedFrame::new(&input.frame, &input.object).unwrap(), &start, &Fused::default())
        .unwrap()
}

/// Mean errors with one sensor more: of the pose in the camera \[cm, °\], and of its place from the hand \[cm\].
fn errors(extras: &[Extra]) -> [f64; 3] {
    mean_errors(extras, SEEDS)
}

/// Mean errors over a number of worlds, as of [`errors`].
fn mean_errors(extras: &[Extra], seeds: u64) -> [f64; 3] {
    let of_seed = |seed| {
        let world = World::held(seed, if extras == [Extra::SecondHand] { 2 } else { 1 }).unwrap();
        let found = found(&world, extras, seed);
        let in_hand = found.state.t_cam_hand.inverse() * found.t_cam_object();
        let t_hand_object = world.hands[0].inverse() * world.t_world_object;
        let truth = world.t_cam_object();
        [
            pe_cm(found.t_cam_object(), &truth),
            oe_deg(found.t_cam_object(), &truth),
            pe_cm(&in_hand, &t_hand_object),
        ]
    };
    let mut sum = [0.0; 3];
    for seed in 0..seeds {
        sum.iter_mut().zip(of_seed(seed)).for_each(|(sum, error)| *sum += error / seeds as f64);
    }
    sum
}

#[test]
fn depth_of_another_camera_and_color_or_depth_alone_are_enough() {
    let [pe, oe, _] = errors(&[Extra::DepthCamera]);
    assert!(pe < 0.2 && oe < 0.8, "{pe} {oe}");
    let [pe, oe, _] = errors(&[Extra::DepthAlone]);
    assert!(pe < 0.2 && oe < 0.8, "{pe} {oe}");
    // Where it is along the line of sight, color tells from its size alone.
    let world = World::held(0, 1).unwrap();
    let found = found(&world, &[Extra::ColorAlone], 0);
    let pose = found.t_cam_object();
    let (pe, oe) = (pe_cm(pose, &world.t_cam_object()), oe_deg(pose, &world.t_cam_object()));
    assert!(pe < 0.5 && oe < 2.0, "{pe} {oe}");
}

#[test]
fn a_second_camera_helps() {
    let [pe, _, from_hand] = mean_errors(&[], 6);
    let both = mean_errors(&[Extra::SecondCamera], 6);
    assert!(both[0] < pe && both[2] < from_hand, "{both:?} {pe} {from_hand}");
}

#[test]
fn touch_of_every_kind_ties_the_object_to_the_hand() {
    // Color alone knows the object in the image about as well as forces and contacts of a hand that is off by 2 mm.
    let [_, turned, alone] = mean_errors(&[Extra::ColorAlone], 12);
    for extra in [Extra::Force, Extra::Binary, Extra::Proximity, Extra::Patch] {
        let [pe, oe, from_hand] = mean_errors(&[Extra::ColorAlone, extra], 12);
        let helps = match extra {
            Extra::Force | Extra::Binary => oe < turned && from_hand < 1.05 * alone,
            _ => from_hand < 0.9 * alone,
        };
        assert!(pe < 0.3 && oe < 2.0 && helps, "{extra:?}: {pe} {oe} {turned} {from_hand} {alone}");
    }
}

#[test]
fn a_second_hand_and_a_table_with_another_object_are_parts_of_the_scene() {
    let [pe, oe, from_hand] = errors(&[Extra::SecondHand]);
    assert!(pe < 0.3 && oe < 0.6 && from_hand < 0.15, "{pe} {oe} {from_hand}");
    for seed in 0..SEEDS {
        let world = World::on_table(seed).unwrap();
        let extras = &[Extra::Table, Extra::Other][..=seed as usize];
        let found = found(&world, extras, seed);
        let pose = found.t_cam_object();
        // The table is what the object's place is relative to.
        let above = (found.state.t_cam_hand.inverse() * pose).translation.z;
        let height = world.t_world_object.translation.z;
        assert!((above - height).abs() < 2e-3, "{above} {height}");
        assert!(oe_deg(pose, &world.t_cam_object()) < 1.5);
        // Nine joints of the other object's place.
        assert_eq!(found.state.joints.len(), 9 * (extras.len() - 1));
    }
}

/// A frame file that was changed, as far as it can be read.
fn read_changed(folder: &Path, change: &dyn Fn(&mut Value)) -> Result<Isometry3<f64>, String> {
    let text = std::fs::read_to_string(folder.join("frame.json")).unwrap();
    let mut frame: Value = serde_json::from_str(&text).unwrap();
    change(&mut frame);
    let file = folder.join("changed.json");
    std::fs::write(&file, frame.to_string()).unwrap();
    load_frame_file(&file, 0, None, None).map(|(_, pose)| pose).map_err(|e| e.to_string())
}

#[test]
fn values_that_cannot_be_name_the_file_and_the_field() {
    let world = World::held(0, 1).unwrap();
    let folder = tempfile::tempdir().unwrap();
    write_frame(folder.path(), &world, &[Extra::SecondCamera], 0).unwrap();
    let refused = |change: &dyn Fn(&mut Value)| {
        let error = read_changed(folder.path(), change).unwrap_err();
        assert!(error.contains("changed.json: "), "{error}");
        error.split_once("changed.json: ").unwrap().1.to_owned()
    };
    read_changed(folder.path(), &|_| ()).unwrap();
    let plane = json!({ "name": "table", "kind": "plane", "pose":
        { "unit": "m", "quaternion_wxyz": [1, 0, 0, 0], "translation": [0, 0, 1] } });
    let with = |key: &'static str, value: Value| {
        let mut plane = plane.clone();
        plane[key] = value;
        move |frame: &mut Value| frame["bodies"] = json!([plane.clone()])
    };
    read_changed(folder.path(), &with("sigma_mm", json!(2.0))).unwrap();
    let touch =
        |sensor: Value| move |frame: &mut Value| frame["robot"]["touch"] = json!([sensor.clone()]);
    type Change<'a> = &'a dyn Fn(&mut Value);
    let cases: [(Change<'_>, &str); 16] = [
        (&|f| f["cam_t_d2c"] = json!([1, 2, 3]), "cam_R_d2c: is missing"),
        (
            &|f| f["depth_dist"] = json!({ "model": "brown_conrady", "coefficients": [] }),
            "depth_K: is missing",
        ),
        (
            &|f| f["bodies"] = json!([{ "name": "", "kind": "plane", "pose": plane["pose"] }]),
            "bodies[0].name: \"\" is empty or has a slash",
        ),
        (
            &|f| {
                f["depth_K"] = f["K"].clone();
                f["cam_R_d2c"] = json!([1, 0, 0, 0, 1, 0, 0, 0, 1]);
                f["cam_t_d2c"] = json!([0, 0, -9000]);
            },
            "cam_t_d2c: nothing that depth measured is in the color image",
        ),
        (
            &|f| {
                f["depth_K"] = f["K"].clone();
                f.as_object_mut().unwrap().retain(|key, _| key != "depth");
            },
            "depth: is missing",
        ),
        (&|f| f["depth_K"] = json!([1, 2, 3]), "depth_K: expected 9 numbers, found 3"),
        (
            &|f| {
                f.as_object_mut().unwrap().remove("depth_unit_m");
            },
            "depth_unit_m: is missing",
        ),
        (
            &|f| {
                f.as_object_mut().unwrap().retain(|key, _| key != "rgb" && key != "depth");
            },
            "rgb: is missing, and so is depth",
        ),
        (&|f| f["cameras"][0]["K"] = json!([0, 0, 0, 0, 0, 0, 0, 0, 0]), "cameras[0].K: "),
        (
            &|f| f["cameras"][0]["pose"] = json!({ "unit": "m", "matrix": [1] }),
            "cameras[0].pose.matrix: ",
        ),
        (
            &with("kind", json!("wall")),
            "bodies[0].kind: unknown variant `wall`, expected one of `hand`, `plane`, `object`",
        ),
        (&with("sigma_mm", json!(-1.0)), "bodies[0].sigma_mm: -1 is below zero"),
        (&with("kind", json!("object")), "bodies[0].mesh: is missing"),
        (&with("name", json!("robot")), "bodies[0].name: there are two bodies called \"robot\""),
        (
            &touch(json!({ "kind": "patch", "link": "nowhere", "points": [], "normals": [] })),
            "robot.touch[0]: \"robot\" has no link \"nowhere\"",
        ),
        (
            &touch(
                json!({ "kind": "patch", "link": "palm", "points": [[0, 0, 0]], "normals": [] }),
            ),
            "robot.touch[0].normals: 0, but there are 1 points",
        ),
    ];
    for (change, expected) in cases {
        let error = refused(change);
        assert!(error.starts_with(expected), "{error}\n{expected}");
    }
}

/// Errors \[cm, °\] and posterior of a held object where what is seen of it is changed before: its colors and depths \[m\] by column and row.
fn of_changed(change: impl Fn([usize; 2], &mut [f32; 3], &mut f32)) -> (f64, f64, Posterior) {
    let world = World::held(0, 1).unwrap();
    let folder = tempfile::tempdir().unwrap();
    write_frame(folder.path(), &world, &[], 0).unwrap();
    let (mut input, start) =
        load_frame_file(&folder.path().join("frame.json"), 0, None, None).unwrap();
    let Frame { color, depth, mask, .. } = &mut input.frame;
    let pixels = color.pixels_mut().iter_mut().zip(depth.pixels_mut()).zip(mask.pixels());
    for (k, ((color, depth), _)) in pixels.enumerate().filter(|(_, (_, masked))| **masked) {
        change([k % 640, k / 640], color, depth);
    }
    let found = refine(
        &PreparedFrame::new(&input.frame, &input.object).unwrap(),
        &start,
        &Fused::default(),
    )
    .unwrap();
    let (pose, truth) = (*found.t_cam_object(), world.t_cam_object());
    (pe_cm(&pose, &truth), oe_deg(&pose, &truth), found.posterior.unwrap())
}

#[test]
fn depth_that_does_not_fit_leaves_the_pose_right_or_unsure() {
    // Light goes through to what is behind.
    let transparent = of_changed(|_, _, depth| *depth += 0.12);
    // Highlights are where they seem to be.
    let shiny = of_changed(|[x, y], _, depth| {
        *depth += 0.03 * SplitMix64::new((x / 12 + 100 * (y / 12)) as u64).normal() as f32;
    });
    let near = of_changed(|_, _, depth| *depth -= 0.02);
    for (pe, oe, posterior) in [transparent, shiny, near] {
        let right = pe < 0.5 && oe < 5.0;
        println!("{pe} {oe} {} {:?}", posterior.probability(), posterior.fit);
        assert!(right || posterior.probability() < 0.9, "{pe} {oe}");
    }
}

#[test]
fn another_texture_is_told_or_does_no_harm() {
    // A negative, and a chessboard.
    let negative = of_changed(|_, color, _| *color = color.map(|c| 1.0 - c));
    let board = of_changed(|[x, y], color, _| {
        *color = [if (x / 16 + y / 16).is_multiple_of(2) { 0.9 } else { 0.1 }; 3];
    });
    for (pe, _, _) in [&negative, &board] {
        assert!(*pe < 0.2, "{pe}");
    }
    // A negative looks more like the bottle's other side.
    assert!(board.1 < 1.5, "{}", board.1);
    let (.., posterior) = of_changed(|_, _, _| ());
    assert!(posterior.probability() > 0.9);
}
