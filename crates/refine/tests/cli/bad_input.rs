//! Every fault is named, costs only the frames it is in, and leaves no half-written file.

use nalgebra::Point3;
use prehend_geometry::TriMesh;
use prehend_render::{DepthImage, Mask};
use serde_json::{Value, json};

use crate::fixture::Workplace;

const REFINE: &str =
    "refine --dataset ds --poses init.csv --method combined --iterations 2 --out refined.csv";
const SCENE: &str = "ds/test/000001";
const RGB: &str = "ds/test/000001/rgb/000000.png";
const DEPTH: &str = "ds/test/000001/depth/000000.png";
const MASK: &str = "ds/test/000001/mask_visib/000000_000000.png";

/// The name of a fault, how it is made, and what the summary must say of it.
type Fault = (&'static str, fn(&Workplace), &'static [&'static str]);

/// Three frames: image 0, where the faults are, image 1 of the same scene, and another scene.
fn workplace() -> Workplace {
    let place = Workplace::new();
    place.copy(SCENE, "ds/test/000002");
    let poses = place.read("ds/init.csv");
    let second = poses.lines().nth(2).unwrap();
    place.write("init.csv", &format!("{poses}2{}\n", second.strip_prefix('1').unwrap()));
    place
}

/// Runs each fault: image 0 fails as expected, and the frames `survivors` are refined nevertheless.
fn table(faults: &[Fault], survivors: &[(u32, u32)]) {
    for (name, make, expected) in faults {
        let place = workplace();
        make(&place);
        let before = place.listing();
        let said = place.prehend(REFINE);
        let err = &said.err;
        assert_eq!(said.code, 2, "{name}: {err}");
        let failed = 3 - survivors.len();
        assert!(
            err.contains(&format!("{} done, {failed} failed:", survivors.len())),
            "{name}: {err}"
        );
        for expected in *expected {
            assert!(err.contains(expected), "{name}: no {expected:?} in: {err}");
        }
        let done: Vec<_> =
            place.poses("refined.csv").iter().map(|r| (r.scene_id, r.im_id)).collect();
        assert_eq!(done, survivors, "{name}");
        let mut after = place.listing();
        after.retain(|file| !file.starts_with("refined.csv"));
        assert_eq!(after, before, "{name}");
    }
}

const OTHERS: [(u32, u32); 2] = [(1, 1), (2, 1)];

/// Edits image 0's entry of a file of scene 1.
fn entry(place: &Workplace, file: &str, edit: impl FnOnce(&mut Value)) {
    place.edit_json(&format!("{SCENE}/{file}"), |all| edit(&mut all["0"]));
}

/// Replaces image 0's row of init.csv.
fn row(place: &Workplace, text: &str) {
    let poses = place.read("init.csv");
    let old = poses.lines().nth(1).unwrap();
    place.replace("init.csv", old, text);
}

/// Replaces column `column` of image 0's row of init.csv.
fn column(place: &Workplace, column: usize, text: &str) {
    let poses = place.read("init.csv");
    let mut fields: Vec<&str> = poses.lines().nth(1).unwrap().split(',').collect();
    fields[column] = text;
    row(place, &fields.join(","));
}

/// Gives image 0 the object 6: a copy of object 5 with a mesh of its own.
fn other_object(place: &Workplace, mesh: impl FnOnce(&mut TriMesh)) {
    column(place, 2, "6");
    let mut model = TriMesh::load(&place.path("ds/models/obj_000005.ply")).unwrap();
    mesh(&mut model);
    model.save_ply(&place.path("ds/models/obj_000006.ply")).unwrap();
    place.edit_json("ds/models/models_info.json", |info| info["6"] = info["5"].clone());
}

/// Gives image 0 a hand of its own.
fn other_hand(place: &Workplace, edit: impl FnOnce(String) -> String) {
    place.write("ds/hand/other.urdf", &edit(place.read("ds/hand/hand.urdf")));
    entry(place, "scene_bodies.json", |e| e["bodies"][0]["urdf"] = json!("hand/other.urdf"));
}

#[test]
fn images() {
    table(
        &[
            (
                "missing color",
                |p| p.remove(RGB),
                &["scene 1 image 0 object 5: ", "rgb/000000.png: no such file"],
            ),
            ("truncated color", |p| p.truncate(RGB, 0.5), &["ds/test/000001/rgb/000000.png: "]),
            (
                "missing depth",
                |p| p.remove(DEPTH),
                &["ds/test/000001/depth/000000.png: no such file"],
            ),
            ("truncated depth", |p| p.truncate(DEPTH, 0.9), &["ds/test/000001/depth/000000.png: "]),
            (
                "depth of eight bits",
                |p| {
                    let file = p.path(DEPTH);
                    Mask::filled(640, 480, true).save(&file).unwrap();
                },
                &["object 5: ds/test/000001/depth/000000.png: expected 16-bit gray"],
            ),
            (
                "no depth",
                |p| {
                    let file = p.path(DEPTH);
                    DepthImage::filled(640, 480, 0.0).save(&file, 1e-4).unwrap();
                },
                &["ds/test/000001/depth/000000.png: every depth is zero"],
            ),
            (
                "depth of another size",
                |p| {
                    let file = p.path(DEPTH);
                    DepthImage::filled(320, 240, 0.5).save(&file, 1e-4).unwrap();
                },
                &["depth/000000.png: is 320x240 pixels but", "000000.png is 640x480"],
            ),
            (
                "missing mask",
                |p| p.remove(MASK),
                &["ds/test/000001/mask_visib/000000_000000.png: no such file"],
            ),
            (
                "truncated mask",
                |p| p.truncate(MASK, 0.6),
                &["ds/test/000001/mask_visib/000000_000000.png: "],
            ),
            (
                "empty mask",
                |p| {
                    let file = p.path(MASK);
                    Mask::filled(640, 480, false).save(&file).unwrap();
                },
                &["mask_visib/000000_000000.png: the mask is empty"],
            ),
            (
                "no depth in the mask",
                |p| {
                    let file = p.path(DEPTH);
                    let mask = p.path(MASK);
                    let mut depth = DepthImage::load(&file, 1e-4).unwrap();
                    let mask = Mask::load(&mask).unwrap();
                    let pixels = depth.pixels_mut().iter_mut().zip(mask.pixels());
                    pixels.filter(|(_, m)| **m).for_each(|(z, _)| *z = 0.0);
                    depth.save(&file, 1e-4).unwrap();
                },
                &["no pixel of the object's mask has a depth"],
            ),
        ],
        &OTHERS,
    );
}

#[test]
fn rows() {
    table(
        &[
            (
                "too few columns",
                |p| row(p, "1,0,5,1"),
                &["init.csv: line 2: row: expected 7 columns, found 4"],
            ),
            (
                "too many columns",
                |p| row(p, "1,0,5,1,2,3,4,5"),
                &["init.csv: line 2: row: expected 7 columns, found 8"],
            ),
            (
                "text for an id",
                |p| column(p, 1, "zero"),
                &["init.csv: line 2: im_id: \"zero\" is not an id"],
            ),
            (
                "text in a rotation",
                |p| column(p, 4, "1 0 0 0 1 0 0 0 x"),
                &["init.csv: line 2: R: \"x\" is not a number"],
            ),
            (
                "NaN in a translation",
                |p| column(p, 5, "0 nan 500"),
                &["init.csv: line 2: t: value 1 is not finite"],
            ),
            (
                "no rotation",
                |p| column(p, 4, "1 0 0 0 1 0 0 0 2"),
                &["init.csv: line 2: R: not orthonormal"],
            ),
            (
                "mirror image",
                |p| column(p, 4, "1 0 0 0 1 0 0 0 -1"),
                &["init.csv: line 2: R: a reflection"],
            ),
            (
                "unknown scene",
                |p| column(p, 0, "9"),
                &["scene 9 image 0 object 5: ds/test: no scene 9"],
            ),
            (
                "unknown image",
                |p| column(p, 1, "7"),
                &["scene 1 image 7 object 5: ds/test/000001/scene_camera.json: no entry \"7\""],
            ),
            (
                "unknown object",
                |p| column(p, 2, "8"),
                &["scene 1 image 0 object 8: ds/models/obj_000008.ply: unknown object id 8"],
            ),
            (
                "behind the camera",
                |p| column(p, 5, "0 0 -500"),
                &[
                    "scene 1 image 0 object 5: ",
                    "object's center at depth -0.",
                    "behind the camera",
                ],
            ),
        ],
        &OTHERS,
    );
}

#[test]
fn entries_of_an_image() {
    table(
        &[
            (
                "NaN in the intrinsics",
                |p| {
                    let file = format!("{SCENE}/scene_camera.json");
                    p.replace(&file, "580.0", "NaN");
                },
                &["scene_camera.json: 0.cam_K[0]: is not a finite number"],
            ),
            (
                "no intrinsics",
                |p| entry(p, "scene_camera.json", |e| e["cam_K"] = json!(null)),
                &["ds/test/000001/scene_camera.json: 0.cam_K: is missing"],
            ),
            (
                "no image in the bodies",
                |p| {
                    p.edit_json(&format!("{SCENE}/scene_bodies.json"), |all| {
                        all.as_object_mut().unwrap().remove("0");
                    });
                },
                &["scene_bodies.json: no entry \"0\""],
            ),
            (
                "hand not rotated",
                |p| entry(p, "scene_bodies.json", |e| e["bodies"][0]["cam_R_b2c"][0] = json!(3)),
                &["scene_bodies.json: 0.bodies[0].cam_R_b2c: not orthonormal"],
            ),
            (
                "no gravity",
                |p| entry(p, "scene_bodies.json", |e| e["gravity"] = json!([0, 0, 0])),
                &["scene_bodies.json: 0.gravity: 0.000e0 m/s² is no gravity"],
            ),
            (
                "two hands",
                |p| {
                    entry(p, "scene_bodies.json", |e| {
                        let hand = e["bodies"][0].clone();
                        e["bodies"].as_array_mut().unwrap().push(hand);
                    });
                },
                &["scene_bodies.json: 0.bodies: expected one hand, found 2"],
            ),
            (
                "missing joint",
                |p| {
                    entry(p, "scene_bodies.json", |e| {
                        let joints = e["bodies"][0]["joints"].as_object_mut().unwrap();
                        let first = joints.keys().next().unwrap().clone();
                        assert_eq!(first, "joint_0.0");
                        joints.remove(&first);
                    });
                },
                &["scene_bodies.json: 0.bodies[0].joints: joint 'joint_0.0' is missing"],
            ),
            (
                "text for a joint",
                |p| {
                    entry(p, "scene_bodies.json", |e| {
                        e["bodies"][0]["joints"]["joint_0.0"] = json!("bent")
                    })
                },
                &["scene_bodies.json: 0.bodies[0].joints.joint_0.0: is not a finite number"],
            ),
            (
                "no image in the touch",
                |p| {
                    p.edit_json(&format!("{SCENE}/scene_tactile.json"), |all| {
                        all.as_object_mut().unwrap().remove("0");
                    });
                },
                &["scene_tactile.json: no entry \"0\""],
            ),
            (
                "a force too few",
                |p| {
                    entry(p, "scene_tactile.json", |e| {
                        e["force"].as_array_mut().unwrap().pop();
                    });
                },
                &[
                    "scene_tactile.json: 0.force: expected 368 forces, one a taxel of ds/hand/taxels.csv, found 367",
                ],
            ),
            (
                "forces of another body",
                |p| entry(p, "scene_tactile.json", |e| e["body"] = json!("left_hand")),
                &["scene_tactile.json: 0.body: names \"left_hand\", but the hand is \"hand\""],
            ),
            (
                "a force of two numbers",
                |p| entry(p, "scene_tactile.json", |e| e["force"][5] = json!([0, 1])),
                &["scene_tactile.json: 0.force[5]: expected 3 numbers, found 2"],
            ),
            (
                "taxels absent",
                |p| entry(p, "scene_tactile.json", |e| e["taxels"] = json!("hand/none.csv")),
                &["ds/hand/none.csv: "],
            ),
        ],
        &OTHERS,
    );
}

#[test]
fn models_and_hands() {
    table(
        &[
            (
                "no ply",
                |p| {
                    other_object(p, |_| ());
                    p.write("ds/models/obj_000006.ply", "no mesh");
                },
                &["ds/models/obj_000006.ply: "],
            ),
            (
                "truncated ply",
                |p| {
                    other_object(p, |_| ());
                    p.truncate("ds/models/obj_000006.ply", 0.5);
                },
                &["ds/models/obj_000006.ply: "],
            ),
            (
                "texture missing",
                |p| {
                    other_object(p, |_| ());
                    p.remove("ds/models/obj_000006.png");
                },
                &["ds/models/obj_000006.ply: texture obj_000006.png: "],
            ),
            (
                "all faces flat",
                |p| {
                    other_object(p, |m| {
                        m.vertices.iter_mut().for_each(|v| *v = Point3::new(v.x, 0.0, 0.0));
                    })
                },
                &["ds/models/obj_000006.ply: the mesh is degenerate"],
            ),
            (
                "all in one point",
                |p| {
                    other_object(p, |m| {
                        m.vertices.iter_mut().for_each(|v| *v = Point3::origin());
                    })
                },
                &["ds/models/obj_000006.ply: the mesh "],
            ),
            (
                "not a number in the mesh",
                |p| other_object(p, |m| m.vertices[3].y = f64::NAN),
                &["ds/models/obj_000006.ply: "],
            ),
            (
                "open without inertia",
                |p| {
                    other_object(p, |m| {
                        m.faces.pop();
                    });
                    p.edit_json("ds/models/models_info.json", |info| {
                        info["6"].as_object_mut().unwrap().remove("inertia_kg_m2");
                    });
                },
                &[
                    "ds/models/obj_000006.ply: the mesh is not closed (3 edges",
                    "inertia must all be given",
                ],
            ),
            (
                "text for a mass",
                |p| {
                    other_object(p, |_| ());
                    p.edit_json("ds/models/models_info.json", |info| {
                        info["6"]["mass_kg"] = json!("heavy")
                    });
                },
                &["ds/models/models_info.json: 6.mass_kg: is not a finite number"],
            ),
            (
                "hand absent",
                |p| {
                    entry(p, "scene_bodies.json", |e| {
                        e["bodies"][0]["urdf"] = json!("hand/none.urdf")
                    })
                },
                &["ds/hand/none.urdf"],
            ),
            (
                "hand of broken XML",
                |p| other_hand(p, |urdf| urdf.replacen("</link>", "", 1)),
                &["ds/hand/other.urdf: invalid URDF: "],
            ),
            (
                "hand with a missing mesh",
                |p| {
                    other_hand(p, |urdf| {
                        let (a, rest) = urdf.split_once("<collision>").unwrap();
                        let (_, b) = rest.split_once("</collision>").unwrap();
                        let mesh = "<geometry><mesh filename=\"palm.stl\"/></geometry>";
                        format!("{a}<collision>{mesh}</collision>{b}")
                    })
                },
                &[
                    "ds/hand/other.urdf: link '",
                    "collision mesh 'palm.stl': no such file in ds/hand",
                ],
            ),
        ],
        &OTHERS,
    );
}

#[test]
fn files_of_a_scene() {
    table(
        &[
            (
                "no camera file",
                |p| p.remove(&format!("{SCENE}/scene_camera.json")),
                &[
                    "scene 1 image 0 object 5: ds/test/000001/scene_camera.json: no such file",
                    "scene 1 image 1 object 5: ",
                ],
            ),
            (
                "camera file is no JSON",
                |p| p.truncate(&format!("{SCENE}/scene_camera.json"), 0.5),
                &["ds/test/000001/scene_camera.json: not valid JSON: "],
            ),
            (
                "no bodies file",
                |p| p.remove(&format!("{SCENE}/scene_bodies.json")),
                &["ds/test/000001/scene_bodies.json: no such file"],
            ),
            (
                "no tactile file",
                |p| p.remove(&format!("{SCENE}/scene_tactile.json")),
                &["ds/test/000001/scene_tactile.json: no such file"],
            ),
            (
                "tactile file is a list",
                |p| p.write(&format!("{SCENE}/scene_tactile.json"), "[1]"),
                &["scene_tactile.json: the top level is not a JSON object"],
            ),
        ],
        &[(2, 1)],
    );
}

/// Nothing can be done: exit code 1, no output file, and an older one stays.
#[test]
fn hopeless_runs() {
    type Case = (&'static str, fn(&Workplace), &'static str, &'static str);
    let cases: [Case; 12] = [
        ("no poses", |p| p.remove("init.csv"), REFINE, "error: init.csv: no such file"),
        ("empty poses", |p| p.write("init.csv", ""), REFINE, "error: init.csv: the file is empty"),
        (
            "only a header",
            |p| p.write("init.csv", "scene_id,im_id,obj_id,score,R,t,time\n"),
            REFINE,
            "error: init.csv: no poses",
        ),
        ("nothing but faults", |p| p.write("init.csv", "1,0\n1,1\n"), REFINE, "0 done, 3 failed"),
        ("no dataset", |p| p.remove("ds"), REFINE, "error: ds: no such file or folder"),
        ("no scenes", |p| p.remove("ds/test"), REFINE, "error: ds: no scene folders"),
        (
            "no models",
            |p| p.remove("ds/models"),
            REFINE,
            "ds/models/obj_000005.ply: unknown object id 5",
        ),
        (
            "filtered away",
            |_| (),
            "refine --dataset ds --poses init.csv --scene 3 --out refined.csv",
            "error: init.csv: no pose is of the scenes, images and objects asked for",
        ),
        (
            "no split",
            |_| (),
            "refine --dataset ds --split val --poses init.csv --out refined.csv",
            "error: ds/val: no such file or folder",
        ),
        (
            "unknown term",
            |_| (),
            "refine --dataset ds --poses init.csv --terms smell --out refined.csv",
            "unknown term",
        ),
        (
            "unknown method",
            |_| (),
            "refine --dataset ds --poses init.csv --method magic --out refined.csv",
            "unknown method: one of fused, ",
        ),
        (
            "terms of a method without",
            |_| (),
            "refine --dataset ds --poses init.csv --method icp --terms depth --out refined.csv",
            "error: --terms: the method icp does not combine gradients",
        ),
    ];
    for (name, make, arguments, expected) in cases {
        let place = workplace();
        place.write("refined.csv", "older");
        make(&place);
        let said = place.prehend(arguments);
        assert_eq!(said.code, 1, "{name}: {}", said.err);
        assert!(said.err.contains(expected), "{name}: {}", said.err);
        assert_eq!(place.read("refined.csv"), "older", "{name}");
    }
}

/// What cannot be written is known before anything else is looked at: here, that there are no poses.
#[test]
fn unwritable_outputs_fail_before_the_work() {
    let place = workplace();
    place.write("file", "");
    for (arguments, expected) in [
        (
            "--poses none --out no/r.csv",
            "error: no/r.csv: cannot be written: there is no folder no",
        ),
        ("--poses none --out ds", "error: ds: cannot be written: is a folder"),
        ("--poses none --out file/r.csv", "error: file/r.csv: cannot be written: "),
        ("--poses init.csv --out r.csv --report file/x", "error: file/x: "),
        ("--poses none --out r.csv", "error: none: no such file"),
    ] {
        let said = place.prehend(&format!("refine --dataset ds {arguments}"));
        assert_eq!(said.code, 1, "{arguments}: {}", said.err);
        assert!(said.err.contains(expected), "{arguments}: {}", said.err);
    }
    let said = place.prehend("refine --frame none.json --out no/pose.json");
    assert!(said.err.contains("no/pose.json: cannot be written"), "{}", said.err);
    assert_eq!(place.listing(), ["ds", "file", "init.csv"]);
}

#[test]
fn eval_and_check_go_on_after_faults() {
    let place = workplace();
    place.remove(RGB);
    entry(&place, "scene_gt.json", |e| e[0]["cam_R_m2c"][0] = json!(2));
    let said = place.prehend("eval --dataset ds --poses init.csv --json");
    let told: Value = serde_json::from_str(&said.out).unwrap();
    assert_eq!((said.code, told["poses"].as_array().unwrap().len()), (2, 2), "{}", said.err);
    let expected =
        "scene 1 image 0 object 5: ds/test/000001/scene_gt.json: 0[0].cam_R_m2c: not orthonormal";
    assert!(told["failures"][0].as_str().unwrap().starts_with(expected), "{}", said.out);
    assert!(said.err.contains(expected), "{}", said.err);
    let said = place.prehend("check --dataset ds --poses init.csv --report look");
    assert_eq!(said.code, 2, "{}", said.err);
    assert!(said.err.contains("rgb/000000.png: no such file"), "{}", said.err);
    assert!(said.out.contains("2 pictures"), "{}", said.out);
    place.remove("ds/test/000001/scene_gt.json");
    place.remove("ds/test/000002/scene_gt.json");
    let said = place.prehend("eval --dataset ds --poses init.csv");
    assert_eq!((said.code, said.out.as_str()), (1, ""), "{}", said.err);
}

#[test]
fn frame_files_name_file_and_field() {
    let place = workplace();
    let frame = json!({
        "K": [580, 0, 319.5, 0, 580, 239.5, 0, 0, 1],
        "rgb": "test/000001/rgb/000000.png",
        "depth": "test/000001/depth/000000.png",
        "depth_unit_m": 1e-4,
        "mask": "test/000001/mask_visib/000000_000000.png",
        "mesh": "models/obj_000005.ply",
        "mesh_unit": "mm",
        "pose": { "unit": "m", "quaternion_wxyz": [1, 0, 0, 0], "translation": [0, 0, 0.4] },
    });
    let with = |field: &str, value: Value| {
        let mut frame = frame.clone();
        frame[field] = value;
        frame.to_string()
    };
    let pose = |field: &str, value: Value| {
        let mut pose = frame["pose"].clone();
        pose[field] = value;
        with("pose", pose)
    };
    let hand = place.json(&format!("{SCENE}/scene_bodies.json"))["0"]["bodies"][0].clone();
    let robot = |joints: &Value, forces: Value| {
        with(
            "robot",
            json!({
                "urdf": "hand/hand.urdf", "base_pose": frame["pose"], "joints": joints,
                "taxels": "hand/taxels.csv", "forces": forces,
            }),
        )
    };
    Mask::filled(3, 2, true).save(&place.path("ds/small.png")).unwrap();
    for (text, expected) in [
        ("{".to_owned(), "error: ds/f.json: EOF"),
        (with("depth_unit", json!(1)), "error: ds/f.json: depth_unit: unknown field `depth_unit`"),
        (with("mesh_unit", json!("inch")), "error: ds/f.json: mesh_unit: unknown variant `inch`"),
        (with("depth_unit_m", json!(0)), "error: ds/f.json: depth_unit_m: must be above zero"),
        (with("K", json!([1, 2])), "error: ds/f.json: K: expected 9 numbers, found 2"),
        (with("K", json!([0, 0, 0, 0, 0, 0, 0, 0, 1])), "error: ds/f.json: K: "),
        (with("rgb", json!("none.png")), "error: ds/f.json: ds/none.png: "),
        (with("mask", json!("init.csv")), "error: ds/f.json: ds/init.csv: "),
        (
            with("mask", json!("small.png")),
            "error: ds/f.json: mask: the image is 3x2 pixels, rgb is 640x480",
        ),
        (with("mesh", json!("none.ply")), "error: ds/f.json: ds/none.ply: "),
        (
            with("mass_kg", json!(-1)),
            "error: ds/f.json: object ds/models/obj_000005.ply: mass must be",
        ),
        (
            pose("quaternion_wxyz", json!([1, 1, 0, 0])),
            "error: ds/f.json: pose: the quaternion has norm",
        ),
        (pose("quaternion_xyzw", json!([0, 0, 0, 1])), "error: ds/f.json: pose: give exactly one"),
        (pose("translation", json!([0, 0, -0.4])), "behind the camera"),
        (
            robot(&json!({}), json!(null)),
            "error: ds/f.json: robot.joints: joint 'joint_0.0' is missing",
        ),
        (
            robot(&hand["joints"], json!([[0, 0, 1]])),
            "error: ds/f.json: robot.forces: expected one force for each of 368 taxels, found 1",
        ),
    ] {
        place.write("ds/f.json", &text);
        let said = place.prehend("refine --frame ds/f.json --iterations 1 --out pose.json");
        assert_eq!((said.code, said.out.as_str()), (1, ""), "{expected}: {}", said.err);
        assert!(said.err.contains(expected), "{expected}: {}", said.err);
        assert!(!place.path("pose.json").exists());
    }
    let said = place.prehend("refine --frame none.json");
    assert!(said.err.starts_with("error: none.json: no such file or folder"), "{}", said.err);
}
