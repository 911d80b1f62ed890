//! Runs that cannot go on, and those that do.

use super::*;

/// Nothing can be done: exit code 1, no output file, and an older one stays.
#[test]
fn hopeless_runs() {
    type Case = (&'static str, fn(&Workplace), &'static str, &'static str);
    let cases: [Case; 15] = [
        ("no poses", |p| p.remove("init.csv"), REFINE, "error: init.csv: no such file"),
        ("empty poses", |p| p.write("init.csv", ""), REFINE, "error: init.csv: the file is empty"),
        (
            "only a header",
            |p| p.write("init.csv", "scene_id,im_id,obj_id,score,R,t,time\n"),
            REFINE,
            "error: init.csv: no poses",
        ),
        ("nothing but faults", |p| p.write("init.csv", "1,0\n1,1\n"), REFINE, "0 done, 2 failed"),
        (
            "no hypotheses",
            |_| (),
            "refine --dataset ds --poses init.csv --hypotheses none.csv --out refined.csv",
            "error: none.csv: no such file",
        ),
        (
            "a broken row of hypotheses",
            |p| p.write("init.csv.hypotheses.csv", "1,0,5,1,1 0 0 0 1 0 0 0,0 0 500,-1\n"),
            REFINE,
            "error: init.csv.hypotheses.csv: line 1: R: ",
        ),
        (
            "hypotheses of other poses",
            |p| p.write("init.csv.hypotheses.csv", "1,9,5,1,1 0 0 0 1 0 0 0 1,0 0 500,-1\n"),
            REFINE,
            "error: init.csv.hypotheses.csv: line 1: pose: scene 1 image 9 object 5: neither",
        ),
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

/// Unwritable outputs are known before anything else is looked at: here, that there are no poses.
#[test]
fn unwritable_outputs_fail_before_the_work() {
    let place = workplace();
    place.write("file", "");
    for (arguments, expected) in [
        (
            "--poses none --out no/r.csv",
            "error: no/r.csv: cannot be written: there is no folder no",
        ),
        // In a folder the file is named as BOP has it.
        ("--poses none --out ds", "error: none: no such file"),
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
        ("{".to_owned(), "error: ds/f.json: not valid JSON: EOF"),
        (with("depth_unit", json!(1)), "error: ds/f.json: depth_unit: unknown field `depth_unit`"),
        (with("mesh_unit", json!("inch")), "error: ds/f.json: mesh_unit: unknown variant `inch`"),
        (with("depth_unit_m", json!(0)), "error: ds/f.json: depth_unit_m: must be above zero"),
        (with("K", json!([1, 2])), "error: ds/f.json: K: expected 9 numbers, found 2"),
        (with("K", json!([0, 0, 0, 0, 0, 0, 0, 0, 1])), "error: ds/f.json: K: "),
        (with("rgb", json!("none.png")), "error: ds/f.json: ds/none.png: "),
        (with("mask", json!("init.csv")), "error: ds/f.json: ds/init.csv: "),
        (
            with("mask", json!("small.png")),
            "error: ds/f.json: ds/small.png: is 3x2 pixels but ds/test/000001/rgb/000000.png is 640x480",
        ),
        (with("mesh", json!("none.ply")), "error: ds/f.json: ds/none.ply: "),
        (with("mass_kg", json!(-1)), "error: ds/f.json: mass_kg: must be above zero"),
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
            "error: ds/f.json: robot.forces: expected 368 forces, one a taxel of ds/hand/taxels.csv, found 1",
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
